import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import MOUNTAINCAR, SIMPLEGOAL

import vsp
from studies import comparison
from vsp.paper.baselines import rule_of_thumb
from vsp.tasks import GOAL, mountaincar
from vsp_beyond.proofs import at_rest, dead_points, tables


def policy_of(codewords, coefficients, **more):
    return vsp.VoronoiPolicy(codewords, np.array(coefficients, float)[..., None], task=MOUNTAINCAR, **more)


def test_the_acceleration_is_that_of_the_task():
    x, push = np.linspace(-0.6, -0.4, 9), np.linspace(-1.5, 1.5, 9)
    moved, _, _ = mountaincar.step(np.column_stack([x, np.zeros(9)]), push[:, None])
    assert np.allclose(moved[:, 1], dead_points.acceleration(x, push), atol=1e-9)


DOWNHILL = [[0, 0, 0.1], [0, 0, -0.1]]  # with the slope, on both sides of the bottom at -0.524


@pytest.mark.parametrize(
    ("policy", "dead"),
    [(rule_of_thumb(MOUNTAINCAR)[1], [True]),  # no push at rest: its dead point is at the bottom
     (policy_of([[-0.6236, 0], [-0.4236, 0]], DOWNHILL, metric="euclidean"), [False, False]),  # a border at the bottom
     (policy_of([[-0.55, 0], [-0.45, 0]], DOWNHILL), [True, False]),  # one beside it
     (policy_of([[0, 0]], [[0, 20, 0.7]]), [False]),  # a strong push
     (vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{MOUNTAINCAR}.policy"), [False, False])],
)  # fmt: skip
def test_borders_and_strong_pushes_remove_dead_points(policy, dead):
    assert at_rest(policy)["dead"].tolist() == dead


def test_without_a_pull_every_place_without_a_push_is_dead(monkeypatch):
    monkeypatch.setattr(dead_points, "PULL", 0.0)
    assert at_rest(policy_of([[0, 0]], [[1, 0, 0.4]]))["dead"].tolist() == [True]


def test_a_car_at_its_dead_point_stays_there():
    bottom = rule_of_thumb(MOUNTAINCAR)[1]
    row = tables.dead_point_table({"12 v": bottom}).iloc[0]
    assert row["dead point"] == pytest.approx(-np.pi / 6) and row["left"] > 0 > row["right"] and row["borders"] == 0
    assert vsp.rollout(bottom, MOUNTAINCAR, np.array([[row["dead point"], 0.0]])).outcomes[0] != GOAL


@given(st.integers(0, 2**31), st.sampled_from(["euclidean", "manhattan"]))
def test_the_parts_are_the_cells_of_the_policy(seed, metric):
    rng = np.random.default_rng(seed)
    codewords = rng.uniform([-0.7, -0.05], [-0.3, 0.05], size=(4, 2))
    policy = policy_of(codewords, rng.normal(size=(4, 3)), metric=metric, scale=np.array([0.2, 0.05]))
    table, x = at_rest(policy), np.linspace(-0.599, -0.401, 400)
    assert table["low"].iloc[0] == -0.6 and table["high"].iloc[-1] == -0.4
    assert (table["high"][:-1].to_numpy() == table["low"][1:].to_numpy()).all()
    cells = table["cell"].to_numpy()[np.searchsorted(table["high"], x)]
    assert (cells == policy.cells(np.column_stack([x, np.zeros(400)]))).all()


def test_other_policies_get_one_clear_error():
    with pytest.raises(ValueError, match="expected a VoronoiPolicy for Mountain"):
        at_rest(vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task=SIMPLEGOAL))


# The other tables


def test_tables_are_read_and_curves_are_those_of_the_certificates():
    table = tables.simplegoal_table().set_index("policy")
    assert table.loc["tuned", ["cells", "outside", "program"]].tolist() == [4, 0, 1] and len(table) == 8
    assert ((table["failing"] - table["sampled"]).abs() < 1e-3).all()
    assert tables.pendulum_table()["share"].is_monotonic_increasing
    starts, least = tables.least_returns()
    assert (np.diff(starts) > 0).all() and -0.6 < starts[0] < starts[-1] < -0.4 and (least > 90).all()
    steps = tables.pendulum_steps()
    assert steps.shape == (1008, 1008) and steps.min() == -1
