"""Cells and labelled states as arrays, in units in which one step size fits all: inputs of mean 0 and deviation 1,
actions in [-1, 1]."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from vsp import Task, VoronoiPolicy
from vsp.rollouts import standard

METRIC = "euclidean"  # of the scaled states: borders between cells are then straight


@dataclass(frozen=True)
class Scaling:
    """Converts between the units of the task and those of the optimisation."""

    task: Task
    centre: np.ndarray  # (d,) mean of the observations
    scale: np.ndarray  # (d,) their standard deviation

    @classmethod
    def of(cls, task: Task, states: np.ndarray) -> Scaling:
        """Return the scaling that gives `states` (n, d) mean 0 and deviation 1; a constant variable keeps its unit."""
        return cls(task, *standard(states))

    @property
    def _middle(self) -> np.ndarray:
        return 0.5 * (self.task.action_high + self.task.action_low)

    @property
    def _half(self) -> np.ndarray:
        return 0.5 * (self.task.action_high - self.task.action_low)

    def inputs(self, states: np.ndarray) -> np.ndarray:
        """Return scaled states and a column of ones, (n, d + 1), for states (n, d)."""
        return np.column_stack([(states - self.centre) / self.scale, np.ones(len(states))])

    def states(self, inputs: np.ndarray) -> np.ndarray:
        """Return the states (n, d) of `inputs` (n, d + 1)."""
        return inputs[:, :-1] * self.scale + self.centre

    def outputs(self, actions: np.ndarray) -> np.ndarray:
        """Convert actions (n, m) to units in which the limits are -1 and 1."""
        return (actions - self._middle) / self._half

    def actions(self, outputs: np.ndarray) -> np.ndarray:
        """Convert `outputs` (n, m) to the units of the task, limited to its action range."""
        return np.clip(outputs, -1.0, 1.0) * self._half + self._middle

    def coefficients(self, coefficients: np.ndarray) -> np.ndarray:
        """Convert coefficients (..., p + 1, m) that give actions into coefficients that give `outputs`."""
        weights, biases = coefficients[..., :-1, :], coefficients[..., -1:, :]
        return np.concatenate([weights / self._half, self.outputs(biases)], axis=-2)

    def policy(self, cells: ScaledCells) -> VoronoiPolicy:
        """Return `cells` as a policy in the units of the task."""
        weights = cells.coefficients[:, :-1] * self._half / self.scale[:, None]
        biases = cells.coefficients[:, -1] * self._half + self._middle - self.centre @ weights
        coefficients = np.concatenate([weights, biases[:, None]], axis=1)
        codewords = cells.codewords * self.scale + self.centre
        return VoronoiPolicy(codewords, coefficients, task=self.task, metric=METRIC, scale=self.scale)

    def cells(self, policy: VoronoiPolicy) -> ScaledCells:
        """Return the codewords and coefficients of `policy` in these units."""
        weights, biases = policy.coefficients[:, :-1], policy.coefficients[:, -1]
        biases = biases + self.centre @ weights
        coefficients = self.coefficients(np.concatenate([weights * self.scale[:, None], biases[:, None]], axis=1))
        return ScaledCells((policy.codewords - self.centre) / self.scale, coefficients)

    def labelled(self, states: np.ndarray, actions: np.ndarray, weights: np.ndarray | None = None) -> LabelledStates:
        """Return `states` (n, d) with the teacher's `actions` (n, m) and, if given, their criticality (n,)."""
        return LabelledStates(self.inputs(states), self.outputs(np.asarray(actions, dtype=np.float64)), weights)


def joined(parts: list[np.ndarray]) -> np.ndarray:
    """Join the numbers of all `parts` in one array, as a search needs them."""
    return np.concatenate([part.ravel() for part in parts])


def parted(vector: np.ndarray, like: list[np.ndarray]) -> list[np.ndarray]:
    """Split `vector` into parts of the shapes of those in `like`: the inverse of `joined`."""
    ends = np.cumsum([part.size for part in like])
    return [vector[end - part.size : end].reshape(part.shape) for end, part in zip(ends, like)]


