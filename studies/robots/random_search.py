"""Learn one linear map from returns alone, without a teacher, by augmented random search (ARS V2-t, Mania et al.
2018)."""

from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from vsp import Policy, Task, VoronoiPolicy
from vsp_beyond.few_cells.tune import rollout_population
from vsp_beyond.few_cells.units import METRIC

from .imitation import most_rewarding
from .settings import Walking

EVERY = 8  # every 8th observation is used for the mean and deviation
N_CHOICES = 20  # maps kept as candidates, evenly spread over the search
LEAST_REWARD = -10.0  # per step, in the search: the penalty of a fall, 100, hides what a map did before it


class RunningMoments:
    """Mean and variance of the observations so far, which scale the inputs of the map (Welford 1962)."""

    def __init__(self, d: int):
        self.n, self.mean, self._squares = 0, np.zeros(d), np.zeros(d)

    def add(self, states: np.ndarray) -> None:
        """Add the rows of `states` (n, d)."""
        n, gap = self.n + len(states), states.mean(axis=0) - self.mean
        within = np.square(states - states.mean(axis=0)).sum(axis=0)
        self._squares = self._squares + within + gap**2 * self.n * len(states) / n
        self.n, self.mean = n, self.mean + gap * len(states) / n

    @property
    def deviation(self) -> np.ndarray:
        """The standard deviation; 1 where nothing varies yet. (d,)"""
        found = np.sqrt(self._squares / max(1, self.n))
        return np.where(found > 1e-6, found, 1.0)


@threadpool_limits.wrap(limits=1)
def search_one_map(task: Task, config: Walking, *, seed: int) -> Policy:
    """Find the best map within `config.n_random_steps` steps of the robot, as one cell. Same arguments, same policy.
    Each round plays maps on both sides of the current one, in random directions. The map then moves along the `n_best`
    directions with the highest returns. Raises ValueError for a bad seed."""
    forgiving, d, m = _forgiving(task), len(task.low), len(task.action_low)
    starts, noise, validation = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(3))
    weights, moments, played, on_the_way = np.zeros((d, m)), RunningMoments(d), 0, []
    while played < config.n_random_steps:
        directions = noise.normal(size=(config.n_directions, d, m))
        both = np.concatenate([directions, -directions])
        tried = [_policy(weights + config.search_noise * one, moments, task) for one in both]
        results, seen = _played(tried, forgiving, task.start(starts, 1))
        played += sum(int(result.lengths.sum()) for result in results)
        returns = np.array([result.returns.mean() for result in results]).reshape(2, -1)
        kept = np.argsort(-returns.max(axis=0), kind="stable")[: config.n_best]
        gains = (returns[0] - returns[1])[kept]
        step = config.step_size / max(len(kept) * returns[:, kept].std(), 1e-12)
        weights = weights + step * np.tensordot(gains, directions[kept], axes=1)
        moments.add(seen)
        if played * N_CHOICES // config.n_random_steps > len(on_the_way):
            on_the_way.append(_policy(weights, moments, task))
    return most_rewarding(on_the_way, task, config.n_validation, validation)


def _forgiving(task: Task) -> Task:
    """Return `task` without rewards below `LEAST_REWARD`."""

    def step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moved, rewards, outcomes = task.step(states, actions)
        return moved, np.maximum(rewards, LEAST_REWARD), outcomes

    return replace(task, step=step)


def _policy(weights: np.ndarray, moments: RunningMoments, task: Task) -> VoronoiPolicy:
    """Return the map `weights` (d, m) of scaled inputs to scaled actions, as one cell in the units of the task."""
    half = 0.5 * (task.action_high - task.action_low)
    slopes = weights / moments.deviation[:, None] * half
    biases = 0.5 * (task.action_high + task.action_low) - moments.mean @ slopes
    coefficients = np.concatenate([slopes, biases[None]])[None]
    return VoronoiPolicy(moments.mean[None], coefficients, task=task, metric=METRIC)


def _played(policies: list[VoronoiPolicy], task: Task, starts: np.ndarray):
    """Roll out `policies`. Return how the episodes end, and every `EVERY`-th observation (n, d)."""
    seen = []

    def see(states: np.ndarray) -> np.ndarray:
        seen.append(observations := task.see(states))
        return observations

    results = rollout_population(policies, replace(task, see=see), starts)
    return results, np.concatenate(seen)[::EVERY]
