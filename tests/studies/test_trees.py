import dataclasses

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression
from support import MOUNTAINCAR, SIMPLEGOAL, examples

from studies.rivals.trees import LinearTree, ObliqueLinearTree
from vsp.paper.baselines import Tree

# Trees


@pytest.mark.parametrize("make", [LinearTree, lambda *data, **about: ObliqueLinearTree(*data, **about, seed=0)])
def test_constant_leaves_hold_the_mean_action_of_their_states(make):
    states, actions = examples(SIMPLEGOAL)
    tree = make(states, actions, leaves=5, task=SIMPLEGOAL, constant=True)
    assert len(tree) == 5
    for node in tree.ends:
        own = np.clip(actions[node.rows].mean(axis=0), -1, 1)
        assert np.allclose(tree.predict(states[node.rows])[0], own)


@pytest.mark.parametrize("leaves", [1, 4])
def test_the_linear_leaves_are_fitted_to_their_states(leaves):
    states, actions = examples(SIMPLEGOAL)
    tree, other = LinearTree(states, actions, leaves=leaves, task=SIMPLEGOAL), examples(SIMPLEGOAL, seed=1)[0]
    leaf, asked = tree.apply(tree.inputs(states)), tree.apply(tree.inputs(other))
    assert len(tree) == leaves == len(np.unique(leaf)) and np.bincount(leaf)[leaf].min() >= 6
    for node in np.unique(leaf):
        assert np.array_equal(np.flatnonzero(leaf == node), tree.nodes[node].rows)
        own = LinearRegression().fit(states[leaf == node], actions[leaf == node])
        expected = np.clip(own.predict(other[asked == node]), -1, 1)
        assert np.allclose(tree.predict(other[asked == node])[0], expected)


def test_a_linear_tree_splits_where_lines_break_and_not_where_means_differ():
    """Along x the action is one steep line, along y it has a kink: constants would be told apart by x."""
    states = np.random.default_rng(0).random((2000, 2))
    action = 0.8 * states[:, :1] - 0.6 + 0.3 * np.abs(states[:, 1:] - 0.5)
    linear, constant = LinearTree(states, action, leaves=2, task=MOUNTAINCAR), Tree(states, action, leaves=2)
    split = linear.nodes[0].split
    assert split.direction.tolist() == [0, 1] and constant.model.tree_.feature[0] == 0
    assert split.threshold * linear.scale[1] + linear.centre[1] == pytest.approx(0.5, abs=0.02)
    assert np.abs(linear.predict(states)[0] - action).max() < 0.02


def test_a_constant_variable_and_too_few_states_are_no_trouble():
    states, actions = examples(SIMPLEGOAL)
    states[:, 1] = 0.5
    tree = LinearTree(states, actions, leaves=3, task=SIMPLEGOAL)
    assert len(tree) == 3 and {tuple(node.split.direction) for node in tree.nodes if node.children} == {(1, 0)}
    line = states @ [[0.5], [0.0]] + 0.1
    assert len(LinearTree(states, line, leaves=5, task=MOUNTAINCAR)) == 1  # no split where one map is exact
    assert len(LinearTree(states[:11], actions[:11], leaves=3, task=SIMPLEGOAL)) == 1  # six on each side are too many


# Oblique trees


def test_an_oblique_tree_with_maps_finds_two_oblique_maps():
    states = np.random.default_rng(0).random((2000, 2))
    right = states @ [1, 1] > 1.1
    actions = np.where(right[:, None], 0.5 * states, 0.3 - 0.8 * states[:, ::-1])
    tree = ObliqueLinearTree(states, actions, leaves=2, task=SIMPLEGOAL, seed=0)
    straight = LinearTree(states, actions, leaves=2, task=SIMPLEGOAL)
    error, other = (np.square(one.predict(states)[0] - actions).mean() for one in (tree, straight))
    assert error < 0.2 * other and len(tree) == 2
    split = tree.nodes[0].split
    normal = split.direction / tree.scale
    assert abs(normal[0] / normal[1] - 1) < 0.2


def test_a_linear_split_saves_what_it_says():
    states, actions = examples(SIMPLEGOAL)
    tree, whole = (ObliqueLinearTree(states, actions, leaves=n, task=SIMPLEGOAL, seed=0) for n in (2, 1))
    assert len(ObliqueLinearTree(states, np.ones((300, 2)), leaves=4, task=SIMPLEGOAL, seed=0)) == 1
    nodes = ObliqueLinearTree(states, actions, leaves=5, task=SIMPLEGOAL, seed=0).nodes  # the best splits come first
    gains = [
        [node.split.gain for node in nodes if node.split and bool(node.children) == inner] for inner in (True, False)
    ]
    assert min(gains[0]) >= max(gains[1]) - 1e-9
    tree.task = whole.task = dataclasses.replace(tree.task, action_low=-np.full(2, 9.0), action_high=np.full(2, 9.0))
    errors = [np.square(one.predict(states)[0] - actions).sum() for one in (whole, tree)]
    assert tree.nodes[0].split.gain == pytest.approx(errors[0] - errors[1], rel=1e-5) and len(whole) == 1
