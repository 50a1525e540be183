import numpy as np
import pytest

from vsp_beyond.few_cells import search
from vsp_beyond.few_cells.anneal import expected_loss, squared_error
from vsp_beyond.few_cells.search import (
    LAST,
    N_STAGES,
    ROUNDS,
    descend,
    least_error,
    local_maps,
    moves,
    spread,
    uncorrelated,
)
from vsp_beyond.few_cells.units import Cells, LabelledStates


def planted(seed=0, n=1500):
    """Three cells, and states labelled by them."""
    rng = np.random.default_rng(0)
    cells = Cells(np.array([[-1.0, 0.0], [1.0, 0.5], [0.5, -1.0]]), rng.uniform(-0.8, 0.8, size=(3, 3, 1)))
    states = np.random.default_rng(seed).uniform(-1.5, 1.5, size=(n, 2))
    inputs, own = np.column_stack([states, np.ones(n)]), cells.closeness(states).argmax(axis=0)
    outputs = cells.outputs(inputs)[own, :, np.arange(n)]
    return cells, LabelledStates(inputs, np.clip(outputs, -1, 1))


@pytest.mark.parametrize("seed", [1, 2])
def test_planted_cells_are_found_again_from_any_seed(seed):
    cells, seen = planted(seed)
    found = least_error(seen, 3, 12, np.random.default_rng(seed))
    assert squared_error(seen, found) < 0.002 * seen.actions.var()
    own, theirs = (one.closeness(seen.inputs[:, :2]).argmax(axis=0) for one in (cells, found))
    names = {(a, b) for a, b in zip(own, theirs) if np.mean((own == a) & (theirs == b)) > 0.005}
    assert len(names) == 3 and len(dict(names)) == 3  # one of theirs for each of ours


def test_a_descent_lowers_the_error_and_stays_at_the_best():
    cells, seen = planted()
    begun = local_maps(seen, 3, np.random.default_rng(3))
    assert squared_error(seen, descend(seen, begun, range(N_STAGES))) < 0.5 * squared_error(seen, begun)
    assert squared_error(seen, descend(seen, cells, range(N_STAGES - 2, N_STAGES))) < 1e-4


def test_the_loss_in_parts_is_that_of_all(monkeypatch):
    cells, seen = planted(n=1000)
    about = {"temperature": 0.2, "clip_slope": 0.1}
    monkeypatch.setattr(search, "AT_ONCE", 300)  # the last part is smaller
    value, gradient = search.whole_loss(cells, seen, **about)
    whole = expected_loss(cells, seen.inputs, seen.actions, **about)
    assert value == pytest.approx(whole[0], rel=1e-12) and gradient == pytest.approx(whole[1], abs=1e-12)


def test_every_stage_has_its_turn():
    stages = [stage for some, _ in ROUNDS for stage in some]
    assert sorted({*stages, *LAST}) == list(range(N_STAGES)) and stages == sorted(set(stages))


def test_local_maps_by_hand():
    """Two clusters with a map of their own each; the pull towards the common map is that of three states."""
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.normal(-5, 0.1, 400), rng.normal(5, 0.1, 400)])
    seen = LabelledStates(np.column_stack([x, np.ones(800)]), np.where(x < 0, 0.5, -0.5)[:, None])
    for seed in range(20):
        cells = local_maps(seen, 2, np.random.default_rng(seed))
        if np.prod(cells.codewords) < 0:  # one in each
            outputs = cells.outputs(seen.inputs)[cells.closeness(x[:, None]).argmax(axis=0), :, np.arange(800)]
            assert np.abs(outputs - seen.actions).max() < 0.05
            return
    raise AssertionError("no seed has a codeword in each cluster")


def test_equal_codewords_are_dropped_without_another_action():
    """A teacher that stands still and that one map reproduces leaves no slope that could move them apart."""
    inputs = np.array([[0.3, 0.4, 1.0]] * 20 + [[0.5, 0.1, 1.0]] * 20)
    seen = LabelledStates(inputs, np.ones((40, 1)))
    cells = least_error(seen, 4, 2, np.random.default_rng(0))
    assert 1 <= len(cells.codewords) <= 2 and squared_error(seen, cells) < 1e-6
    assert len(np.unique(cells.codewords, axis=0)) == len(cells.codewords)


def test_with_fewer_states_than_cells_codewords_repeat():
    cells = local_maps(LabelledStates(np.ones((2, 2)), np.zeros((2, 1))), 4, np.random.default_rng(0))
    assert len(cells.codewords) == 4 and np.isfinite(cells.maps).all()


def test_a_unit_step_changes_the_outputs_by_one():
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(3.0, 0.2, size=(500, 2)), np.ones(500)])  # far from the origin: correlated
    seen = LabelledStates(inputs, np.zeros((500, 1)))
    (basis,) = uncorrelated(seen, np.ones((1, 500)))
    for step in np.eye(3):
        assert np.square(inputs @ basis @ step).mean() == pytest.approx(1.0, rel=0.05)


def test_a_step_and_its_gradient_by_finite_differences():
    cells, seen = planted(n=200)
    bases = uncorrelated(seen, np.ones((3, 200)) / 3)
    move, pull_back = moves(cells, bases, 0.3)
    about = {"temperature": 0.2, "clip_slope": 0.1}
    step = 0.1 * np.random.default_rng(1).normal(size=cells.vector.size)
    at = [move(step + sign * 1e-6 * unit) for unit in np.eye(len(step)) for sign in (1, -1)]
    values = np.array([expected_loss(one, seen.inputs, seen.actions, **about)[0] for one in at]).reshape(-1, 2)
    gradient = pull_back(expected_loss(move(step), seen.inputs, seen.actions, **about)[1])
    assert gradient == pytest.approx((values[:, 0] - values[:, 1]) / 2e-6, abs=1e-6)
    assert np.array_equal(move(np.zeros(len(step))).vector, cells.vector)


# States that stand for all


@pytest.mark.parametrize("n", [1, 7, 100, 250])
def test_rows_are_spread_over_where_the_points_lie(n):
    points = np.random.default_rng(0).random((1000, 2)) ** 2
    rows = spread(points, n, np.random.default_rng(1))
    assert len(rows) == len(set(rows)) == n and rows.min() >= 0 and rows.max() < 1000


def test_a_spread_is_as_dense_as_the_points_with_less_chance_than_draws():
    points = np.random.default_rng(0).random((5000, 2)) ** 2
    rng, left = np.random.default_rng(1), points[:, 0] < 0.1
    spreads = np.array([left[spread(points, 100, rng)].mean() for _ in range(200)])
    draws = np.array([left[rng.permutation(5000)[:100]].mean() for _ in range(200)])
    assert spreads.mean() == pytest.approx(left.mean(), abs=0.01) and spreads.std() < 0.6 * draws.std()


def test_a_spread_over_few_points_is_all_of_them():
    assert spread(np.zeros((3, 2)), 5, np.random.default_rng(0)).tolist() == [0, 1, 2]