@dataclass(frozen=True)
class ScaledCells:
    """Codewords and coefficients in scaled units."""

    codewords: np.ndarray  # (k, d)
    coefficients: np.ndarray  # (k, d + 1, m): weights, then bias

    def __len__(self) -> int:
        return len(self.codewords)

    @property
    def vector(self) -> np.ndarray:
        """All numbers in one array."""
        return joined(self.parts)

    @property
    def parts(self) -> list[np.ndarray]:
        """Codewords, then coefficients."""
        return [self.codewords, self.coefficients]

    def like(self, vector: np.ndarray) -> ScaledCells:
        """Return cells of the same shape with the numbers of `vector`."""
        return ScaledCells(*parted(vector, self.parts))

    def at(self, rows: np.ndarray) -> ScaledCells:
        """Return the cells at `rows`, in this order."""
        return ScaledCells(self.codewords[rows], self.coefficients[rows])

    def by_visits(self, states: np.ndarray) -> ScaledCells:
        """Return the same cells, the one with the most of `states` (n, d) first."""
        visits = np.bincount(self.nearest(states), minlength=len(self))
        return self.at(np.argsort(-visits, kind="stable"))

    def among(self, states: np.ndarray) -> ScaledCells:
        """Draw the same border between two cells by codewords among `states` (n, d). Of the many pairs that draw it,
        choose the one around the mean state. With more codewords there is no such choice."""
        if len(self) != 2:
            return self
        first, second = self.codewords
        across = (second - first) / np.linalg.norm(second - first)
        beyond = (states - (first + second) / 2) @ across  # signed distances from the border
        on_border = states.mean(axis=0) - beyond.mean() * across
        return ScaledCells(on_border + np.outer([-1.0, 1.0], np.abs(beyond).mean() * across), self.coefficients)

    def closeness(self, states: np.ndarray) -> np.ndarray:
        """Return how near each codeword is to each of `states` (n, d), largest for the nearest. (k, n) |x|² - |x - c|²
        = 2 x·c - |c|²: one matrix product."""
        return 2 * self.codewords @ states.T - np.square(self.codewords).sum(axis=1)[:, None]

    def nearest(self, states: np.ndarray) -> np.ndarray:
        """Return the cell of each of `states` (n, d). (n,)"""
        return self.closeness(states).argmax(axis=0)

    def shares(self, states: np.ndarray, temperature: float) -> np.ndarray:
        """Return the share of each of `states` (n, d) that belongs to each cell; at a low temperature, all of it to the
        nearest. (k, n)"""
        closeness = self.closeness(states) / temperature
        shares = np.exp(closeness - closeness.max(axis=0))
        shares /= shares.sum(axis=0)
        return shares

    def outputs(self, inputs: np.ndarray) -> np.ndarray:
        """Return the actions of every cell for `inputs` (n, d + 1), not limited. (k, m, n): states along the last axis,
        for speed"""
        k, rows, m = self.coefficients.shape
        return (self.coefficients.transpose(0, 2, 1).reshape(k * m, rows) @ inputs.T).reshape(k, m, -1)


@dataclass(frozen=True)
class LabelledStates:
    """States in scaled units, with the teacher's actions there."""

    inputs: np.ndarray  # (n, d + 1), the last column ones
    actions: np.ndarray  # (n, m)
    criticality: np.ndarray | None = None  # (n,) what a wrong action costs there; None: the same everywhere
    ridge: float = 0.0  # weight of squared slopes in the error of a descent

    @property
    def states(self) -> np.ndarray:
        """The states, without the column of ones. (n, d)"""
        return self.inputs[:, :-1]

    def thinned(self, n: int, rng: np.random.Generator) -> LabelledStates:
        """Return n of these states, as dense as all of them (`spread`)."""
        rows = spread(self.states, n, rng)
        weights = None if self.criticality is None else self.criticality[rows]
        return LabelledStates(self.inputs[rows], self.actions[rows], weights, self.ridge)

    def with_more(self, other: LabelledStates) -> LabelledStates:
        """Return these states, then those of `other`."""
        pairs = zip(vars(self).values(), vars(other).values())
        parts: list = [np.concatenate([one, two]) if isinstance(one, np.ndarray) else one for one, two in pairs]
        return LabelledStates(*parts)

    def draw(self, size: int, rng: np.random.Generator) -> Callable[[], np.ndarray]:
        """Return a function that draws `size` rows, with probabilities in proportion to the criticality."""
        n = len(self.inputs)
        if self.criticality is None or not self.criticality.any():
            return lambda: rng.integers(n, size=size)
        edges = np.cumsum(self.criticality / self.criticality.sum())
        return lambda: np.minimum(edges.searchsorted(rng.random(size), side="right"), n - 1)


