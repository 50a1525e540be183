"""`least_error`: find the cells that act most like the teacher on given states, by L-BFGS from many initial cells.

The error has many local minima, and no slope where an action lies beyond its limits. So descents begin with soft cells
and a small slope beyond the limits. Softness and slope both fall stage by stage (deterministic annealing, Rose 1998).
Descents that fall behind are stopped early (successive halving, Jamieson & Talwalkar 2016).
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize

from vsp.run.progress import steps

from .units import LabelledStates, ScaledCells, expected_loss, joined, squared_error, temperature_unit

N_STAGES = 16
TEMPERATURES = np.geomspace(1.0, 0.002, N_STAGES)  # units as in `anneal`
CLIP_SLOPES = np.geomspace(0.2, 0.005, N_STAGES)  # slopes of the limited action beyond the limits
N_ITERATIONS, N_LAST = 40, 60  # of L-BFGS in a stage, and in a stage of the last descent
FEW = 8000  # states that the rounds use; with too few, the outcome depends on which rare states are drawn
# Stages of a round, and how many descents go on: stopping sooner is quicker, but loses the best results of few cells
ROUNDS = ((range(0, 6), 8), (range(6, 12), 4), (range(12, N_STAGES), 1))
LAST = range(12, N_STAGES)  # stages of the last descent, which uses all states
AT_ONCE = 60_000  # size of the largest arrays in a loss: they fit into the cache
NUDGE = 0.05  # move of a codeword that shows the curvature of the error, in deviations of the states
RIDGE = 1e-4  # ridge of `uncorrelated`: states of unit size added per state


def least_error(labelled: LabelledStates, n_cells: int, n_starts: int, rng: np.random.Generator) -> ScaledCells:
    """Return the cells with the least `squared_error` on `labelled` that `n_starts` descents find."""
    some = labelled.thinned(FEW, rng)
    live = [local_init(some, n_cells, rng) for _ in range(n_starts)]
    for stages, n_kept in ROUNDS:
        tried = steps(live, f"fits with {n_cells} cells", total=len(live), unit="starts")
        ends = [descend(some, cells, stages) for cells in tried]
        live = sorted(ends, key=lambda cells: squared_error(labelled, cells))[:n_kept]
    return distinct(descend(labelled, live[0], LAST, n_iterations=N_LAST))


def distinct(cells: ScaledCells) -> ScaledCells:
    """Drop codewords that are equal to an earlier one: of equally near codewords the first counts, so no state is in
    their cells."""
    return cells.at(np.sort(np.unique(cells.codewords, axis=0, return_index=True)[1]))


def local_init(labelled: LabelledStates, k: int, rng: np.random.Generator) -> ScaledCells:
    """Place k codewords at states drawn from `labelled`, each with the least-squares map of the states in its cell."""
    d, inputs = labelled.inputs.shape[1] - 1, labelled.inputs
    common = np.linalg.lstsq(inputs, labelled.actions, rcond=None)[0]
    codewords = inputs[rng.choice(len(inputs), size=k, replace=len(inputs) < k), :d]
    cells = ScaledCells(codewords, np.tile(common, (k, 1, 1)))
    nearest = cells.nearest(inputs[:, :d])
    for i in range(k):  # a weak pull to the map of all states, for cells with few states
        rows = np.vstack([inputs[nearest == i], np.eye(d + 1)])
        actions = np.vstack([labelled.actions[nearest == i], common])
        cells.coefficients[i] = np.linalg.lstsq(rows, actions, rcond=None)[0]
    return cells


def descend(
    labelled: LabelledStates, cells: ScaledCells, stages: range, *, n_iterations: int = N_ITERATIONS
) -> ScaledCells:
    """Optimise `cells` by L-BFGS on the expected loss, stage by stage, in units in which the inputs of a cell are
    uncorrelated."""
    for stage in stages:
        temperature = temperature_unit(labelled, len(cells)) * TEMPERATURES[stage]
        bases = uncorrelated(labelled, cells.shares(labelled.states, temperature))
        loss = partial(whole_loss, labelled=labelled, temperature=temperature, clip_slope=CLIP_SLOPES[stage])
        cells = least(loss, cells, bases, np.sqrt(TEMPERATURES[stage]), n_iterations)
    return cells


def least(loss: Callable[..., tuple], start: Any, bases: np.ndarray, units: float, n_iterations: int) -> Any:
    """Minimise `loss`, a function of such as `start` that returns a value and its gradient with respect to `vector`, by
    L-BFGS in the units of `moves`."""
    move, pull_back = moves(start, bases, units)

    def of_step(step: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = loss(move(step))
        return value, pull_back(gradient)

    options = {"maxiter": n_iterations, "maxcor": 20}
    return move(minimize(of_step, np.zeros(start.vector.size), jac=True, method="L-BFGS-B", options=options).x)


def whole_loss(cells: ScaledCells, labelled: LabelledStates, **about: float) -> tuple[float, np.ndarray]:
    """Compute `expected_loss` of all states, some at a time, and the ridge."""
    n, value, gradient = len(labelled.inputs), 0.0, np.zeros(cells.vector.size)
    step = max(1, AT_ONCE // (len(cells) * labelled.actions.shape[1]))
    for i in range(0, n, step):
        inputs, actions = labelled.inputs[i : i + step], labelled.actions[i : i + step]
        part, its_gradient = expected_loss(cells, inputs, actions, **about)
        value, gradient = value + len(inputs) / n * part, gradient + len(inputs) / n * its_gradient
    if labelled.ridge:
        slopes = cells.coefficients.copy()
        slopes[:, -1] = 0.0  # the bias is free
        value += labelled.ridge * np.square(slopes).sum()
        gradient[cells.codewords.size :] += 2 * labelled.ridge * slopes.ravel()
    return value, gradient


def uncorrelated(labelled: LabelledStates, shares: np.ndarray) -> np.ndarray:
    """Return bases of the coefficients in which a step of length 1 changes the mean squared output of a cell by about
    1. (k, p, p) `shares` (k, n): how much of each state belongs to each cell."""
    inputs, p = labelled.inputs, labelled.inputs.shape[1]
    products = np.stack([(inputs * share[:, None]).T @ inputs for share in shares]) / len(inputs)
    return np.linalg.cholesky(np.linalg.inv(products + RIDGE * np.eye(p)))


def moves(start: Any, bases: np.ndarray, units: np.ndarray | float):
    """Return two functions: one from a step to the moved `start`, and one from a gradient with respect to its `vector`
    to the gradient with respect to the step. The last of its `parts` are maps, which move in the `bases`; its other
    numbers move in `units`."""
    vector, maps = start.vector, start.parts[-1]
    cut = vector.size - maps.size

    def move(step: np.ndarray) -> Any:
        return start.like(vector + joined([units * step[:cut], bases @ step[cut:].reshape(maps.shape)]))

    def pull_back(gradient: np.ndarray) -> np.ndarray:
        return joined([units * gradient[:cut], bases.transpose(0, 2, 1) @ gradient[cut:].reshape(maps.shape)])

    return move, pull_back


def even_moves(labelled: LabelledStates, cells: ScaledCells) -> Callable[[np.ndarray], ScaledCells]:
    """Return the first function of `moves`, in units in which steps of one length raise the error equally, by its
    curvature."""
    here, vector, units = squared_error(labelled, cells), cells.vector, np.empty(cells.codewords.size)
    for j in range(len(units)):
        nudge = np.zeros_like(vector)
        nudge[j] = NUDGE
        more = sum(squared_error(labelled, cells.like(vector + sign * nudge)) - here for sign in (1, -1))
        units[j] = 1.0 / np.sqrt(max(0.0, 0.5 * more / NUDGE**2) + 1e-3)
    inside = cells.nearest(labelled.states) == np.arange(len(cells))[:, None]
    return moves(cells, uncorrelated(labelled, inside.astype(np.float64)), units)[0]
