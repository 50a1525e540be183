"""How often the ledger's rules are wrong, on runs that are made up, and the whole study with tiny runs."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, TASKS

from studies.reproduction import verdicts
from studies.reproduction.verdicts import Pool, judged
from vsp.paper import ledger


@pytest.fixture
def few(monkeypatch):
    for name, value in (("N_PAIRS", 40), ("N_RESAMPLES", 100), ("N_STARTS", 300), ("N_EPISODES", 100)):
        monkeypatch.setattr(verdicts, name, value)


def pool(seed, runs, shift=0.0):
    """Returns with an effect of the run, one of the start, and a few low ones; cells between 10 and 13."""
    rng, starts = np.random.default_rng(seed), np.random.default_rng(0).normal(size=300)
    returns = 10 + shift + 0.3 * rng.normal(size=(runs, 1)) + starts + 0.2 * rng.normal(size=(runs, 300))
    returns -= 30 * (rng.random(returns.shape) < 0.05)
    return Pool(returns, np.column_stack([rng.normal(size=runs), rng.integers(10, 14, size=runs)]))


def test_runs_of_one_kind_rarely_differ_and_others_do(few):
    found = judged({"task": "x", "against": "the same"}, 20, pool(1, 40), None)
    moved, same = (found[found["against"].eq(verdicts.MOVED) == side].set_index("name") for side in (True, False))
    assert {"mean", "q1", "outliers_mean", "max", "cells"} <= {*same.index}
    assert (same[[*ledger.VERDICTS[:-1]]].sum(axis=1) - 1).abs().max() < 1e-9 and (same["task"] == "x").all()
    usual = same[same["kind"].isin(["mean", "deviation", "quartile", "outliers", "extreme"])]
    assert (usual[ledger.DIFFERS] <= 0.2).all() and usual.loc["mean", ledger.REPRODUCED] > 0.8
    assert moved.at["mean", ledger.DIFFERS] == 1 and len(moved) == 1
    other = judged({"against": "another"}, 20, pool(1, 40), pool(2, 20, shift=2.0)).set_index("name")[ledger.DIFFERS]
    assert other["mean"] == 1 and other["median"] > 0.9 and other["cells"] < 0.5


def test_a_single_policy_has_no_cells_to_compare(few):
    found = judged({"against": "the same"}, 1, Pool(pool(3, 1).returns), None).set_index("name")
    assert found[ledger.DIFFERS]["mean"].min() <= 0.2 and "cells" not in found.index


def test_the_paper_gets_other_starts_and_other_runs(few, monkeypatch):
    pairs, usual = [], ledger.set_against
    monkeypatch.setattr(ledger, "set_against", lambda *given: pairs.append(given[1:3]) or usual(*given))
    judged({"against": "the same"}, 1, Pool(pool(3, 1).returns), None)
    judged({"against": "the same"}, 3, Pool(np.arange(6.0)[:, None] * np.ones(300)), None)  # all starts alike
    assert len(pairs) == 80 and all(here.mean() != values["mean"] for here, values in pairs)


def test_the_whole_study(few, monkeypatch, tmp_path):
    usual = verdicts.experiments

    def shorter(task):
        def less(one):
            config = dataclasses.replace(one.config, n_epochs=40, n_freeze=5)
            return dataclasses.replace(one, config=config, n_episodes=9)

        return {name: less(one) for name, one in usual(task).items()}

    monkeypatch.setattr(verdicts, "experiments", shorter)
    monkeypatch.setattr(verdicts, "N_RUNS", dict.fromkeys(TASKS, 3))
    monkeypatch.setattr(verdicts, "N_PAIRS", 2)
    frame = verdicts.study(tmp_path)
    assert {*frame["against"]} == {"the same", verdicts.MOVED, "least squares", "another teacher"}
    assert frame["subject"].value_counts().index.tolist() == ["distilled", "teacher"] and {*frame["task"]} == {*TASKS}
    assert frame["teacher"][frame["task"] == MOUNTAINCAR].nunique() == 2 and frame["settings"].nunique() == 4
    for task in TASKS:
        made = [len(list(one.folder(tmp_path).glob("[0-9]*"))) for one in verdicts.experiments(task).values()]
        assert made == [6, 3, 3]


def test_wrong_verdicts_by_hand():
    def row(kind, against, differs, unchecked=0.0):
        return {"kind": kind, "against": against, ledger.DIFFERS: differs, ledger.UNCHECKED: unchecked}

    frame = pd.DataFrame([
        row("mean", "the same", 0.04), row("mean", "the same", 0.08), row("mean", "the same", 0.0, 1.0),
        row("mean", "another", 0.5), row("mean", "another", 1.0), row("extreme", "the same", 0.01),
    ])  # fmt: skip
    found = ledger.wrong_verdicts(frame).set_index("kind")
    assert found.loc["mean"].tolist() == pytest.approx([6.0, 8.0, 100.0])
    assert found.loc["extreme"].tolist()[:2] == [1.0, 1.0] and found.columns.tolist()[2] == "another"
