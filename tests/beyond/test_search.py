import dataclasses

import numpy as np
import pytest
from support import slopes

from vsp_beyond.few_cells import search
from vsp_beyond.few_cells.search import N_STAGES, descend, least_error, local_init, moves, uncorrelated, whole_loss
from vsp_beyond.few_cells.units import LabelledStates, ScaledCells, expected_loss, spread, squared_error


def planted(seed=0, n=1500):
    """Three cells, and states labelled by them."""
    rng = np.random.default_rng(0)
    cells = ScaledCells(np.array([[-1.0, 0.0], [1.0, 0.5], [0.5, -1.0]]), rng.uniform(-0.8, 0.8, size=(3, 3, 1)))
    states = np.random.default_rng(seed).uniform(-1.5, 1.5, size=(n, 2))
    inputs, nearest = np.column_stack([states, np.ones(n)]), cells.nearest(states)
    outputs = cells.outputs(inputs)[nearest, :, np.arange(n)]
    return cells, LabelledStates(inputs, np.clip(outputs, -1, 1))


def test_planted_cells_are_found_again():
    planted_cells, labelled = planted(1)
    cells = least_error(labelled, 3, 12, np.random.default_rng(1))
    assert squared_error(labelled, cells) < 0.002 * labelled.actions.var()
    first, second = (those.nearest(labelled.inputs[:, :2]) for those in (planted_cells, cells))
    pairs = {(a, b) for a, b in zip(first, second) if np.mean((first == a) & (second == b)) > 0.005}
    assert len(pairs) == 3 == len(dict(pairs))  # one of these for each of those


def test_a_descent_lowers_the_error_and_stays_at_the_best():
    cells, labelled = planted()
    begun = local_init(labelled, 3, np.random.default_rng(3))
    assert squared_error(labelled, descend(labelled, begun, range(N_STAGES))) < 0.5 * squared_error(labelled, begun)
    assert squared_error(labelled, descend(labelled, cells, range(N_STAGES - 2, N_STAGES))) < 1e-4


def test_rounds_see_few_states_and_the_last_descent_all(monkeypatch):
    seen, (_, labelled) = [], planted(n=300)
    monkeypatch.setattr(search, "FEW", 50)
    monkeypatch.setattr(search, "descend", lambda those, cells, *_, **__: seen.append(len(those.inputs)) or cells)
    least_error(labelled, 2, 3, np.random.default_rng(0))
    assert seen[0] == 50 and seen[-1] == 300


def test_the_loss_in_parts_is_that_of_all(monkeypatch):
    cells, labelled = planted(n=1000)
    about = {"temperature": 0.2, "clip_slope": 0.1}
    monkeypatch.setattr(search, "AT_ONCE", 300)  # the last part is smaller
    value, gradient = whole_loss(cells, labelled, **about)
    whole = expected_loss(cells, labelled.inputs, labelled.actions, **about)
    assert value == pytest.approx(whole[0], rel=1e-12) and gradient == pytest.approx(whole[1], abs=1e-12)


def test_local_init_by_hand():
    """Two clusters with a map of their own each; the pull towards the common map is that of three states."""
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.normal(-5, 0.1, 400), rng.normal(5, 0.1, 400)])
    labelled = LabelledStates(np.column_stack([x, np.ones(800)]), np.where(x < 0, 0.5, -0.5)[:, None])
    for seed in range(20):
        cells = local_init(labelled, 2, np.random.default_rng(seed))
        if np.prod(cells.codewords) < 0:  # one in each
            outputs = cells.outputs(labelled.inputs)[cells.nearest(x[:, None]), :, np.arange(800)]
            assert np.abs(outputs - labelled.actions).max() < 0.05
            return
    raise AssertionError("no seed has a codeword in each cluster")


def test_equal_codewords_are_dropped_without_another_action():
    """With fewer states than cells, codewords repeat, and one map leaves no slope that could move them apart."""
    labelled = LabelledStates(np.array([[0.3, 0.4, 1.0], [0.5, 0.1, 1.0]]), np.ones((2, 1)))
    cells = least_error(labelled, 4, 2, np.random.default_rng(0))
    assert 1 <= len(cells.codewords) <= 2 and squared_error(labelled, cells) < 1e-6
    assert len(np.unique(cells.codewords, axis=0)) == len(cells.codewords)


def test_a_unit_step_changes_the_outputs_by_one():
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(3.0, 0.2, size=(500, 2)), np.ones(500)])  # far from the origin: correlated
    labelled = LabelledStates(inputs, np.zeros((500, 1)))
    (basis,) = uncorrelated(labelled, np.ones((1, 500)))
    for step in np.eye(3):
        assert np.square(inputs @ basis @ step).mean() == pytest.approx(1.0, rel=0.05)


def test_a_step_and_its_gradient_by_finite_differences():
    cells, labelled = planted(n=200)
    labelled = dataclasses.replace(labelled, ridge=0.5)
    bases = uncorrelated(labelled, np.ones((3, 200)) / 3)
    move, pull_back = moves(cells, bases, 0.3)
    about = {"temperature": 0.2, "clip_slope": 0.1}
    step = 0.1 * np.random.default_rng(1).normal(size=cells.vector.size)
    gradient = pull_back(whole_loss(move(step), labelled, **about)[1])
    expected = slopes(lambda step: whole_loss(move(step), labelled, **about)[0], step)
    assert gradient == pytest.approx(expected, abs=1e-6)
    assert np.array_equal(move(np.zeros(len(step))).vector, cells.vector)


def test_a_codeword_that_no_state_is_near_may_move_far():
    cells, labelled = planted()
    far = ScaledCells(np.vstack([cells.codewords, [[99, 99]]]), np.vstack([cells.coefficients, cells.coefficients[:1]]))
    moved = search.even_moves(labelled, far)(np.ones(far.vector.size)).codewords - far.codewords
    assert moved[3].min() > 3 * moved[:3].max()


# States that stand for all


@pytest.mark.parametrize(("n", "size"), [(1, 1), (250, 250), (2000, 1000)])
def test_rows_are_spread_over_where_the_points_lie(n, size):
    rows = spread(np.random.default_rng(0).random((1000, 2)) ** 2, n, np.random.default_rng(1))
    assert len(rows) == len(set(rows)) == size and rows.min() >= 0 and rows.max() < 1000


def test_a_spread_is_as_dense_as_the_points_with_less_chance_than_draws():
    points = np.random.default_rng(0).random((5000, 2)) ** 2
    rng, left = np.random.default_rng(1), points[:, 0] < 0.1
    spreads = np.array([left[spread(points, 100, rng)].mean() for _ in range(200)])
    draws = np.array([left[rng.permutation(5000)[:100]].mean() for _ in range(200)])
    assert spreads.mean() == pytest.approx(left.mean(), abs=0.01) and spreads.std() < 0.6 * draws.std()


def test_thinned_states_keep_their_actions():
    labelled = LabelledStates(np.column_stack([np.arange(100.0), np.ones(100)]), np.arange(100.0)[:, None])
    thin = labelled.thinned(10, np.random.default_rng(0))
    assert np.sort(thin.states.ravel() // 10).tolist() == list(range(10)) and np.array_equal(thin.states, thin.actions)
