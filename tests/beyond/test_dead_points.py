import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import MOUNTAINCAR, SIMPLEGOAL

import vsp
from studies import comparison
from vsp.paper.baselines import rule_of_thumb
from vsp.tasks import GOAL, mountaincar
from vsp_beyond.proofs import at_rest
from vsp_beyond.proofs.dead_points import acceleration


def policy_of(codewords, maps, **more):
    return vsp.VoronoiPolicy(codewords, np.array(maps, float)[..., None], task=MOUNTAINCAR, **more)


def test_the_acceleration_is_that_of_the_task():
    x, push = np.linspace(-0.6, -0.4, 9), np.linspace(-1.5, 1.5, 9)
    moved, _, _ = mountaincar.step(np.column_stack([x, np.zeros(9)]), push[:, None])
    assert np.allclose(moved[:, 1], acceleration(x, push), atol=1e-9)


def test_one_map_without_push_at_rest_has_its_dead_point_at_the_bottom():
    table = at_rest(rule_of_thumb(MOUNTAINCAR)[1])
    assert len(table) == 1 and table["dead"].all() and table.loc[0, "g_low"] > 0 > table.loc[0, "g_high"]
    bottom = np.array([[-np.pi / 6, 0.0]])
    assert vsp.rollout(rule_of_thumb(MOUNTAINCAR)[1], MOUNTAINCAR, bottom).outcomes[0] != GOAL


def test_a_border_removes_it_and_so_does_a_strong_push():
    pulls = [[0, 0, 0.1], [0, 0, -0.1]]  # with the slope, on both sides of the bottom at -0.524
    border = policy_of([[-0.6236, 0], [-0.4236, 0]], pulls, metric="euclidean")
    table = at_rest(border)
    assert table["cell"].tolist() == [0, 1] and not table["dead"].any() and np.isclose(table.loc[0, "high"], -0.5236)
    strong = policy_of([[0, 0]], [[0, 20, 0.7]])
    assert not at_rest(strong)["dead"].any()


def test_a_border_at_the_wrong_place_leaves_it():
    wrong = policy_of([[-0.55, 0], [-0.45, 0]], [[0, 0, 0.1], [0, 0, -0.1]])
    assert at_rest(wrong)["dead"].tolist() == [True, False]


def test_the_policy_at_the_limit_has_none():
    best = vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{MOUNTAINCAR}.policy")
    assert not at_rest(best)["dead"].any() and len(at_rest(best)) > 1


@given(st.integers(0, 2**31), st.sampled_from(["euclidean", "manhattan"]))
def test_the_parts_are_the_cells_of_the_policy(seed, metric):
    rng = np.random.default_rng(seed)
    codewords = rng.uniform([-0.7, -0.05], [-0.3, 0.05], size=(4, 2))
    policy = policy_of(codewords, rng.normal(size=(4, 3)), metric=metric, scale=np.array([0.2, 0.05]))
    table, x = at_rest(policy), np.linspace(-0.599, -0.401, 400)
    assert table["low"].iloc[0] == -0.6 and table["high"].iloc[-1] == -0.4
    assert (table["high"][:-1].to_numpy() == table["low"][1:].to_numpy()).all()
    own = table["cell"].to_numpy()[np.searchsorted(table["high"], x)]
    assert (own == policy.cells(np.column_stack([x, np.zeros(400)]))).all()


def test_other_policies_get_one_clear_error():
    for other in (vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task=SIMPLEGOAL), "a name"):
        with pytest.raises(ValueError, match="expected a VoronoiPolicy for Mountain"):
            at_rest(other)
