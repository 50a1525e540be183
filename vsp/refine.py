"""`refine`: a few codewords and their maps, optimised together. What the paper's method leaves on the table.

Three parts, each of which a `Refinement` can switch off: deterministic annealing on the teacher's actions, correction
on the states that the policy itself visits, tuning on the return. Inside, inputs have mean 0 and deviation 1, actions
the limits -1 and 1, so that one step size fits all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from .checks import check_seed
from .config import Refinement, check_refinement
from .crowd import play_all
from .envs import GOAL, Task, get_task
from .policy import VoronoiPolicy
from .rollouts import Outcomes, Policy, play, visited
from .subpolicies import BETA1, BETA2, EPSILON

WARM = 10  # times the coldest temperature: where cells that are good already are annealed from
SNAPSHOTS = 10  # of a tuning, from its beginning to its end
METRIC = "euclidean"  # of the scaled states: borders between cells are then straight


@dataclass(frozen=True)
class Frame:
    """The units that the optimisation works in, and the way to a policy and back."""

    task: Task
    centre: np.ndarray  # (d,) mean of the observations
    scale: np.ndarray  # (d,) their standard deviation

    @classmethod
    def of(cls, task: Task, states: np.ndarray) -> Frame:
        """That in which `states` (n, d) have mean 0 and deviation 1; a variable that never varies keeps its unit."""
        scale = states.std(axis=0)
        return cls(task, states.mean(axis=0), np.where(scale > 0, scale, 1.0))

    @property
    def _middle(self) -> np.ndarray:
        return 0.5 * (self.task.action_high + self.task.action_low)

    @property
    def _half(self) -> np.ndarray:
        return 0.5 * (self.task.action_high - self.task.action_low)

    def inputs(self, states: np.ndarray) -> np.ndarray:
        """Scaled states and a column of ones, (n, d + 1), of states (n, d)."""
        return np.column_stack([(states - self.centre) / self.scale, np.ones(len(states))])

    def outputs(self, actions: np.ndarray) -> np.ndarray:
        """Actions (n, m) in units in which the limits are -1 and 1."""
        return (actions - self._middle) / self._half

    def policy(self, cells: Cells) -> VoronoiPolicy:
        """`cells` as a policy in the units of the task."""
        weights = cells.maps[:, :-1] * self._half / self.scale[:, None]
        biases = cells.maps[:, -1] * self._half + self._middle - self.centre @ weights
        coefficients = np.concatenate([weights, biases[:, None]], axis=1)
        codewords = cells.codewords * self.scale + self.centre
        return VoronoiPolicy(codewords, coefficients, task=self.task, metric=METRIC, scale=self.scale)

    def cells(self, policy: VoronoiPolicy) -> Cells:
        """The codewords and maps of `policy` in these units."""
        weights, biases = policy.coefficients[:, :-1], policy.coefficients[:, -1]
        biases = (biases + self.centre @ weights - self._middle) / self._half
        maps = np.concatenate([weights * self.scale[:, None] / self._half, biases[:, None]], axis=1)
        return Cells((policy.codewords - self.centre) / self.scale, maps)

    def labelled(self, teacher: Policy, states: np.ndarray, *, stakes: bool = False) -> Labelled:
        """`states` (n, d) with the teacher's actions there and, if asked for, what is at stake."""
        actions = np.asarray(teacher.predict(states)[0], dtype=np.float64)
        return Labelled(self.inputs(states), self.outputs(actions), teacher.stakes(states) if stakes else None)


@dataclass(frozen=True)
class Cells:
    """What is optimised, in scaled units."""

    codewords: np.ndarray  # (k, d)
    maps: np.ndarray  # (k, d + 1, m): weights, then bias

    @property
    def vector(self) -> np.ndarray:
        """All numbers in a row."""
        return np.concatenate([self.codewords.ravel(), self.maps.ravel()])

    def like(self, vector: np.ndarray) -> Cells:
        """The cells of this shape that have `vector`."""
        cut = self.codewords.size
        return Cells(vector[:cut].reshape(self.codewords.shape), vector[cut:].reshape(self.maps.shape))


