"""The tree that notebook 05 compares with."""

import numpy as np
import pytest
from sklearn.tree import DecisionTreeRegressor
from support import TASKS, examples

from vsp.paper.baselines import Tree


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("leaves", [2, 13, 32])
def test_a_tree_is_that_of_scikit_learn(task, leaves):
    states, actions = examples(task)
    tree, other = Tree(states, actions, leaves=leaves), examples(task, seed=1)[0]
    model = DecisionTreeRegressor(max_leaf_nodes=leaves, criterion="squared_error", random_state=0)
    found, state = tree.predict(other)
    assert found.shape == actions.shape and state is None
    assert np.array_equal(found, model.fit(states, actions).predict(other).reshape(actions.shape))
    assert len(tree) == leaves == len(np.unique(tree.predict(states)[0], axis=0))


def test_a_leaf_holds_the_mean_action_of_its_states():
    states = np.array([[0.1, 0.5], [0.2, 0.5], [0.8, 0.5], [0.9, 0.5]])
    actions = np.array([[0.0, 1.0], [0.2, 1.0], [-1.0, -1.0], [-0.6, -1.0]])
    tree = Tree(states, actions, leaves=2)
    assert np.allclose(tree.predict(np.array([[0.0, 0.0], [1.0, 1.0]]))[0], [[0.1, 1.0], [-0.8, -1.0]])
    assert len(Tree(states[:3], actions[:3], leaves=13)) == 3  # no more leaves than states
    assert len(Tree(states, np.ones((4, 2)), leaves=13)) == 1
    assert np.allclose(Tree(states, actions, leaves=1).predict(states)[0], actions.mean(axis=0))
