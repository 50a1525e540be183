"""TD-AVQ (Lee & Lau 2004): reinforcement learning on Voronoi cells that it creates as it learns, without a teacher.

The paper extends this method and compares its own with it in table T1. We know the article ("Adaptive state space
partitioning for reinforcement learning", Engineering Applications of Artificial Intelligence 17) from its abstract and
from the paper. They state: online temporal-difference learning of the values of discrete actions in Voronoi cells; a
state becomes a codeword if the reward collected from it differs from the value of its cell by more than a threshold,
and if it is far enough from all codewords; at intervals, neighbours with similar values are merged. Our choices:
one-step Q-learning, so that this difference is the TD error; a grid of actions; parallel episodes; all constants.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from vsp import Task, geometry, get_task
from vsp.tasks.base import RUNNING

METRIC = "euclidean"
N_PARALLEL = 64  # episodes that advance together
LEARNING_RATES = 0.5, 0.02  # at the beginning and at the end
EXPLORATION = 1.0, 0.1  # share of random actions at the beginning, and from the middle on
THRESHOLD = 2.0  # TD error, in units of the reward, that splits a cell
N_SPLIT, N_MERGE = 20, 500  # steps between two passes
LAST_SPLIT, LAST_MERGE = 0.5, 0.8  # shares of the steps after which there is no pass
MIN_DISTANCE, LIKENESS = 0.06, 0.3  # in units of the state, and of the reward
DISCOUNT = 0.97  # nearer to 1, policies circle between cells


class DiscretePolicy:
    """Takes the best of a few actions in every cell: `codewords` (k, d), `values` (k, a) of the `actions` (a, m)."""

    def __init__(self, codewords: np.ndarray, values: np.ndarray, actions: np.ndarray):
        self.codewords, self.values, self.actions = codewords, values, actions

    def __len__(self) -> int:
        return len(self.codewords)

    def cells(self, states: np.ndarray) -> np.ndarray:
        """Index of the nearest codeword of each state (n, d). (n,)"""
        return geometry.nearest(self.codewords, states, METRIC)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return actions (n, m) for observations (n, d)."""
        return self.actions[self.values.argmax(axis=1)[self.cells(obs)]], None


def learn(task: str | Task, *, seed: int, n_steps: int = 20_000) -> DiscretePolicy:
    """Learn a policy from `n_steps` steps of `N_PARALLEL` episodes. The same arguments give the same policy.

    No two codewords are closer to each other than `MIN_DISTANCE`. Neighbours with the same best action are merged where
    no value differs by more than `LIKENESS`. The task must be one whose states are arrays.
    """
    task, rng = get_task(task), np.random.default_rng(seed)
    episodes, actions = ParallelEpisodes(task, rng), _actions(task)
    policy = DiscretePolicy(episodes.observations[:1], np.zeros((1, len(actions))), actions)
    for i in range(n_steps):
        done, observations = i / n_steps, episodes.observations
        cells = policy.cells(observations)
        epsilon = EXPLORATION[0] + (EXPLORATION[1] - EXPLORATION[0]) * min(1.0, 2 * done)
        chosen = _epsilon_greedy(policy.values[cells], epsilon, rng)
        rewards, running, arrived = episodes.step(actions[chosen])
        targets = rewards + DISCOUNT * running * policy.values[policy.cells(arrived)].max(axis=1)
        errors = targets - policy.values[cells, chosen]
        rate = LEARNING_RATES[0] * (LEARNING_RATES[1] / LEARNING_RATES[0]) ** done
        update(policy.values, cells, chosen, errors, rate)
        if i % N_SPLIT == 0 and done < LAST_SPLIT:
            far = np.abs(errors) > THRESHOLD
            split(policy, observations[far], chosen[far], targets[far], MIN_DISTANCE)
        if i % N_MERGE == N_MERGE - 1 and done < LAST_MERGE:
            merge(policy, LIKENESS)
    return policy


class ParallelEpisodes:
    """Episodes that advance together; when one ends, a new one begins."""

    def __init__(self, task: Task, rng: np.random.Generator):
        self.task, self._rng = task, rng
        self.states, self._age = task.begin(task.start(rng, N_PARALLEL)), np.zeros(N_PARALLEL, dtype=np.int64)

    @property
    def observations(self) -> np.ndarray:
        """Current observations. (N_PARALLEL, d)"""
        return self.task.see(self.states)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rewards, which episodes continue (truncated ones count as continuing), and the next observations."""
        self.states, rewards, ended = self.task.step(self.states, actions)
        arrived, running, self._age = self.observations.copy(), ended == RUNNING, self._age + 1
        over = ~running | (self._age >= self.task.max_steps)
        self.states[over], self._age[over] = self.task.start(self._rng, int(over.sum())), 0
        return rewards, running, arrived


def _actions(task: Task) -> np.ndarray:
    """Return all combinations of the lowest, middle and highest value of each action. (3^m, m)"""
    middle = 0.5 * (task.action_low + task.action_high)
    return np.array(list(product(*zip(task.action_low, middle, task.action_high))))


def _epsilon_greedy(values: np.ndarray, epsilon: float, rng: np.random.Generator) -> np.ndarray:
    """Return the best action for every row of `values` (n, a), or with probability `epsilon` a random one. (n,)"""
    n, a = values.shape
    return np.where(rng.random(n) < epsilon, rng.integers(a, size=n), values.argmax(axis=1))


def update(values: np.ndarray, cells: np.ndarray, chosen: np.ndarray, errors: np.ndarray, rate: float) -> None:
    """Move `values` (k, a) of the cells and actions (n,) by `rate` times their mean TD error (n,), in place."""
    index = np.ravel_multi_index((cells, chosen), values.shape)
    times = np.bincount(index, minlength=values.size)
    total = np.bincount(index, errors, minlength=values.size)
    values += rate * (total / np.maximum(times, 1)).reshape(values.shape)


def split(
    policy: DiscretePolicy, states: np.ndarray, chosen: np.ndarray, targets: np.ndarray, min_distance: float
) -> None:
    """Add those `states` (n, d) as codewords, one after the other, that are far enough from all codewords.

    A new cell copies the values of the cell that contained its state, except for the action (n,) whose target (n,) is
    known.
    """
    for state, action, value in zip(states, chosen, targets):
        gaps = geometry.distances(state[None], policy.codewords, METRIC)[0]
        if gaps.min() >= min_distance:
            values = policy.values[gaps.argmin()].copy()
            values[action] = value
            policy.codewords = np.vstack([policy.codewords, state])
            policy.values = np.vstack([policy.values, values])


def merge(policy: DiscretePolicy, likeness: float) -> None:
    """Let each codeword in turn absorb its Delaunay neighbours with the same best action and similar values."""
    if len(policy) == 1:
        return
    near, kept = geometry.delaunay_neighbours(policy.codewords), np.ones(len(policy), dtype=bool)
    best = policy.values.argmax(axis=1)
    for i, values in enumerate(policy.values):
        if kept[i]:
            alike = np.abs(policy.values - values).max(axis=1) <= likeness
            kept[near[i] & alike & (best == best[i])] = False
    policy.codewords, policy.values = policy.codewords[kept], policy.values[kept]
