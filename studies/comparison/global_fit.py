"""Separate the effect of the fit from that of the borders: what our cells owe to each.

Our cells differ from a tree with linear leaves (`ObliqueLinearTree`) by their borders, and by their fit of all numbers
together, not greedily. Here are the mixed combinations, a tree fitted together and cells grown greedily; and our cells,
fitted from as many random starts as the tree.
"""

from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from vsp import Policy, Task, VoronoiPolicy
from vsp.paper.baselines import refit
from vsp_beyond.few_cells import search
from vsp_beyond.few_cells.units import LabelledStates, ScaledCells, Scaling, joined, spread, temperature_unit

from ..rivals.trees import ObliqueLinearTree, Split
from .tuning import TunableTree, of_tree

N_RANDOM = 64  # random starts: divided by the size, but at least 8, since descents of few numbers are quick
N_GREEDY = 4  # additional descents, which start from greedy trees
HOT = ((range(0, 2), 12), (range(2, 6), 4))  # stages, and how many descents from random trees are kept after them
WARM = ((range(6, 12), 3), (range(12, search.N_STAGES), 1))  # the same, for these and the greedy trees together
FEW_CUTS = 31  # quantiles at which a greedy tree may be split: enough for a start, since descents move thresholds
CERTAIN = 40.0  # larger logits give shares of exactly 0 and 1 in float64


# All numbers together


@threadpool_limits.wrap(limits=1)
def global_cells(states: np.ndarray, actions: np.ndarray, size: int, task: Task, seed: int) -> VoronoiPolicy:
    """Return the cells with the least error on states (n, d) and actions (n, m) that `search.least_error` finds."""
    frame = Scaling.of(task, states)
    labelled = LabelledStates(frame.inputs(states), frame.outputs(actions))
    return frame.policy(search.least_error(labelled, size, random_starts(size), np.random.default_rng(seed)))


@threadpool_limits.wrap(limits=1)
def global_tree(states: np.ndarray, actions: np.ndarray, size: int, task: Task, seed: int) -> TunableTree:
    """Return the oblique tree with the least error on states (n, d) and actions (n, m) that descents find, as those of
    `search.least_error`: from random trees at a high temperature, from greedy ones at a lower one. They keep the
    structure of a tree, and fit directions, thresholds and maps together. If none is better, the best greedy tree is
    returned."""
    rng, frame = np.random.default_rng(seed), Scaling.of(task, states)
    some = spread(states / frame.scale, search.FEW, rng)

    def grown(kind: type[ObliqueLinearTree], n: int) -> list[TunableTree]:
        seeds = rng.integers(2**31, size=n).tolist()
        trees = [kind(states, actions, leaves=size, task=task, seed=s, cuts=FEW_CUTS) for s in seeds]
        return [of_tree(tree) for tree in trees]

    def error(tree: TunableTree) -> float:
        return action_error(tree, frame, states, actions)

    def kept(trees: list[TunableTree], rounds: tuple) -> list[TunableTree]:
        for stages, n_kept in rounds:
            ends = [descend(tree, states[some], actions[some], stages) for tree in trees]
            trees = sorted(ends, key=error)[:n_kept]
        return trees

    greedy = grown(ObliqueLinearTree, N_GREEDY)
    (best,) = kept(kept(grown(RandomTree, random_starts(size)), HOT) + greedy, WARM)
    last = descend(best, states, actions, search.LAST, n_iterations=search.N_LAST)
    return min([last, *greedy], key=error)


