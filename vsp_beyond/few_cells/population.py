"""Roll out many policies of one shape in one batch: a generation of CMA-ES takes as many steps as one policy."""

from dataclasses import replace

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.rollouts import Outcomes, Policy, rollout
from vsp.subpolicies import linear_outputs
from vsp.tasks.base import Task


def rollout_population(policies: list[Policy], task: Task, starts: np.ndarray) -> list[Outcomes]:
    """Roll out policies of one kind, Voronoi policies in one batch: they must be Euclidean, of one shape and scale."""
    maps = [policy for policy in policies if isinstance(policy, VoronoiPolicy)]
    if not maps:
        return [rollout(policy, task, starts) for policy in policies]
    numbers = np.repeat(np.arange(float(len(policies))), len(starts))
    all_starts = np.column_stack([np.tile(starts, (len(policies), 1)), numbers])
    result = rollout(PolicyBatch(maps), numbered(task, len(policies)), all_starts)
    parts = (np.split(part, len(policies)) for part in (result.returns, result.lengths, result.outcomes))
    return [Outcomes(*of_one) for of_one in zip(*parts)]


def numbered(task: Task, n: int) -> Task:
    """Return `task` with a constant number below n appended to every start, state and observation."""

    def without_number(states: np.ndarray) -> np.ndarray:
        return states[:, 0] if task.one_by_one else states[:, :-1]

    def begin(starts: np.ndarray) -> np.ndarray:
        return np.column_stack([task.begin(starts[:, :-1]), starts[:, -1]])

    def see(states: np.ndarray) -> np.ndarray:
        return np.column_stack([task.see(without_number(states)), states[:, -1].astype(np.float64)])

    def step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moved, rewards, outcomes = task.step(without_number(states), actions)
        return np.column_stack([moved, states[:, -1]]), rewards, outcomes

    low, high, size = np.append(task.low, 0.0), np.append(task.high, n), 1 + (task.start_size or len(task.low))
    return replace(task, low=low, high=high, start_size=size, begin=begin, see=see, step=step)


class PolicyBatch:
    """Several Euclidean policies of one shape and scale as one.

    The last number of an observation is the index of its policy; observations must be sorted by it.
    """

    def __init__(self, policies: list[VoronoiPolicy]):
        self._first = policies[0]
        self._first.check_linear()
        points = np.stack([policy.codewords / policy.scale for policy in policies])
        # The codeword c nearest to x has the largest 2 x·c - c·c: one product per policy
        self._closeness = np.concatenate([2 * points, -np.square(points).sum(axis=2, keepdims=True)], axis=2)
        self._closeness = self._closeness.transpose(0, 2, 1).copy()  # (p, d + 1, k)
        self._coefficients = np.stack([policy.coefficients for policy in policies])  # (p, k, d + 1, m)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations and indices (n, d + 1)."""
        states, policy = obs[:, :-1].astype(np.float64), obs[:, -1].astype(np.intp)
        points = np.column_stack([states / self._first.scale, np.ones(len(states))])
        cells, cuts = np.empty(len(states), dtype=np.intp), np.searchsorted(policy, np.arange(len(self._closeness) + 1))
        for closeness, begin, end in zip(self._closeness, cuts[:-1], cuts[1:]):
            cells[begin:end] = (points[begin:end] @ closeness).argmax(axis=1)
        raw = linear_outputs(states, self._coefficients[policy, cells])
        return np.clip(raw, self._first.task.action_low, self._first.task.action_high), None
