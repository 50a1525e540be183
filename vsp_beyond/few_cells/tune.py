"""Tuning on the return by CMA-ES (Hansen 2016), and how candidates are compared."""

from collections.abc import Callable, Iterator

import numpy as np

from vsp.rollouts import Outcomes, Policy, rollout
from vsp.run.progress import steps
from vsp.tasks.base import GOAL, Task

from .config import Tuned
from .population import rollout_population
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
    """Run CMA-ES (Hansen 2016) on the `score`; each generation rolls out its candidates from fresh starts.

    Yields the current solution `SNAPSHOTS` times: a later one may fail from rare starts that no generation has drawn.
    """
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
    `rng`.

    `diagonal`: learn variances only (sep-CMA-ES, Ros & Hansen 2008), for more numbers than there are generations.
    """
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
    """Return the mean return minus `failure_penalty` times the share of failed episodes.

    In a task without a goal the penalty is the same for all policies, so it changes no comparison.
    """
    return float(result.returns.mean() - failure_penalty * np.mean(result.outcomes != GOAL))