@dataclass(frozen=True)
class Labelled:
    """States in scaled units, with what the teacher does there."""

    inputs: np.ndarray  # (n, d + 1), the last column ones
    actions: np.ndarray  # (n, m)
    stakes: np.ndarray | None = None  # (n,) what a wrong action costs there; None: the same everywhere

    def with_more(self, other: Labelled) -> Labelled:
        """These and the others."""
        pairs = ((self.inputs, other.inputs), (self.actions, other.actions), (self.stakes, other.stakes))
        return Labelled(*(None if one is None else np.concatenate([one, more]) for one, more in pairs))

    def draw(self, size: int, rng: np.random.Generator) -> Callable[[], np.ndarray]:
        """A function that draws `size` rows, as often as is at stake in them."""
        n = len(self.inputs)
        if self.stakes is None or not self.stakes.any():
            return lambda: rng.integers(n, size=size)
        edges = np.cumsum(self.stakes / self.stakes.sum())
        return lambda: np.minimum(edges.searchsorted(rng.random(size), side="right"), n - 1)


def refine(
    teacher: Policy, task: str | Task, config: Refinement, *, seed: int, start: VoronoiPolicy | None = None
) -> tuple[VoronoiPolicy, pd.DataFrame]:
    """Distil `teacher` to `config.n_cells` cells, from scratch or from those of `start`. Same arguments, same policy.

    Returns the policy and how it came about: one row per trial, with its stage ("line", one linear map, or "start";
    "fit", "correct", "tune"), restart, mean return and share of failed episodes from the validation starts. Distances
    are Euclidean, whatever those of `start` were. Raises ValueError as `distill` does, for a `start` of another size or
    task, and for `stakes` of a teacher without critics.
    """
    check_seed(seed)
    check_refinement(config)
    task = get_task(task)
    if start is not None:
        _check_start(start, task, config)
    if config.stakes and not hasattr(teacher, "stakes"):
        raise ValueError(f"stakes is True, but {type(teacher).__name__} has no critics: load a teacher with critics")
    with threadpool_limits(1):
        return _refine(teacher, task, config, seed, start)


def _check_start(start: VoronoiPolicy, task: Task, config: Refinement) -> None:
    start.check_linear()
    found, wanted = (len(start), start.task.name), (config.n_cells, task.name)
    if found != wanted:
        raise ValueError(f"start has {found[0]} cells for {found[1]}, expected n_cells = {wanted[0]} for {wanted[1]}")