def spread(points: np.ndarray, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return the rows of n of the `points`, as dense as all of them: a stratified sample. It takes one point of each
    n-th part in the order of a k-d tree, so it depends less on chance than independent draws. Returns all rows if there
    are no more than n."""
    if len(points) <= n:
        return np.arange(len(points))
    order = KDTree(points, leafsize=max(1, len(points) // n)).indices
    return order[((np.arange(n) + rng.random(n)) * len(points) / n).astype(np.intp)]


def warn_outside(task: Task, states: np.ndarray) -> None:
    """Warn if observations (t, d) leave the box that the task declares: how many, and which variable leaves it most."""
    beyond = np.maximum(task.low - states, states - task.high)
    outside = (beyond > 1e-6 * (1.0 + np.abs(states))).any(axis=1)  # float32 rounds
    if outside.any():
        row, j = np.unravel_index(beyond.argmax(), beyond.shape)
        warnings.warn(
            f"{outside.sum():,} of {len(states):,} observations leave the box of {task.name}, such as "
            f"{task.inputs[j]} = {states[row, j]:.6g}, declared from {task.low[j]:g} to {task.high[j]:g}",
            stacklevel=5,  # the caller of `vsp.distill`
        )


def squared_error(labelled: LabelledStates, cells: ScaledCells) -> float:
    """Mean squared error of the limited action of each state's cell, over all states."""
    nearest, limited = cells.nearest(labelled.states), np.clip(cells.outputs(labelled.inputs), -1.0, 1.0)
    errors = np.square(limited - labelled.actions.T).mean(axis=1)  # (k, n)
    return float(errors[nearest, np.arange(len(nearest))].mean())


def unexplained(labelled: LabelledStates, cells: ScaledCells) -> float:
    """1 - R²: `squared_error` in units of that of the best constant action, or of 1 if the teacher is constant."""
    variance = float(labelled.actions.var(axis=0).mean())
    return squared_error(labelled, cells) / (variance if variance > 1e-12 else 1.0)


def temperature_unit(labelled: LabelledStates, k: int) -> float:
    """Return the variance of the states inside one of k cells. At much higher temperatures, codewords collapse onto
    each other and stay there. A single state has no variance; its unit is 1."""
    states = labelled.states
    return (states.var(axis=0).sum() or 1.0) * k ** (-2 / states.shape[1])


def expected_loss(
    cells: ScaledCells, inputs: np.ndarray, actions: np.ndarray, *, temperature: float, clip_slope: float
) -> tuple[float, np.ndarray]:
    """Mean squared error of the limited actions, weighted by each cell's share of a state, and its gradient. `inputs`
    (n, d + 1) and `actions` (n, m); the gradient is with respect to `cells.vector`."""
    n, (k, rows, m), states = len(inputs), cells.coefficients.shape, inputs[:, :-1]
    raw = cells.outputs(inputs)
    limited = np.clip(raw, -1.0, 1.0)
    error = limited + clip_slope * (raw - limited) - actions.T
    losses = np.square(error).mean(axis=1)

    shares = cells.shares(states, temperature)
    loss = (shares * losses).sum(axis=0)

    by_raw = (2 / (n * m)) * shares[:, None] * error * np.where(raw == limited, 1.0, clip_slope)
    by_coefficients = (by_raw.reshape(k * m, n) @ inputs).reshape(k, m, rows).transpose(0, 2, 1)
    by_closeness = shares * (losses - loss) * (2 / (n * temperature))
    by_codewords = by_closeness @ states - by_closeness.sum(axis=1)[:, None] * cells.codewords
    return float(loss.mean()), np.concatenate([by_codewords.ravel(), by_coefficients.ravel()])


def needed_only(cells: ScaledCells, labelled: LabelledStates) -> ScaledCells:
    """Remove cells that the error does not need: the next codeword serves their states as well, as where two neighbours
    hold the same map."""
    while len(cells) > 1:
        fewer = [cells.at(np.delete(np.arange(len(cells)), i)) for i in range(len(cells))]
        errors = [squared_error(labelled, others) for others in fewer]
        if min(errors) > squared_error(labelled, cells):
            break
        cells = fewer[int(np.argmin(errors))]
    return cells
