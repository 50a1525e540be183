import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from studies.rivals import tdavq
from studies.rivals.tdavq import DiscretePolicy, ParallelEpisodes, learn, merge, split, update
from vsp import evaluate, get_task


def policy_of(codewords, values):
    return DiscretePolicy(np.array(codewords, dtype=float), np.array(values, dtype=float), np.array([[-1.0], [1.0]]))


# The policy


def test_the_best_action_of_the_nearest_codeword():
    policy = policy_of([[0.1, 0.1], [0.9, 0.9]], [[2, 1], [0, 3]])
    actions, state = policy.predict(np.array([[0.2, 0.0], [0.8, 0.5], [0.55, 0.5]], dtype=np.float32))
    assert actions.tolist() == [[-1], [1], [1]] and state is None and len(policy) == 2


@pytest.mark.parametrize(("task", "count"), [(SIMPLEGOAL, 9), (MOUNTAINCAR, 3), (PENDULUM, 3)])
def test_actions_are_the_corners_and_the_middles_of_the_box(task, count):
    actions, box = tdavq._actions(get_task(task)), get_task(task)
    assert len(np.unique(actions, axis=0)) == len(actions) == count
    assert (actions.min(axis=0) == box.action_low).all() and (actions.max(axis=0) == box.action_high).all()
    assert (actions == 0).all(axis=1).sum() == 1


# Its parts


def test_an_update_by_hand():
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    update(values, np.array([0, 0, 1]), np.array([1, 1, 0]), np.array([1.0, 3.0, -2.0]), 0.5)
    assert values.tolist() == [[1, 2 + 0.5 * 2], [3 - 0.5 * 2, 4]]


def test_a_split_by_hand():
    policy = policy_of([[0.1, 0.1], [0.9, 0.9]], [[2, 1], [0, 3]])
    states = np.array([[0.3, 0.1], [0.31, 0.1], [0.85, 0.9]])  # the second is too near to the first, the third to one
    split(policy, states, np.array([1, 0, 0]), np.array([7.0, 8.0, 9.0]), 0.1)
    assert policy.codewords.tolist() == [[0.1, 0.1], [0.9, 0.9], [0.3, 0.1]]
    assert policy.values.tolist() == [[2, 1], [0, 3], [2, 7]]


def test_a_merge_by_hand():
    codewords = [[0, 0], [1, 0], [2, 0], [3, 0]]  # neighbours in a line
    policy = policy_of(codewords, [[1, 0], [1.2, 0.1], [0.1, 1.2], [1, 0]])
    merge(policy, 0.1)
    assert len(policy) == 4
    merge(policy, 0.25)  # the last is like the first but no neighbour of it
    assert policy.codewords.tolist() == [[0, 0], [2, 0], [3, 0]]
    one = policy_of([[0.5, 0.5]], [[1, 2]])
    merge(one, 9.0)
    assert len(one) == 1


def test_like_values_with_another_best_action_stay():
    policy = policy_of([[0, 0], [1, 0]], [[1, 0.9], [0.9, 1]])
    merge(policy, 0.5)
    assert len(policy) == 2


def test_a_new_episode_begins_where_one_ends():
    episodes = ParallelEpisodes(get_task(SIMPLEGOAL), np.random.default_rng(0))
    episodes.states[:3] = [[0.15, 0.15], [0.35, 0.35], [0.8, 0.8]]
    rewards, running, arrived = episodes.step(np.array([[-1.0, -1.0], [1.0, 1.0]] + [[0.0, 0.0]] * 62))
    assert rewards[:2].tolist() == [10, -10] and running[:3].tolist() == [False, False, True]
    assert np.allclose(arrived[:3], [[0.05, 0.05], [0.45, 0.45], [0.8, 0.8]])
    seen = episodes.observations
    assert not np.allclose(seen[:2], arrived[:2]) and np.allclose(seen[2], [0.8, 0.8])
    for _ in range(49):
        _, running, _ = episodes.step(np.zeros((64, 2)))
    assert running[2]  # truncated after 50 steps, which is no end
    assert not np.allclose(episodes.observations[2], [0.8, 0.8])


# Learning


@pytest.fixture(scope="module")
def learned():
    return learn(SIMPLEGOAL, seed=0, n_steps=4000)


def test_it_learns_to_walk_around_the_pit(learned):
    frame = evaluate(learned, SIMPLEGOAL, 1000, seed=30)
    assert frame["return"].mean() > 15.5 and (frame["outcome"] == "goal").mean() > 0.98


def test_codewords_keep_their_distance(learned):
    gaps = np.linalg.norm(learned.codewords[:, None] - learned.codewords, axis=2)[np.triu_indices(len(learned), 1)]
    assert gaps.min() >= 0.06 and 20 < len(learned) == len(learned.values) and learned.values.shape[1] == 9


def test_tasks_with_other_observations_than_states():
    policy = learn(PENDULUM, seed=0, n_steps=200)
    assert policy.codewords.shape[1] == 3 and np.allclose(np.hypot(*policy.codewords.T[:2]), 1)
