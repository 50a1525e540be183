"""What makes the tables of proofs: returns of pieces, and the command."""

import numpy as np
import pytest
from support import SIMPLEGOAL

import vsp
import vsp_beyond
from studies import make_proofs
from studies.bounds import mean_return
from studies.committed import read_results, write_results
from vsp_beyond.proofs import check


def policy_of(codewords, coefficients, **more):
    return vsp.VoronoiPolicy(codewords, np.array(coefficients, float), task=SIMPLEGOAL, metric="euclidean", **more)


STRAIGHT = policy_of([[0.5, 0.5]], [[[0, 0], [0, 0], [-1, -1]]])
ACTIONS = [[[0, 0], [0, 0], action] for action in ([-1, -1], [-2, 1.5])]  # the second is limited on both sides
TWO = policy_of([[0.25, 0.25], [0.75, 0.75]], ACTIONS, scale=[0.5, 2.0])


def test_returns_are_those_of_the_pieces():
    pieces = vsp_beyond.prove(TWO).pieces
    low, high = mean_return(pieces, width=1e-4)
    returns = vsp.rollout(TWO, SIMPLEGOAL, np.random.default_rng(1).uniform(size=(200_000, 2))).returns
    assert 0 <= high - low <= 1.1e-4 and abs(returns.mean() - low) < 5 * returns.std() / np.sqrt(len(returns))


def test_the_mean_return_where_nothing_moves():
    low, high = mean_return(vsp_beyond.prove(policy_of([[0.5, 0.5]], np.zeros((1, 3, 2)))).pieces, width=1e-4)
    assert low <= 10 * 0.01 - 10 * 0.04 <= high  # what starts in the goal and in the pit


def test_missing_proofs_are_made_and_others_are_not(tmp_path, monkeypatch):
    made, folder = [], tmp_path / "data" / "beyond"
    policies = {"a": STRAIGHT, "b": TWO}
    makers = {name: lambda name=name: made.append(name) or policies[name] for name in policies}
    monkeypatch.setattr(make_proofs, "policies", lambda: makers)
    monkeypatch.setattr(make_proofs, "N_SAMPLED", 2000)
    monkeypatch.setattr(make_proofs, "_of_simplegoal_proof", lambda proof: {"goal": float(proof.areas["goal"])})
    assert make_proofs.certificates(tmp_path, 1) == made == ["a", "b"]
    first = read_results("proofs", folder)
    row = first.set_index("name").loc["a"]
    assert (row["goal"], row["longest"], row["sampled"]) == (0.87, 9, 2000)
    assert row["sampled_goal"] == pytest.approx(0.87, abs=0.03)
    assert row["bytes"] == (folder / "proofs" / "a.json").stat().st_size
    assert check.check(folder / "proofs" / "b.json")["longest"] == first["longest"][1]
    assert make_proofs.certificates(tmp_path, 1) == [] and made == ["a", "b"]
    write_results(first[:1], "proofs", out=tmp_path)  # as somebody who deletes a row
    assert make_proofs.certificates(tmp_path, 1) == ["b"] and made == ["a", "b", "b"]
    assert read_results("proofs", folder)["name"].tolist() == ["a", "b"]
