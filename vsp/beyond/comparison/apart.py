"""The fit and the borders apart: what our cells owe to their fit, and what to the Voronoi diagram.

Our cells differ from a tree with linear leaves in their borders, and in their fit: all their numbers together, where a
tree is grown greedily. Here are the combinations that are neither: a tree whose numbers are fitted together, and cells
that are grown greedily; beside them our cells, fitted with the same effort. `ObliqueLinearTree` is the fourth. Each is
a function of a budget, a size and a seed, and is fitted to the teacher's own episodes, without corrections.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from ...baselines.simple import refit
from ...baselines.trees import ObliqueLinearTree, Split
from ...policy import VoronoiPolicy
from ...rollouts import Policy
from ...tasks.base import Task
from ..refinement import search
from ..refinement.anneal import temperature_unit
from ..refinement.units import Cells, Frame, LabelledStates, joined
from .methods import Budget, alone
from .tuning import TreeNumbers, Tunable, in_units

N_BEGINNINGS = 64  # at random: so many divided by the size, at least 8, for descents of few numbers are quick
N_GREEDY = 4  # greedy trees that descents begin from besides
HOT = ((range(0, 2), 12), (range(2, 6), 4))  # stages, and how many descents of random trees go on
WARM = ((range(6, 12), 3), (range(12, search.N_STAGES), 1))  # the same, of these and of the greedy trees
CERTAIN = 40.0  # logits beyond have shares of 0 and 1 in float64


def tree_by_global_fit(budget: Budget, size: int, seed: int) -> Policy:
    """Our fit with a tree's borders: an oblique tree with linear leaves, all its numbers fitted together."""
    return alone(budget, size, seed, fit=global_tree)


def cells_by_greedy_fit(budget: Budget, size: int, seed: int) -> Policy:
    """A tree's fit with our borders: Voronoi cells that are split one after the other, as a tree is grown."""
    return alone(budget, size, seed, fit=greedy_cells)


def cells_by_global_fit(budget: Budget, size: int, seed: int) -> Policy:
    """Our fit with our borders, from as many beginnings as `tree_by_global_fit` and on the same states."""
    return alone(budget, size, seed, fit=global_cells)


# All numbers together


@threadpool_limits.wrap(limits=1)
def global_cells(states: np.ndarray, actions: np.ndarray, size: int, task: Task, seed: int) -> VoronoiPolicy:
    """The cells with the least error on states (n, d) and actions (n, m) that `search.least_error` finds."""
    frame = Frame.of(task, states)
    seen = LabelledStates(frame.inputs(states), frame.outputs(actions))
    return frame.policy(search.least_error(seen, size, beginnings(size), np.random.default_rng(seed)))


@threadpool_limits.wrap(limits=1)
def global_tree(states: np.ndarray, actions: np.ndarray, size: int, task: Task, seed: int) -> Tunable:
    """The oblique tree with the least error on states (n, d) and actions (n, m), searched as by `search.least_error`.

    Descents from trees split at random begin hot; greedy trees are good already and join them on the way. All keep
    their structure, and fit directions, thresholds and maps together. A greedy tree is returned where no descent is
    better.
    """
    rng, frame = np.random.default_rng(seed), Frame.of(task, states)
    some = search.spread(states / frame.scale, search.FEW, rng)

    def grown(kind: type[ObliqueLinearTree], n: int) -> list[Tunable]:
        seeds = rng.integers(2**31, size=n).tolist()
        trees = [kind(states, actions, leaves=size, task=task, seed=one) for one in seeds]
        return [Tunable(*in_units(tree, frame), tree) for tree in trees]

    def error(tree: Tunable) -> float:
        return action_error(tree, frame, states, actions)

    def kept(trees: list[Tunable], rounds: tuple) -> list[Tunable]:
        for stages, n_kept in rounds:
            ends = [descend(tree, states[some], actions[some], stages) for tree in trees]
            trees = sorted(ends, key=error)[:n_kept]
        return trees

    greedy = grown(ObliqueLinearTree, N_GREEDY)
    (best,) = kept(kept(grown(RandomTree, beginnings(size)), HOT) + greedy, WARM)
    last = descend(best, states, actions, search.LAST, n_iterations=search.N_LAST)
    return min([last, *greedy], key=error)


