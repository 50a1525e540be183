"""The optimised numbers, in units in which one step size fits all: inputs of mean 0 and deviation 1, actions in
[-1, 1]."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy, standard
from vsp.tasks.base import Task

from .criticality import critics_of

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

    def labelled(self, teacher: Policy, states: np.ndarray, *, criticality: bool = False) -> LabelledStates:
        """Return `states` (n, d) with the teacher's actions and, if asked for, their criticality."""
        actions = np.asarray(teacher.predict(states)[0], dtype=np.float64)
        weights = critics_of(teacher).criticality(states) if criticality else None
        return LabelledStates(self.inputs(states), self.outputs(actions), weights)


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

    def closeness(self, states: np.ndarray) -> np.ndarray:
        """Return how near each codeword is to each of `states` (n, d), largest for the nearest. (k, n)

        |x|² - |x - c|² = 2 x·c - |c|²: one matrix product.
        """
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

    def rows(self, rows: np.ndarray) -> LabelledStates:
        """Return the states at `rows`."""
        weights = None if self.criticality is None else self.criticality[rows]
        return LabelledStates(self.inputs[rows], self.actions[rows], weights)

    def with_more(self, other: LabelledStates) -> LabelledStates:
        """Return these states, then those of `other`."""
        parts = zip(vars(self).values(), vars(other).values())
        return LabelledStates(*(first if first is None else np.concatenate([first, second]) for first, second in parts))

    def draw(self, size: int, rng: np.random.Generator) -> Callable[[], np.ndarray]:
        """Return a function that draws `size` rows, with probabilities in proportion to the criticality."""
        n = len(self.inputs)
        if self.criticality is None or not self.criticality.any():
            return lambda: rng.integers(n, size=size)
        edges = np.cumsum(self.criticality / self.criticality.sum())
        return lambda: np.minimum(edges.searchsorted(rng.random(size), side="right"), n - 1)


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