def _refine(teacher, task, config, seed, start) -> tuple[VoronoiPolicy, pd.DataFrame]:
    starts, init, batches, checks, search = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(5))
    states = visited(teacher, task, task.start(starts, config.n_episodes))
    frame = Frame.of(task, states)
    seen = frame.labelled(teacher, states, stakes=config.stakes)
    aim = Aim(config.failure_price, config.error_price, seen)
    trials = Trials(frame, task.start(checks, config.n_validation), aim)

    warm = min(config.hottest, WARM * config.coldest)  # for what is good already
    first = line(seen, config.n_cells, init) if start is None else frame.cells(start)
    trials.add("line" if start is None else "start", 0, first)
    for restart in range(config.n_restarts):
        cells = beginning(seen, config.n_cells, init) if start is None else first
        hottest = config.hottest if start is None else warm
        trials.add("fit", restart, anneal(seen, cells, config, batches, hottest=hottest, n_steps=config.n_steps))
    cells = trials.best
    for _ in range(config.n_corrections):
        states = visited(frame.policy(cells), task, task.start(starts, config.n_correction_episodes))
        seen = seen.with_more(frame.labelled(teacher, states, stakes=config.stakes))
        cells = anneal(seen, cells, config, batches, hottest=warm, n_steps=config.n_steps // 2)
        trials.add("correct", trials.winner, cells)
    for cells in tune(frame, trials.best, config, aim, search):
        trials.add("tune", trials.winner, cells)
    return frame.policy(trials.best), pd.DataFrame(trials.rows)


@dataclass(frozen=True)
class Aim:
    """What candidates are compared by: their return, less what failures and being unlike the teacher cost."""

    failure_price: float
    error_price: float = 0.0
    seen: Labelled | None = None  # where the teacher goes; without it errors cost nothing

    def worth(self, result: Outcomes, cells: Cells) -> float:
        """Of `cells` that ended as `result` says."""
        value = worth(result, self.failure_price)
        return value - self.error_price * squared_error(self.seen, cells) if self.error_price else value


class Trials:
    """Candidates, compared by their worth for an `Aim` from the same starts; the first of the best is kept."""

    def __init__(self, frame: Frame, starts: np.ndarray, aim: Aim):
        self.rows, self.best, self.winner = [], None, 0
        self._frame, self._starts, self._aim, self._most = frame, starts, aim, -np.inf

    def add(self, stage: str, restart: int, cells: Cells) -> None:
        """Play `cells` from the validation starts."""
        result = play(self._frame.policy(cells), self._frame.task, self._starts)
        mean, failing = result.returns.mean(), np.mean(result.codes != GOAL)
        self.rows.append({"stage": stage, "restart": restart, "mean": mean, "failing": failing})
        if (value := self._aim.worth(result, cells)) > self._most:
            self._most, self.best, self.winner = value, cells, restart


def worth(result: Outcomes, price: float) -> float:
    """Mean return, less `price` for every failed episode; where none can succeed this changes no comparison."""
    return float(result.returns.mean() - price * np.mean(result.codes != GOAL))


def squared_errors(seen: Labelled, cells: Cells) -> np.ndarray:
    """Mean squared error of the limited action of every cell in every state, (n, k)."""
    k, rows, m = cells.maps.shape
    raw = (seen.inputs @ cells.maps.transpose(1, 0, 2).reshape(rows, k * m)).reshape(-1, k, m)
    return np.square(np.clip(raw, -1.0, 1.0) - seen.actions[:, None]).mean(axis=2)


def squared_error(seen: Labelled, cells: Cells) -> float:
    """The same of each state's own cell, over all states."""
    own = closeness(seen, cells).argmax(axis=1)
    return float(squared_errors(seen, cells)[np.arange(len(own)), own].mean())


def closeness(seen: Labelled, cells: Cells) -> np.ndarray:
    """How near each codeword is to each state, greatest for the nearest: |x|² - |x - c|² = 2 x·c - |c|². (n, k)"""
    return 2 * seen.inputs[:, :-1] @ cells.codewords.T - np.square(cells.codewords).sum(axis=1)


def line(seen: Labelled, k: int, rng: np.random.Generator) -> Cells:
    """k codewords at states drawn from `seen`, or nearly, and the least-squares map of all states in every cell."""
    states, common = seen.inputs[:, :-1], np.linalg.lstsq(seen.inputs, seen.actions, rcond=None)[0]
    codewords = states[rng.integers(len(states), size=k)] + 0.01 * rng.normal(size=(k, states.shape[1]))
    return Cells(codewords, np.tile(common, (k, 1, 1)))


def beginning(seen: Labelled, k: int, rng: np.random.Generator) -> Cells:
    """A `line` with a little noise in every map."""
    cells = line(seen, k, rng)
    return Cells(cells.codewords, cells.maps + 0.1 * rng.normal(size=cells.maps.shape))


def anneal(
    seen: Labelled, cells: Cells, config: Refinement, rng: np.random.Generator, *, hottest: float, n_steps: int
) -> Cells:
    """Codewords and maps together by Adam while the temperature falls from `hottest` to `config.coldest`.

    Deterministic annealing (Rose 1998): each state belongs to all cells in shares that fall with their distance, and
    the temperature says how fast. The last tenth of the steps stays at the coldest. Its unit is the variance of the
    states, divided by what k cells divide it by: much above that, cells come to lie on each other and stay there.
    """
    states = seen.inputs[:, :-1]
    spread = states.var(axis=0).sum() or 1.0  # of a single state there is none
    unit = spread * len(cells.codewords) ** (-2 / states.shape[1])
    theta, mean, square, draw = cells.vector, 0.0, 0.0, seen.draw(config.batch_size, rng)
    for i in range(n_steps):
        done = i / n_steps
        temperature = unit * hottest * (config.coldest / hottest) ** min(1.0, done / 0.9)
        rows = draw()
        _, gradient = expected_loss(
            cells.like(theta), seen.inputs[rows], seen.actions[rows], temperature=temperature, leak=config.leak
        )
        mean = BETA1 * mean + (1 - BETA1) * gradient
        square = BETA2 * square + (1 - BETA2) * gradient**2
        step = mean / (1 - BETA1 ** (i + 1)) / (np.sqrt(square / (1 - BETA2 ** (i + 1))) + EPSILON)
        theta = theta - config.learning_rate * (1 - done) * step
    return cells.like(theta)


def expected_loss(
    cells: Cells, inputs: np.ndarray, actions: np.ndarray, *, temperature: float, leak: float
) -> tuple[float, np.ndarray]:
    """Mean squared error of the cells' limited actions, weighted by the cells' shares of a state; and its gradient.

    `inputs` (n, d + 1) and `actions` (n, m); the gradient is that by `cells.vector`.
    """
    n, (k, rows, m) = len(inputs), cells.maps.shape
    states, flat = inputs[:, :-1], cells.maps.transpose(0, 2, 1).reshape(k * m, rows)
    raw = (flat @ inputs.T).reshape(k, m, n)  # sums over cells and actions then run along whole rows
    limited = np.clip(raw, -1.0, 1.0)
    error = limited + leak * (raw - limited) - actions.T
    losses = np.square(error).mean(axis=1)

    closeness = (2 * cells.codewords @ states.T - np.square(cells.codewords).sum(axis=1)[:, None]) / temperature
    shares = np.exp(closeness - closeness.max(axis=0))
    shares /= shares.sum(axis=0)
    loss = (shares * losses).sum(axis=0)

    by_raw = (2 / (n * m)) * shares[:, None] * error * np.where(raw == limited, 1.0, leak)
    by_maps = (by_raw.reshape(k * m, n) @ inputs).reshape(k, m, rows).transpose(0, 2, 1)
    by_closeness = shares * (losses - loss) * (2 / (n * temperature))
    by_codewords = by_closeness @ states - by_closeness.sum(axis=1)[:, None] * cells.codewords
    return float(loss.mean()), np.concatenate([by_codewords.ravel(), by_maps.ravel()])


def tune(frame: Frame, cells: Cells, config: Refinement, aim: Aim, rng: np.random.Generator) -> Iterator[Cells]:
    """CMA-ES (Hansen 2016) on the worth for `aim`: a generation plays all its candidates from the same fresh starts.

    Yields where the search stands, `SNAPSHOTS` times: rare failures may slip in later, unseen by a generation's starts.
    """
    import cma

    options = {"seed": np.nan, "randn": lambda *shape: rng.standard_normal(shape), "verbose": -9}
    search = cma.CMAEvolutionStrategy(cells.vector, config.tuning_step, options)
    for i in range(config.n_generations):
        starts = frame.task.start(rng, config.n_tuning_episodes)
        asked = search.ask()
        candidates = [cells.like(one) for one in asked]
        played = play_all([frame.policy(one) for one in candidates], frame.task, starts)
        search.tell(asked, [-aim.worth(result, one) for result, one in zip(played, candidates)])
        if (i + 1) * SNAPSHOTS // config.n_generations > i * SNAPSHOTS // config.n_generations:
            yield cells.like(search.result.xfavorite)
