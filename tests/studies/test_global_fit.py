import numpy as np
import pytest
from support import SIMPLEGOAL, examples, slopes

from studies.comparison import global_fit
from studies.comparison.global_fit import RandomTree, descend, expected_loss, global_tree, greedy_cells
from studies.comparison.tuning import of_tree
from studies.rivals.trees import ObliqueLinearTree, Split
from vsp import VoronoiPolicy, get_task
from vsp_beyond.few_cells import search
from vsp_beyond.few_cells.units import LabelledStates, Scaling

TASK = get_task(SIMPLEGOAL)


@pytest.fixture(autouse=True)
def shorter(monkeypatch):
    monkeypatch.setattr(global_fit, "random_starts", lambda size: 2)
    monkeypatch.setattr(global_fit, "N_GREEDY", 1)
    monkeypatch.setattr(global_fit, "HOT", ((range(4, 6), 1),))
    monkeypatch.setattr(global_fit, "WARM", ((range(8, 9), 1),))


def kinked(n=600, seed=0):
    """Two maps on either side of an oblique line, with actions inside the limits."""
    states = np.random.default_rng(seed).random((n, 2))
    right = states @ [1.0, 0.5] > 0.8
    return states, np.where(right[:, None], 0.5 * states - 0.2, 0.3 - 0.8 * states[:, ::-1])


def tree_of(leaves=4, seed=0, kind=RandomTree):
    """A tree, as it is tuned, and the labelled states."""
    states, actions = examples(SIMPLEGOAL)
    tree = kind(states, actions, leaves=leaves, task=TASK, seed=seed)
    frame = Scaling.of(TASK, states)
    return tree, of_tree(tree), LabelledStates(frame.inputs(states), frame.outputs(2 * actions))  # some beyond limits


def oblique(states, actions, seed=0):
    return ObliqueLinearTree(states, actions, leaves=2, task=TASK, seed=seed)


def error(policy, states, actions):
    return np.square(policy.predict(states)[0] - actions).mean()


# Soft trees


def test_the_gradient_is_that_of_finite_differences():
    _, numbers, seen = tree_of()
    about = {"temperature": 0.3, "clip_slope": 0.1}
    vector = numbers.vector + 0.1 * np.random.default_rng(1).normal(size=numbers.vector.size)
    expected = slopes(lambda vector: expected_loss(numbers.like(vector), seen, **about)[0], vector)
    assert expected_loss(numbers.like(vector), seen, **about)[1] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("leaves", [1, 2, 5])
def test_in_the_cold_the_soft_tree_is_the_hard_one(leaves):
    _, numbers, seen = tree_of(leaves)
    soft = global_fit.shares(numbers, seen.inputs[:, :-1], 1e-7)
    assert np.allclose(soft.sum(axis=0), 1) and np.allclose(soft.max(axis=0), 1)
    loss, _ = expected_loss(numbers, seen, temperature=1e-7, clip_slope=0.0)
    states, _ = examples(SIMPLEGOAL)
    outputs = numbers.frame.outputs(numbers.predict(states)[0])
    assert loss == pytest.approx(np.square(outputs - seen.actions).mean())
    assert global_fit.shares(numbers, seen.inputs[:, :-1], 0.5).sum(axis=0) == pytest.approx(1.0)


def test_a_random_tree_has_states_in_every_leaf():
    trees = [tree_of(6, seed)[0] for seed in range(5)]
    assert all(len(tree) == 6 and min(len(node.rows) for node in tree.ends) > 0 for tree in trees)
    assert len({tree.nodes[0].split.threshold for tree in trees}) == 5
    same = np.full((20, 2), 0.5)
    assert len(RandomTree(same, examples(SIMPLEGOAL, n=20)[1], leaves=4, task=TASK, seed=0)) == 1


def test_a_descent_finds_a_planted_border():
    states, actions = kinked()
    begun = of_tree(oblique(states, actions))
    ended = descend(begun, states, actions, range(10, search.N_STAGES))
    assert error(ended, states, actions) < 0.2 * error(begun, states, actions)
    assert len(ended) == 2


# Each fit


def test_a_tree_fitted_together_is_no_worse_than_the_greedy_one():
    for states, actions in (kinked(), examples(SIMPLEGOAL)):
        found = global_tree(states, actions, 2, TASK, 0)
        greedy = min(error(oblique(states, actions, seed), states, actions) for seed in (0, 1))
        assert len(found) == 2 and error(found, states, actions) < 1.05 * greedy + 1e-9


def test_two_cells_are_a_tree_of_two_leaves():
    """Two codewords and one oblique cut are the same borders: both greedy fits take the same hyperplane."""
    for states, actions in (kinked(), examples(SIMPLEGOAL)):
        cells = greedy_cells(states, actions, 2, TASK, 3)
        assert isinstance(cells, VoronoiPolicy) and cells.metric == "euclidean" and len(cells) == 2
        assert error(cells, states, actions) <= error(oblique(states, actions, 3), states, actions) + 1e-12


def test_pairs_by_hand():
    """The plane x = 1: the codeword (0, 5) is mirrored at (2, 5); the means are (0, 0) and (4, 1)."""
    points = np.array([[-1.0, 0.0], [1.0, 0.0], [3.0, 1.0], [5.0, 1.0]])
    found = global_fit.pairs(np.array([0.0, 5.0]), points, Split(1.0, np.array([1.0, 0.0]), 1.0))
    expected = [[[0, 0], [4, 1]], [[0, 5], [2, 5]], [[0, 0], [2, 0]], [[4, 1], [-2, 1]]]
    assert np.allclose(found, expected)


def test_greedy_cells_stop_where_one_map_is_exact():
    states, _ = examples(SIMPLEGOAL)
    assert len(greedy_cells(states, 0.5 * states - 0.2, 4, TASK, 0)) == 1
    assert len(greedy_cells(*examples(SIMPLEGOAL), 4, TASK, 0)) == 4
