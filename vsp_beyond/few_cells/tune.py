"""Tuning on the return by CMA-ES (Hansen 2016), whose candidates play in one batch, and how these are compared."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.rollouts import Outcomes, Policy, rollout
from vsp.run.progress import steps
from vsp.subpolicies import linear_outputs
from vsp.tasks.base import GOAL, Task

from .config import Tuned
from .units import ScaledCells

SNAPSHOTS = 10  # candidates that a tuning yields, evenly spread over its generations
PolicyOf = Callable[[ScaledCells], Policy]  # such as `Scaling.policy`; or of other numbers with `vector` and `like`


class Candidates:
    """Candidates, compared by `score` from the same starts; of equally good ones the first is kept."""

    best: ScaledCells  # once there is a candidate

    def __init__(self, policy_of: PolicyOf, task: Task, starts: np.ndarray, failure_penalty: float):
        self.rows, self.best_restart = list[dict](), 0
        self._policy_of, self._task, self._starts = policy_of, task, starts
        self._failure_penalty, self._best_score = failure_penalty, -np.inf

    def add(self, stage: str, restart: int, cells: ScaledCells) -> None:
        """Score `cells` from the validation starts."""
        result = rollout(self._policy_of(cells), self._task, self._starts)
        mean, failing = result.returns.mean(), np.mean(result.outcomes != GOAL)
        self.rows.append({"stage": stage, "restart": restart, "mean": mean, "failing": failing})
        if (value := score(result, self._failure_penalty)) > self._best_score:
            self._best_score, self.best, self.best_restart = value, cells, restart


def tune(
    policy_of: PolicyOf, task: Task, cells: ScaledCells, config: Tuned, rng: np.random.Generator
) -> Iterator[ScaledCells]:
    """Run CMA-ES (Hansen 2016) on the `score`; each generation rolls out its candidates from fresh starts. Yields the
    current solution `SNAPSHOTS` times: a later one may fail from rare starts that no generation has drawn."""
    search = cma_es(cells.vector, config.tuning_step, rng)
    for i in steps(range(config.n_generations), "tuning", total=config.n_generations, unit="generations"):
        starts = task.start(rng, config.n_tuning_episodes)
        vectors = search.ask()
        results = rollout_population([policy_of(cells.like(vector)) for vector in vectors], task, starts)
        search.tell(vectors, [-score(result, config.failure_penalty) for result in results])
        if is_snapshot(i, config.n_generations, SNAPSHOTS):
            yield cells.like(search.result.xfavorite)


def cma_es(start: np.ndarray, step: float, rng: np.random.Generator, *, diagonal: bool = False):
    """Return the search of the library `cma` from `start`, with first standard deviation `step` and random draws from
    `rng`; `diagonal`: of variances only (sep-CMA-ES, Ros & Hansen 2008), for more numbers than generations."""
    import cma  # here, because few uses need it

    options = {"seed": np.nan, "randn": lambda *shape: rng.standard_normal(shape), "verbose": -9}
    options["CMA_diagonal"] = diagonal
    return cma.CMAEvolutionStrategy(start, step, options)


def is_snapshot(i: int, n: int, n_snapshots: int) -> bool:
    """Return whether generation i of n is one of `n_snapshots` that are evenly spread; the last one always is."""
    return (i + 1) * n_snapshots // n > i * n_snapshots // n


def candidates_per_generation(n: int) -> int:
    """Return the default number of candidates in a generation of CMA-ES for n numbers (Hansen 2016, table 1)."""
    return 4 + int(3 * np.log(n))


def score(result: Outcomes, failure_penalty: float) -> float:
    """Return the mean return minus `failure_penalty` times the share of failed episodes. In a task without a goal the
    penalty is the same for all policies, so it changes no comparison."""
    return float(result.returns.mean() - failure_penalty * np.mean(result.outcomes != GOAL))


# A generation in one batch


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
    """Several Euclidean policies of one shape and scale as one. The last number of an observation is the index of its
    policy; observations must be sorted by it."""

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