def random_starts(size: int) -> int:
    """Return how many descents start at random, for a policy with `size` cells or leaves."""
    return max(8, N_RANDOM // size)


class RandomTree(ObliqueLinearTree):
    """An oblique tree with random splits: each lies between two states of a leaf, more often of a leaf with many."""

    def split(self, inputs: np.ndarray, actions: np.ndarray) -> Split:
        """Return the border halfway between two random `inputs` (n, d), with a random gain."""
        left, right = inputs[self._rng.integers(len(inputs), size=2)]
        direction = (right - left) / (np.linalg.norm(right - left) or 1.0)
        gain = self._rng.random() * len(inputs) * (left != right).any()
        return Split(gain, direction, direction @ (left + right) / 2)


def action_error(policy: Policy, frame: Scaling, states: np.ndarray, actions: np.ndarray) -> float:
    """Return the mean squared difference of the policy's actions in states (n, d) from `actions` (n, m). Actions are in
    units of half their range."""
    return float(np.square(frame.outputs(policy.predict(states)[0]) - frame.outputs(actions)).mean())


def descend(
    tree: TunableTree, states: np.ndarray, actions: np.ndarray, stages: range,
    *, n_iterations: int = search.N_ITERATIONS,
) -> TunableTree:  # fmt: skip
    """Fit `tree` by L-BFGS on the expected loss, stage by stage, as `search.descend` fits cells. The temperature is in
    units of half a cell's width. This makes a border as soft as one between two codewords."""
    labelled = LabelledStates(tree.frame.inputs(states), tree.frame.outputs(actions))
    unit = 0.5 * np.sqrt(temperature_unit(labelled, len(tree)))
    for stage in stages:
        temperature, slope = unit * search.TEMPERATURES[stage], np.sqrt(search.TEMPERATURES[stage])
        bases = search.uncorrelated(labelled, shares(tree, labelled.states, temperature))
        about = {"labelled": labelled, "temperature": temperature, "clip_slope": search.CLIP_SLOPES[stage]}
        tree = search.least(partial(expected_loss, **about), tree, bases, slope, n_iterations)
    return tree


def shares(tree: TunableTree, states: np.ndarray, temperature: float) -> np.ndarray:
    """Return the share of each of `states` (n, d) that belongs to each leaf: (leaves, n). It is a product over the
    nodes on the path to the leaf, each factor a sigmoid of the distance beyond the threshold, in units of the
    temperature."""
    return np.exp(_ways(tree) @ _turns(tree, states, temperature))


def _ways(tree: TunableTree) -> np.ndarray:
    """Return which turns lead to each leaf, first the left turns, then the right turns: (leaves, 2 nodes)."""
    return np.hstack([tree.sides < 0, tree.sides > 0]).astype(np.float64)


def _turns(tree: TunableTree, states: np.ndarray, temperature: float) -> np.ndarray:
    """Return the log shares that turn left at each node, then those that turn right: (2 nodes, n)."""
    logits = np.clip((tree.directions @ states.T - tree.thresholds[:, None]) / temperature, -CERTAIN, CERTAIN)
    rest = np.log1p(np.exp(-np.abs(logits)))
    return np.vstack([-np.maximum(logits, 0.0) - rest, np.minimum(logits, 0.0) - rest])


def expected_loss(
    tree: TunableTree, labelled: LabelledStates, temperature: float, clip_slope: float
) -> tuple[float, np.ndarray]:
    """Return the mean squared error of the limited actions, weighted by each leaf's share of a state, and its gradient.
    This is `units.expected_loss` for trees. The gradient is with respect to `tree.vector`."""
    (n, m), (k, rows, _), states = labelled.actions.shape, tree.maps.shape, labelled.inputs[:, :-1]
    raw = ScaledCells(np.zeros((k, 0)), tree.maps).outputs(labelled.inputs)
    limited = np.clip(raw, -1.0, 1.0)
    error = limited + clip_slope * (raw - limited) - labelled.actions.T
    losses = np.square(error).mean(axis=1)

    ways, turns = _ways(tree), _turns(tree, states, temperature)
    leaf_shares = np.exp(ways @ turns)
    weighted = leaf_shares * losses

    by_raw = (2 / (n * m)) * leaf_shares[:, None] * error * np.where(raw == limited, 1.0, clip_slope)
    by_maps = (by_raw.reshape(k * m, n) @ labelled.inputs).reshape(k, m, rows).transpose(0, 2, 1)
    by_left, by_right = np.split(ways.T @ weighted, 2)
    left, right = np.split(np.exp(turns), 2)
    by_logits = (by_right * left - by_left * right) / (n * temperature)
    return float(weighted.sum() / n), joined([by_logits @ states, -by_logits.sum(axis=1), by_maps])


# One cell after the other


@threadpool_limits.wrap(limits=1)
def greedy_cells(states: np.ndarray, actions: np.ndarray, size: int, task: Task, seed: int) -> VoronoiPolicy:
    """Grow Voronoi cells as `ObliqueLinearTree` grows leaves, for states (n, d) and actions (n, m). Of the cell whose
    best oblique split lowers the squared error most, the codeword is replaced by the best of `pairs`, one on each side
    of the hyperplane; then all maps are refitted by least squares. Codewords never move later. Distances are Euclidean,
    between standardised states. A split of Voronoi cells may raise the error, for it moves other borders too. There are
    fewer than `size` cells if no split of a tree lowers the error."""
    frame, d, m = Scaling.of(task, states), states.shape[1], actions.shape[1]
    points, least = frame.inputs(states)[:, :-1], 1e-9 * np.square(actions).sum()
    tree = ObliqueLinearTree(states, actions, leaves=1, task=task, seed=seed)  # used only to search for splits

    def fitted(codewords: np.ndarray) -> VoronoiPolicy:
        empty = ScaledCells(codewords, np.zeros((len(codewords), d + 1, m)))
        return refit(frame.policy(empty), states, actions)

    codewords = points.mean(axis=0)[None]
    policy = fitted(codewords)
    while len(codewords) < size:
        cells = policy.cells(states)
        splits = {i: tree.split(points[cells == i], actions[cells == i]) for i in np.unique(cells)}
        i = max(splits, key=lambda cell: splits[cell].gain)
        if splits[i].gain <= least:
            break
        others = np.delete(codewords, i, axis=0)
        candidates = [np.vstack([others, pair]) for pair in pairs(codewords[i], points[cells == i], splits[i])]
        policies = [fitted(candidate) for candidate in candidates]
        best = int(np.argmin([action_error(each, frame, states, actions) for each in policies]))
        codewords, policy = candidates[best], policies[best]
    return policy


def pairs(codeword: np.ndarray, points: np.ndarray, split: Split) -> list[np.ndarray]:
    """Return pairs of codewords (2, d) that may replace `codeword`, left and right of the hyperplane of `split`. The
    first pair is the means of the `points` (n, d) on either side. The others are the codeword, or either mean, with its
    mirror image across the hyperplane: their border is the hyperplane itself."""
    right = split.right(points)
    means = np.array([points[~right].mean(axis=0), points[right].mean(axis=0)])
    mirrored = [np.array([point, _mirrored(point, split)]) for point in (codeword, *means)]
    return [means, *mirrored]


def _mirrored(point: np.ndarray, split: Split) -> np.ndarray:
    direction = split.direction / np.square(split.direction).sum()
    return point - 2 * (point @ split.direction - split.threshold) * direction
