"""TD-AVQ (Lee & Lau 2004): reinforcement learning on Voronoi cells that it makes as it goes, without any teacher.

The paper extends this method and sets its own beside it in table T1. We have the article ("Adaptive state space
partitioning for reinforcement learning", Engineering Applications of Artificial Intelligence 17) by its abstract and
by what the paper says of it. From there: online temporal-difference learning of the values of discrete actions in
Voronoi cells; a state becomes a codeword when the reward collected from it departs from the value of its cell by more
than a threshold, and it is far enough from all codewords; every so often neighbours with like values become one. Ours:
one-step Q-learning, so that the departure is the TD error; a grid of actions; episodes side by side; all numbers.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from . import geometry
from .checks import check_count, check_number, check_seed
from .envs import RUNNING, Task, get_task

METRIC = "euclidean"
N_WALKERS = 64  # episodes side by side
RATES = 0.5, 0.02  # of learning, at the beginning and at the end
EXPLORING = 1.0, 0.1  # share of random actions at the beginning, and from the middle on
THRESHOLD = 2.0  # TD error, in units of the reward, that splits a cell
N_SPLIT, N_MERGE = 20, 500  # a pass every so many steps
LAST_SPLIT, LAST_MERGE = 0.5, 0.8  # shares of the steps after which there is none
COARSE = {"min_distance": 0.15, "likeness": 1.0, "discount": 0.95}  # settings of `learn` that give few cells


class DiscretePolicy:
    """The best of a few actions in every cell: `codewords` (k, d), `values` (k, a) of the `actions` (a, m)."""

    def __init__(self, codewords: np.ndarray, values: np.ndarray, actions: np.ndarray):
        self.codewords, self.values, self.actions = codewords, values, actions

    def __len__(self) -> int:
        return len(self.codewords)

    def cells(self, states: np.ndarray) -> np.ndarray:
        """Index of the nearest codeword of each state (n, d). (n,)"""
        return geometry.nearest(self.codewords, states, METRIC)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d)."""
        return self.actions[self.values.argmax(axis=1)[self.cells(obs)]], None


def learn(
    task: str | Task,
    *,
    seed: int,
    n_steps: int = 20_000,
    min_distance: float = 0.06,
    likeness: float = 0.3,
    discount: float = 0.97,
) -> DiscretePolicy:
    """A policy learned from `n_steps` steps of `N_WALKERS` episodes side by side. Same arguments, same policy.

    No codeword comes nearer than `min_distance` to another (in units of the state). Neighbours with the same best
    action are merged where no value differs by more than `likeness` (in units of the reward). A `discount` near 1 makes
    policies that walk in circles between cells. Raises ValueError for a task whose episodes cannot go side by side.
    """
    check_seed(seed)
    check_count("n_steps", n_steps)
    for name, value in (("min_distance", min_distance), ("likeness", likeness), ("discount", discount)):
        check_number(name, value, least=0)
    task, rng = get_task(task), np.random.default_rng(seed)
    walkers, actions = Walkers(task, rng), _actions(task)
    policy = DiscretePolicy(walkers.seen[:1], np.zeros((1, len(actions))), actions)
    for i in range(n_steps):
        done, seen = i / n_steps, walkers.seen
        cells = policy.cells(seen)
        exploring = EXPLORING[0] + (EXPLORING[1] - EXPLORING[0]) * min(1.0, 2 * done)
        chosen = _choose(policy.values[cells], exploring, rng)
        rewards, goes_on, arrived = walkers.step(actions[chosen])
        found = rewards + discount * goes_on * policy.values[policy.cells(arrived)].max(axis=1)
        departure = found - policy.values[cells, chosen]
        update(policy.values, cells, chosen, departure, RATES[0] * (RATES[1] / RATES[0]) ** done)
        if i % N_SPLIT == 0 and done < LAST_SPLIT:
            far = np.abs(departure) > THRESHOLD
            split(policy, seen[far], chosen[far], found[far], min_distance)
        if i % N_MERGE == N_MERGE - 1 and done < LAST_MERGE:
            merge(policy, likeness)
    return policy


class Walkers:
    """Episodes side by side; where one ends, another begins."""

    def __init__(self, task: Task, rng: np.random.Generator):
        self.task, self._rng = task, rng
        starts = task.start(rng, N_WALKERS)
        self.states, self._age = task.begin(starts), np.zeros(N_WALKERS, dtype=np.int64)
        if self.states is not starts:
            raise ValueError(f"{task.name} has a physics engine of its own, expected a task whose states are arrays")

    @property
    def seen(self) -> np.ndarray:
        """What is observed now. (N_WALKERS, d)"""
        return self.task.see(self.states)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rewards, which episodes this did not end (truncated ones included), and what was seen on arrival."""
        self.states, rewards, ended = self.task.step(self.states, actions)
        arrived, goes_on, self._age = self.seen.copy(), ended == RUNNING, self._age + 1
        over = ~goes_on | (self._age >= self.task.max_steps)
        self.states[over], self._age[over] = self.task.start(self._rng, int(over.sum())), 0
        return rewards, goes_on, arrived


def _actions(task: Task) -> np.ndarray:
    """The lowest, the middle and the highest of every action, in all combinations. (3^m, m)"""
    middle = 0.5 * (task.action_low + task.action_high)
    return np.array(list(product(*zip(task.action_low, middle, task.action_high))))


def _choose(values: np.ndarray, exploring: float, rng: np.random.Generator) -> np.ndarray:
    """For every row of `values` (n, a) the best action, or any in a share `exploring` of them. (n,)"""
    n, a = values.shape
    return np.where(rng.random(n) < exploring, rng.integers(a, size=n), values.argmax(axis=1))


def update(values: np.ndarray, cells: np.ndarray, chosen: np.ndarray, departure: np.ndarray, rate: float) -> None:
    """Move `values` (k, a) of the cells and actions (n,) by `rate` times their mean TD error (n,), in place."""
    index = np.ravel_multi_index((cells, chosen), values.shape)
    times = np.bincount(index, minlength=values.size)
    total = np.bincount(index, departure, minlength=values.size)
    values += rate * (total / np.maximum(times, 1)).reshape(values.shape)


def split(
    policy: DiscretePolicy, states: np.ndarray, chosen: np.ndarray, found: np.ndarray, min_distance: float
) -> None:
    """Make codewords of `states` (n, d), one after the other, that are far enough from all there are.

    A new cell has the values of the one it is taken from, but for the action (n,) of which the value (n,) was found.
    """
    for state, action, value in zip(states, chosen, found):
        gaps = geometry.distances(state[None], policy.codewords, METRIC)[0]
        if gaps.min() >= min_distance:
            own = policy.values[gaps.argmin()].copy()
            own[action] = value
            policy.codewords = np.vstack([policy.codewords, state])
            policy.values = np.vstack([policy.values, own])


def merge(policy: DiscretePolicy, likeness: float) -> None:
    """Let each codeword in turn take over its Delaunay neighbours with the same best action and like values."""
    if len(policy) == 1:
        return
    near, kept = geometry.delaunay_neighbours(policy.codewords), np.ones(len(policy), dtype=bool)
    best = policy.values.argmax(axis=1)
    for i, values in enumerate(policy.values):
        if kept[i]:
            alike = np.abs(policy.values - values).max(axis=1) <= likeness
            kept[near[i] & alike & (best == best[i])] = False
    policy.codewords, policy.values = policy.codewords[kept], policy.values[kept]
