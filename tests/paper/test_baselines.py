import functools
import types

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.tree import DecisionTreeRegressor
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, TEACHERS, examples

from studies.comparison.makers import dagger
from vsp import VoronoiPolicy, get_task
from vsp.evaluation import evaluate
from vsp.paper.baselines import Tree, kmeans_cells, linear_map, refit, rule_of_thumb
from vsp.rollouts import visited_states

# One linear map


@pytest.mark.parametrize("task", TASKS)
def test_the_linear_map_is_that_of_least_squares(task):
    states, actions = examples(task)
    policy, model = linear_map(states, actions, task), LinearRegression().fit(states, actions)
    assert np.allclose(policy.coefficients[0], np.vstack([model.coef_.T, model.intercept_]))
    assert len(policy) == 1 and policy.codewords[0] == pytest.approx(states.mean(axis=0))


# The tree that notebook 05 compares with


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
    assert len(Tree(states[:2], actions[:2], leaves=leaves)) == 2  # no more leaves than states
    mean = Tree(states, actions, leaves=1)
    assert len(mean) == 1 and np.allclose(mean.predict(states)[0], actions.mean(axis=0))


# Cells of k-means, and DAgger


def test_cells_of_kmeans_stand_where_the_states_are():
    rng = np.random.default_rng(0)
    groups = np.array([[0.2, 0.2], [0.8, 0.2], [0.5, 0.9]])
    states = np.concatenate([group + 0.02 * rng.normal(size=(100, 2)) for group in groups])
    actions = np.repeat([[0.1, -0.5], [0.7, 0.2], [-0.3, 0.9]], 100, axis=0)
    policy = kmeans_cells(states, actions, cells=3, task=SIMPLEGOAL, seed=0)
    near = policy.codewords[np.square(groups[:, None] - policy.codewords).sum(axis=2).argmin(axis=1)]
    assert np.abs(near - groups).max() < 0.01 and np.allclose(policy.predict(states)[0], actions)
    again, other = (kmeans_cells(*examples(SIMPLEGOAL), cells=9, task=SIMPLEGOAL, seed=seed) for seed in (1, 2))
    assert not np.array_equal(again.codewords, other.codewords)
    with pytest.raises(ValueError, match="cells is 3, expected an integer from 1 to 2"):  # two places, three cells
        kmeans_cells(groups[[0, 1] * 20], np.zeros((40, 2)), cells=3, task=SIMPLEGOAL, seed=0)


ROUNDS = types.SimpleNamespace(
    n_episodes=20, n_corrections=2, n_correction_episodes=10, n_validation=50, failure_penalty=0.0
)


def test_dagger_labels_the_states_that_the_policy_visits():
    seen = []

    def fit(states, actions):
        seen.append((states, actions))
        return Tree(states, actions, leaves=3)

    teacher = TEACHERS[SIMPLEGOAL]
    dagger([fit], teacher, get_task(SIMPLEGOAL), rounds=ROUNDS, seed=0)
    assert len(seen) == 3 and all(np.array_equal(a, teacher.predict(s)[0]) for s, a in seen)
    for (fewer, _), (more, _) in zip(seen, seen[1:]):
        assert np.array_equal(more[: len(fewer)], fewer) and len(more) > len(fewer) + 10
    own = Tree(*seen[0], leaves=3)
    rng = np.random.default_rng(np.random.SeedSequence(0).spawn(2)[0])
    task = get_task(SIMPLEGOAL)
    task.start(rng, 20)
    assert np.array_equal(seen[1][0][len(seen[0][0]) :], visited_states(own, task, task.start(rng, 10)))


def test_dagger_keeps_the_best_on_the_validation_starts():
    gains = iter([5.0, -40.0, 40.0])  # pumping, braking, pumping hard

    def fit(states, actions):
        return VoronoiPolicy(np.zeros((1, 2)), [[[0.0], [next(gains)], [0.0]]], task=MOUNTAINCAR)

    kept = dagger([fit], TEACHERS[MOUNTAINCAR], get_task(MOUNTAINCAR), rounds=ROUNDS, seed=0)
    assert kept.coefficients[0, 1, 0] == 40.0
    gains = iter([12.0, -40.0, 40.0])
    kept = dagger([fit], TEACHERS[MOUNTAINCAR], get_task(MOUNTAINCAR), rounds=ROUNDS, seed=0)
    assert kept.coefficients[0, 1, 0] == 12.0


def test_of_several_fits_the_one_with_the_best_first_policy_goes_on():
    made = []

    def fit(states, actions, *, gain):
        made.append(gain)
        return VoronoiPolicy(np.zeros((1, 2)), [[[0.0], [gain], [0.0]]], task=MOUNTAINCAR)

    fits = [functools.partial(fit, gain=gain) for gain in (-40.0, 40.0, 0.0)]
    kept = dagger(fits, TEACHERS[MOUNTAINCAR], get_task(MOUNTAINCAR), rounds=ROUNDS, seed=0)
    assert made == [-40.0, 40.0, 0.0, 40.0, 40.0] and kept.coefficients[0, 1, 0] == 40.0


# Rules of thumb


def test_rules_of_thumb_by_hand_and_what_is_said_of_them():
    (straight, always), (pumping, rule) = map(rule_of_thumb, TASKS)
    assert (straight, pumping) == ("always (−1, −1)", "12 · velocity") and len(always) == 1
    assert (always.predict(np.array([[0.0, 0.0], [0.9, 0.2], [0.5, 1.0]]))[0] == -1).all()
    forces, _ = rule.predict(np.array([[-0.5, 0.0], [0.3, 0.05], [-1.2, -0.07], [0.6, 0.07]]))
    assert np.allclose(forces, [[0], [0.6], [-0.84], [0.84]])
    frame = evaluate(rule, MOUNTAINCAR, 200, seed=30)
    assert frame["return"].mean() > 97 and (frame["outcome"] == "goal").all()
    frame = evaluate(always, SIMPLEGOAL, 200, seed=30)
    assert set(frame["outcome"]) == {"goal", "pit"} and 0.05 < (frame["outcome"] == "pit").mean() < 0.3


# The same cells with other maps


def test_refitted_maps_are_those_of_least_squares_or_the_mean_action_in_each_cell():
    codewords, maps = [[0.1, 0.1], [0.5, 0.5], [9.0, 9.0]], np.random.default_rng(1).normal(size=(3, 3, 2))
    policy = VoronoiPolicy(codewords, maps, task=SIMPLEGOAL, metric="euclidean", scale=[1.0, 2.0])
    states, actions = examples(SIMPLEGOAL)
    found, cells = refit(policy, states, actions), policy.cells(states)
    means = refit(policy, states, actions, constant=True)
    assert set(cells) == {0, 1} and np.array_equal(found.cells(states), cells)
    for i in (0, 1):
        model = LinearRegression().fit(states[cells == i], actions[cells == i])
        assert np.allclose(found.coefficients[i, :-1], model.coef_.T)
        assert np.allclose(found.coefficients[i, -1], model.intercept_)
        assert np.allclose(means.coefficients[i], [[0, 0], [0, 0], actions[cells == i].mean(axis=0)])
    assert np.array_equal(found.coefficients[2], maps[2])  # no state is near the last cell, which keeps its map
    assert np.array_equal(policy.coefficients, maps)  # and the policy is not touched
    assert found.metric == means.metric == "euclidean" and found.scale.tolist() == [1, 2]
