import functools

import numpy as np
import pytest
from small import Critic
from support import SIMPLEGOAL, examples

from studies.rivals import critics
from studies.rivals.critics import advantage_weighted, critic_driven, trained, where_lost
from vsp import get_task
from vsp.paper.baselines import kmeans_cells, linear_map

TASK = get_task(SIMPLEGOAL)


def labelled(n=400, seed=0):
    states = np.random.default_rng(seed).random((n, 2))
    return states, Critic().predict(states)[0]


fit = functools.partial(critic_driven, teacher=Critic(), task=TASK)
weigh = functools.partial(advantage_weighted, teacher=Critic(), task=TASK)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(critics, "N_STEPS", 150)


# Cells where value is lost


def test_the_next_codeword_by_hand(monkeypatch):
    """The first cell loses 3 in all, the second 4; its two worst states are the mean of (5, 0) and (7, 2)."""
    monkeypatch.setattr(critics, "WORST", 0.5)
    points = np.array([[0.0, 0.0], [1.0, 1.0], [5.0, 0.0], [6.0, 6.0], [7.0, 2.0], [9.0, 9.0]])
    cell, codeword = where_lost(points, np.array([0, 0, 1, 1, 1, 1]), np.array([3.0, 0.0, 2.0, 0.1, 1.5, 0.4]))
    assert cell == 1 and codeword.tolist() == [6.0, 1.0]


def test_cells_are_added_where_the_critics_value_the_action_too_little(short):
    states, actions = labelled()
    policy = fit(states, actions, size=4, seed=0)
    assert len(policy) == 4 and policy.metric == "euclidean"
    assert policy.codewords[0] == pytest.approx(states.mean(axis=0)) and (policy.codewords[1:, 0] > 0.5).all()


def test_no_cell_is_added_where_no_value_is_lost(short):
    class Content(Critic):
        def value(self, obs, actions):
            return np.zeros(len(obs))

    assert len(critic_driven(*labelled(), size=4, teacher=Content(), task=TASK, seed=0)) == 1


def test_gradient_descent_ends_at_least_squares():
    """Where no action is beyond its limits, and in each cell by itself."""
    points = np.random.default_rng(0).normal(size=(500, 2))
    own = (points[:, 0] > 0).astype(int)
    maps = np.random.default_rng(1).uniform(-0.2, 0.2, size=(2, 3, 2))
    inputs = np.column_stack([points, np.ones(500)])
    actions = np.clip(np.einsum("np,npm->nm", inputs, maps[own]), -1, 1)
    found = trained(np.zeros((2, 3, 2)), own, points, actions, TASK, np.random.default_rng(2))
    assert np.allclose(found, maps, atol=1e-3)


def test_a_map_that_begins_beyond_the_limits_learns_all_the_same():
    points, far = np.random.default_rng(0).normal(size=(200, 2)), np.zeros((1, 3, 2))
    far[0, -1] = 5.0
    found = trained(far, np.zeros(200, dtype=int), points, np.full((200, 2), 0.5), TASK, np.random.default_rng(0))
    assert np.allclose(found, [[[0, 0], [0, 0], [0.5, 0.5]]], atol=1e-2)


def test_the_codewords_and_maps_are_in_the_units_of_the_task():
    """One linear map, of states far from the origin with unlike deviations."""
    states, actions = labelled()
    states = [0.01, 0.1] * states + [0.3, 0.8]
    policies = fit(states, actions, size=1, seed=0), linear_map(states, actions, SIMPLEGOAL)
    error, other = (np.square(one.predict(states)[0] - actions).mean() for one in policies)
    assert error < 1.02 * other and policies[0].codewords[0] == pytest.approx(states.mean(axis=0))


# Maps weighted by criticality


@pytest.mark.parametrize("weight", [7.0, 0.0])
def test_weights_that_are_all_the_same_change_nothing(weight):
    """Nor do they where no action costs anything."""

    class Even(Critic):
        def criticality(self, obs):
            return np.full(len(obs), weight)

    states, actions = examples(SIMPLEGOAL)
    found = advantage_weighted(states, actions, size=3, teacher=Even(), task=SIMPLEGOAL, seed=1)
    expected = kmeans_cells(states, actions, cells=3, task=SIMPLEGOAL, seed=1)
    assert np.array_equal(found.codewords, expected.codewords)
    assert np.allclose(found.coefficients, expected.coefficients)


def test_a_weight_is_as_good_as_so_many_copies():
    class Twice(Critic):
        def criticality(self, obs):
            return np.where(obs[:, 0] > 0.5, 3.0, 1.0)

    states, actions = examples(SIMPLEGOAL)
    copies = np.repeat(np.arange(300), np.where(states[:, 0] > 0.5, 3, 1))
    found = advantage_weighted(states, actions, size=1, teacher=Twice(), task=SIMPLEGOAL, seed=0)
    assert np.allclose(found.coefficients, linear_map(states[copies], actions[copies], SIMPLEGOAL).coefficients)


# Both


@pytest.mark.parametrize("make", [fit, weigh])
def test_a_seed_is_a_policy(make, short):
    one, again, other = (make(*labelled(), size=3, seed=seed) for seed in (1, 1, 2))
    assert one.to_json() == again.to_json() != other.to_json()