def beginnings(size: int) -> int:
    """How many descents begin at random, of a policy with `size` cells or leaves."""
    return max(8, N_BEGINNINGS // size)


class RandomTree(ObliqueLinearTree):
    """An oblique tree that is split at random: between two states of a leaf, often of one with many states."""

    def split(self, inputs: np.ndarray, actions: np.ndarray) -> Split:
        """The border between two of the `inputs` (n, d), with a gain drawn at random."""
        left, right = inputs[self._rng.integers(len(inputs), size=2)]
        direction = (right - left) / (np.linalg.norm(right - left) or 1.0)
        gain = self._rng.random() * len(inputs) * (left != right).any()
        return Split(gain, direction, direction @ (left + right) / 2)


def action_error(policy: Policy, frame: Frame, states: np.ndarray, actions: np.ndarray) -> float:
    """Mean squared error of the policy's actions in states (n, d), in half action ranges; `actions` (n, m)."""
    return float(np.square(frame.outputs(policy.predict(states)[0]) - frame.outputs(actions)).mean())


def descend(
    tree: Tunable, states: np.ndarray, actions: np.ndarray, stages: range, *, n_iterations: int = search.N_ITERATIONS
) -> Tunable:
    """`tree` after L-BFGS on the expected loss, stage by stage, as `search.descend` does with cells.

    The temperature is in units of half a cell's width: then a border is as soft as one between two codewords.
    """
    seen = LabelledStates(tree.frame.inputs(states), tree.frame.outputs(actions))
    numbers, unit = tree.numbers, 0.5 * np.sqrt(temperature_unit(seen, len(tree)))
    for stage in stages:
        numbers = _cooler(seen, numbers, unit, stage, n_iterations)
    return Tunable(tree.frame, numbers, tree)


def _cooler(seen: LabelledStates, tree: TreeNumbers, unit: float, stage: int, n_iterations: int) -> TreeNumbers:
    temperature, slope = unit * search.TEMPERATURES[stage], np.sqrt(search.TEMPERATURES[stage])
    bases = search.uncorrelated(seen, shares(tree, seen.inputs[:, :-1], temperature))
    vector, shape, cut = tree.vector, tree.maps.shape, tree.vector.size - tree.maps.size

    def move(step: np.ndarray) -> TreeNumbers:
        return tree.like(vector + joined([slope * step[:cut], bases @ step[cut:].reshape(shape)]))

    def loss(step: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = expected_loss(move(step), seen, temperature=temperature, clip_slope=search.LEAKS[stage])
        by_maps = bases.transpose(0, 2, 1) @ gradient[cut:].reshape(shape)
        return value, joined([slope * gradient[:cut], by_maps])

    options = {"maxiter": n_iterations, "maxcor": 20}
    return move(minimize(loss, np.zeros(len(vector)), jac=True, method="L-BFGS-B", options=options).x)


def shares(tree: TreeNumbers, states: np.ndarray, temperature: float) -> np.ndarray:
    """How much of each of `states` (n, d) belongs to each leaf: in the cold, all of it to its own. (leaves, n)

    The product of the shares that turn towards the leaf at the nodes on its way: each the sigmoid of how far the state
    lies beyond the threshold, in units of the temperature.
    """
    return np.exp(_ways(tree) @ _turns(tree, states, temperature))


def _ways(tree: TreeNumbers) -> np.ndarray:
    """Which turns lead to each leaf: first those to the left, then those to the right. (leaves, 2 nodes)"""
    return np.hstack([tree.sides < 0, tree.sides > 0]).astype(np.float64)


def _turns(tree: TreeNumbers, states: np.ndarray, temperature: float) -> np.ndarray:
    """Logarithms of the shares that turn left, then of those that turn right, at each node. (2 nodes, n)"""
    logits = np.clip((tree.directions @ states.T - tree.thresholds[:, None]) / temperature, -CERTAIN, CERTAIN)
    rest = np.log1p(np.exp(-np.abs(logits)))
    return np.vstack([-np.maximum(logits, 0.0) - rest, np.minimum(logits, 0.0) - rest])


def expected_loss(
    tree: TreeNumbers, seen: LabelledStates, *, temperature: float, clip_slope: float
) -> tuple[float, np.ndarray]:
    """Mean squared error of the limited actions, weighted by each leaf's share of a state, and its gradient.

    As `anneal.expected_loss` of cells; the gradient is with respect to `tree.vector`.
    """
    (n, m), (k, rows, _), states = seen.actions.shape, tree.maps.shape, seen.inputs[:, :-1]
    raw = Cells(np.zeros((k, 0)), tree.maps).outputs(seen.inputs)
    limited = np.clip(raw, -1.0, 1.0)
    error = limited + clip_slope * (raw - limited) - seen.actions.T
    losses = np.square(error).mean(axis=1)

    ways, turns = _ways(tree), _turns(tree, states, temperature)
    own = np.exp(ways @ turns)
    weighted = own * losses

    by_raw = (2 / (n * m)) * own[:, None] * error * np.where(raw == limited, 1.0, clip_slope)
    by_maps = (by_raw.reshape(k * m, n) @ seen.inputs).reshape(k, m, rows).transpose(0, 2, 1)
    by_left, by_right = np.split(ways.T @ weighted, 2)
    left, right = np.split(np.exp(turns), 2)
    by_logits = (by_right * left - by_left * right) / (n * temperature)
    return float(weighted.sum() / n), joined([by_logits @ states, -by_logits.sum(axis=1), by_maps])


# One cell after the other


@threadpool_limits.wrap(limits=1)
def greedy_cells(states: np.ndarray, actions: np.ndarray, size: int, task: Task, seed: int) -> VoronoiPolicy:
    """Voronoi cells grown as `ObliqueLinearTree` grows leaves, for states (n, d) and actions (n, m).

    The cell whose best oblique split lowers the squared error most gets two codewords instead of its own, one on each
    side of the hyperplane, from the best of `pairs`. Then all states go to their nearest codewords, and all maps are
    fitted again by least squares. Nothing is moved later. Distances are Euclidean, of standardised states. There are
    fewer cells where no split gains anything.
    """
    frame, d, m = Frame.of(task, states), states.shape[1], actions.shape[1]
    points, least = frame.inputs(states)[:, :-1], 1e-9 * np.square(actions).sum()
    tree = ObliqueLinearTree(states, actions, leaves=1, task=task, seed=seed)  # for its search for a split

    def fitted(codewords: np.ndarray) -> VoronoiPolicy:
        cells = Cells(codewords, np.zeros((len(codewords), d + 1, m)))
        return refit(frame.policy(cells), states, actions)

    codewords = points.mean(axis=0)[None]
    policy = fitted(codewords)
    while len(codewords) < size:
        own = policy.cells(states)
        splits = {i: tree.split(points[own == i], actions[own == i]) for i in np.unique(own)}
        i = max(splits, key=lambda one: splits[one].gain)
        if splits[i].gain <= least:
            break
        others = np.delete(codewords, i, axis=0)
        found = [np.vstack([others, pair]) for pair in pairs(codewords[i], points[own == i], splits[i])]
        made = [fitted(one) for one in found]
        best = int(np.argmin([action_error(one, frame, states, actions) for one in made]))
        codewords, policy = found[best], made[best]
    return policy


def pairs(codeword: np.ndarray, points: np.ndarray, split: Split) -> list[np.ndarray]:
    """Pairs of codewords (2, d) that may stand for one, left and right of the hyperplane of `split`.

    The means of the `points` (n, d) on either side; the codeword with its mirror image across the hyperplane, and
    either mean with its own: then the border between the two is the hyperplane.
    """
    right = split.right(points)
    means = np.array([points[~right].mean(axis=0), points[right].mean(axis=0)])
    mirrored = [np.array([one, _mirrored(one, split)]) for one in (codeword, *means)]
    return [means, *mirrored]


def _mirrored(point: np.ndarray, split: Split) -> np.ndarray:
    direction = split.direction / np.square(split.direction).sum()
    return point - 2 * (point @ split.direction - split.threshold) * direction
