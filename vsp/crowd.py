"""Many policies of one shape played at once: a generation of a tuning in one batch instead of one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .envs import Task
from .policy import VoronoiPolicy
from .rollouts import Outcomes, play


def play_all(policies: list[VoronoiPolicy], task: Task, starts: np.ndarray) -> list[Outcomes]:
    """`play` for Euclidean policies of one shape and scale: all of them in one batch where states are arrays."""
    if task.begin(one := starts[:1]) is not one:
        return [play(policy, task, starts) for policy in policies]
    number = np.repeat(np.arange(float(len(policies))), len(starts))
    together = np.column_stack([np.tile(starts, (len(policies), 1)), number])
    result = play(Crowd(policies), numbered(task, len(policies)), together)
    parts = (np.split(part, len(policies)) for part in (result.returns, result.lengths, result.codes))
    return [Outcomes(*of_one) for of_one in zip(*parts)]


def numbered(task: Task, n: int) -> Task:
    """`task`, with a number below n at the end of every state, which stays and which policies see."""

    def step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moved, rewards, outcomes = task.step(states[:, :-1], actions)
        return np.column_stack([moved, states[:, -1]]), rewards, outcomes

    return replace(
        task,
        low=np.append(task.low, 0.0),
        high=np.append(task.high, n),
        start_size=1 + (task.start_size or len(task.low)),
        see=lambda states: np.column_stack([task.see(states[:, :-1]), states[:, -1]]),
        step=step,
    )


class Crowd:
    """Several Euclidean policies of one shape and scale in one; the last number of an observation says whose it is.

    Observations of one policy stand together, the first policy's first.
    """

    def __init__(self, policies: list[VoronoiPolicy]):
        self._one = policies[0]
        self._one.check_linear()
        points = np.stack([policy.codewords / policy.scale for policy in policies])
        # The nearest codeword c of a point x is that with the greatest 2 x.c - c.c: one product per policy
        self._closeness = np.concatenate([2 * points, -np.square(points).sum(axis=2, keepdims=True)], axis=2)
        self._closeness = self._closeness.transpose(0, 2, 1).copy()  # (p, d + 1, k)
        self._coefficients = np.stack([policy.coefficients for policy in policies])  # (p, k, d + 1, m)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations and numbers (n, d + 1)."""
        states, whose = obs[:, :-1].astype(np.float64), obs[:, -1].astype(np.intp)
        points = np.column_stack([states / self._one.scale, np.ones(len(states))])
        cells, cuts = np.empty(len(states), dtype=np.intp), np.searchsorted(whose, np.arange(len(self._closeness) + 1))
        for closeness, begin, end in zip(self._closeness, cuts[:-1], cuts[1:]):
            cells[begin:end] = (points[begin:end] @ closeness).argmax(axis=1)
        maps = self._coefficients[whose, cells]
        raw = np.einsum("nd,ndm->nm", states, maps[:, :-1]) + maps[:, -1]
        return np.clip(raw, self._one.task.action_low, self._one.task.action_high), None
