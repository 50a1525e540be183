"""Linear maps in cells, fitted with the teacher's critics, after two published methods.

Both are fitted to states (n, d) and actions (n, m) of a teacher that has critics.
"""

from __future__ import annotations

import numpy as np

from vsp import Task, VoronoiPolicy
from vsp.geometry import nearest
from vsp.paper.baselines import kmeans_cells
from vsp.rollouts import standard
from vsp.subpolicies import linear_outputs
from vsp.teachers.teacher import Teacher
from vsp_beyond.few_cells.anneal import Adam
from vsp_beyond.few_cells.criticality import critics_of

N_STEPS, BATCH, RATE = 1000, 256, 0.03  # Adam: steps per added cell, states per step, initial step size in half ranges
WORST = 0.01  # share of a cell's states whose mean becomes a codeword: those that lose the most value


def critic_driven(
    states: np.ndarray, actions: np.ndarray, *, size: int, teacher: Teacher, task: Task, seed: int
) -> VoronoiPolicy:
    """Add cells where the critics value the distilled action too low, after arXiv 2605.14897.

    We know only its abstract. It says: linear maps are trained by gradient descent, cells are added where the teacher's
    critic finds the value insufficient, and each state belongs to its nearest codeword. The rest is our guess. The
    first codeword is the mean of the states. Distances are Euclidean, between standardised states. `trained` trains the
    maps. The loss of a state is the value of the teacher's action minus that of the distilled action, at least 0. The
    cell with the largest total loss gets a second codeword, at the mean of the 1 % of its states that lose most, with a
    copy of its map. Codewords never move. The result has fewer than `size` cells if no state loses value any more.
    """
    rng = np.random.default_rng(seed)
    centre, scale = standard(states)
    points, best = (states - centre) / scale, critics_of(teacher).value(states, actions)
    codewords, maps = np.zeros((1, len(centre))), np.zeros((1, len(centre) + 1, actions.shape[1]))
    while True:
        cells_of = nearest(codewords, points, "euclidean")
        maps = trained(maps, cells_of, points, actions, task, rng)
        distilled = np.clip(linear_outputs(points, maps[cells_of]), task.action_low, task.action_high)
        lost = np.maximum(0.0, best - critics_of(teacher).value(states, distilled))
        if len(maps) >= size or not lost.any():
            break
        cell, codeword = where_lost(points, cells_of, lost)
        codewords, maps = np.vstack([codewords, codeword]), np.concatenate([maps, maps[cell][None]])
    weights = maps[:, :-1] / scale[:, None]
    coefficients = np.concatenate([weights, maps[:, -1:] - (centre @ weights)[:, None]], axis=1)
    return VoronoiPolicy(codewords * scale + centre, coefficients, task=task, metric="euclidean", scale=scale)


def where_lost(points: np.ndarray, cells_of: np.ndarray, lost: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the cell with the largest total loss, and the mean (d,) of the share `WORST` of its points that lose most.

    `points` (n, d) belong to the cells `cells_of` (n,) and lose `lost` (n,).
    """
    cell = int(np.bincount(cells_of, lost).argmax())
    rows = np.flatnonzero(cells_of == cell)
    worst = rows[np.argsort(-lost[rows], kind="stable")[: max(1, round(WORST * len(rows)))]]
    return cell, points[worst].mean(axis=0)


def trained(
    maps: np.ndarray, cells: np.ndarray, points: np.ndarray, actions: np.ndarray, task: Task, rng: np.random.Generator
) -> np.ndarray:
    """Return `maps` (k, d + 1, m) after Adam on the squared error of the clipped action.

    `points` (n, d) lie in `cells` (n,) and are standardised, `actions` (n, m) in the units of the task. `rng` draws the
    batches; the step size falls to 0. The gradient ignores the clipping, because otherwise maps beyond the action box
    would stop learning.
    """
    half, adam = 0.5 * (task.action_high - task.action_low), Adam()
    inputs = np.column_stack([points, np.ones(len(points))])
    for i in range(N_STEPS):
        rows = rng.integers(len(points), size=BATCH)
        raw = linear_outputs(points[rows], maps[cells[rows]])
        error = (np.clip(raw, task.action_low, task.action_high) - actions[rows]) / half
        here = cells[rows] == np.arange(len(maps))[:, None]  # (k, BATCH)
        gradient = 2 / BATCH * np.einsum("kn,np,nm->kpm", here, inputs[rows], error, optimize=True)
        maps = maps - RATE * (1 - i / N_STEPS) * half * adam.step(gradient)
    return maps


def advantage_weighted(
    states: np.ndarray, actions: np.ndarray, *, size: int, teacher: Teacher, task: Task, seed: int
) -> VoronoiPolicy:
    """Fit maps in `kmeans_cells` that err least where a wrong action costs most, after the idea of arXiv 2507.07848.

    Dispoto et al. (2025) weight the fit of an interpretable policy by the advantage. Here the maps are fitted by least
    squares, weighted by the teacher's criticality relative to its largest value in the cell. A cell where no action
    costs anything keeps its unweighted map. With one cell, this is one weighted linear map.
    """
    policy = kmeans_cells(states, actions, cells=size, task=task, seed=seed)
    cells_of, coefficients = policy.cells(states), policy.coefficients.copy()
    weights = critics_of(teacher).criticality(states)
    inputs = np.column_stack([states, np.ones(len(states))])
    for i in np.unique(cells_of):
        here = cells_of == i
        if (most := weights[here].max()) > 0:
            root = np.sqrt(weights[here] / most)[:, None]
            coefficients[i] = np.linalg.lstsq(root * inputs[here], root * actions[here], rcond=None)[0]
    return VoronoiPolicy(policy.codewords, coefficients, task=policy.task, metric=policy.metric, scale=policy.scale)
