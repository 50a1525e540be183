"""Trees to compare with the Voronoi partition, fitted to states (n, d) and actions (n, m) of a teacher: CART, and model
trees with axis-aligned or oblique splits."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from vsp import get_task
from vsp.rollouts import standard
from vsp.subpolicies import linear_outputs

CUTS = 255  # quantiles of a node at which a split may lie
# Of oblique splits: states for comparing directions, and quantiles; directions per round; rounds
_SEARCHED, _FEW_CUTS, _TRIED, _ROUNDS = 2000, 31, 12, 4


@dataclass(frozen=True)
class Split:
    """A hyperplane, and the reduction of its node's squared error."""

    gain: float
    direction: np.ndarray  # (d,)
    threshold: float

    def right(self, inputs: np.ndarray) -> np.ndarray:
        """Tell which of the inputs (n, d) lie beyond the hyperplane. (n,)"""
        return inputs @ self.direction > self.threshold


@dataclass(eq=False)
class Node:
    """A node of a `LinearTree`, a leaf if it has no children."""

    rows: np.ndarray  # the training data that reach it
    split: Split | None = None  # the best split found
    children: tuple[int, ...] = ()  # left and right


class LinearTree:
    """A model tree: splits along the axes and a least-squares map in each leaf (RETIS, Karalič 1992). It has at most
    `leaves` leaves and is grown best split first on standardised states. A split lies at one of `CUTS` quantiles of its
    node and is judged by the error of a map on each side, which keeps at least twice as many states as a map has rows.
    `constant` fits one action per leaf instead of a map."""

    def __init__(self, states: np.ndarray, actions: np.ndarray, *, leaves: int, task: str, constant: bool = False):
        self.task, self.constant = get_task(task), constant
        self.centre, self.scale = standard(states)
        inputs, self.nodes = self.inputs(states), [Node(np.arange(len(states)))]
        least = 1e-9 * np.square(actions).sum()  # smaller gains are rounding errors
        for _ in range(leaves - 1):
            for node in (ends := self.ends):
                node.split = node.split or self.split(inputs[node.rows], actions[node.rows])
            best = max(ends, key=lambda node: node.split.gain)
            if best.split.gain <= least:
                break
            right, n = best.split.right(inputs[best.rows]), len(self.nodes)
            best.children = (n, n + 1)
            self.nodes += [Node(best.rows[side]) for side in (~right, right)]
        rows = np.column_stack([np.zeros_like(inputs) if constant else inputs, np.ones(len(inputs))])
        maps = [np.linalg.lstsq(rows[node.rows], actions[node.rows], rcond=None)[0] for node in self.nodes]
        self.maps = np.array(maps)  # (nodes, d + 1, m)

    def __len__(self) -> int:
        return len(self.ends)

    @property
    def ends(self) -> list[Node]:
        """The leaves."""
        return [node for node in self.nodes if not node.children]

    def split(self, inputs: np.ndarray, actions: np.ndarray) -> Split:
        """Find the best split of a node along an axis."""
        return _stump(inputs, actions, np.eye(inputs.shape[1]), cuts=CUTS, constant=self.constant)

    def inputs(self, states: np.ndarray) -> np.ndarray:
        """Standardised states. (n, d)"""
        return (states - self.centre) / self.scale

    def apply(self, inputs: np.ndarray) -> np.ndarray:
        """The leaf of each of the inputs (n, d), as an index of `nodes`. (n,)"""
        nodes = np.zeros(len(inputs), dtype=np.intp)
        for i, node in enumerate(self.nodes):  # parents come before their children
            if node.children:
                here = np.flatnonzero(nodes == i)
                nodes[here] = np.take(node.children, node.split.right(inputs[here]))
        return nodes

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), limited to the action box."""
        inputs = self.inputs(obs)
        raw = linear_outputs(inputs, self.maps[self.apply(inputs)])
        return np.clip(raw, self.task.action_low, self.task.action_high), None


def _stump(inputs: np.ndarray, actions: np.ndarray, directions: np.ndarray, *, cuts: int, constant: bool) -> Split:
    """Find the best split along one of `directions` (c, d), with a map on each side, from the moments between cuts."""
    features = np.column_stack([inputs[:, : 0 if constant else None], np.ones(len(inputs))])
    m, rows = actions.shape[1], np.column_stack([features, actions])
    (whole,), best = _squared_errors((rows.T @ rows)[None], m), Split(0.0, directions[0], 0.0)
    for direction in directions:
        places = inputs @ direction
        borders = np.unique(np.quantile(places, np.linspace(0, 1, cuts + 2)[1:-1], method="lower"))
        parts = np.searchsorted(borders, places)
        bounds = np.cumsum(np.bincount(parts, minlength=len(borders) + 1))[:-1]
        moments = [part.T @ part for part in np.split(rows[np.argsort(parts, kind="stable")], bounds)]
        left, total = np.cumsum(moments[:-1], axis=0), np.sum(moments, axis=0)
        errors = _squared_errors(left, m) + _squared_errors(total - left, m)
        fewest = np.minimum(bounds, len(rows) - bounds)
        gains = np.where(fewest >= 2 * features.shape[1], whole - errors, 0.0)
        if gains.max() > best.gain:
            best = Split(gains.max(), direction, borders[gains.argmax()])
    return best


def _squared_errors(moments: np.ndarray, m: int) -> np.ndarray:
    """Return the squared error of the best linear map, from sums of products of inputs and m actions (c, p, p). (c,)"""
    q = moments.shape[1] - m
    # A small ridge term, for variables that are constant in a node
    inputs = moments[:, :q, :q] + 1e-9 * np.maximum(moments[:, q - 1, q - 1, None, None], 1) * np.eye(q)
    maps = np.linalg.solve(inputs, moments[:, :q, q:])
    return np.trace(moments[:, q:, q:], axis1=1, axis2=2) - (maps * moments[:, :q, q:]).sum(axis=(1, 2))


class ObliqueLinearTree(LinearTree):
    """A model tree with oblique splits, the tree here that is most similar to linear maps in Voronoi cells. As in SPYCT
    (Stepišnik & Kocev 2021), which Engelhardt et al. (2023) fit to a teacher, a hyperplane separates two clusters of a
    node's actions, here by k-means and discriminant analysis. The axes, the principal components and the directions of
    least squares compete with it. The best direction is perturbed at random (OC1, Murthy et al. 1994). Splits are
    judged by the maps on both sides, at one of `cuts` quantiles along the direction that is best at a few of them."""

    def __init__(
        self, states: np.ndarray, actions: np.ndarray, *, leaves: int, task: str, seed: int, constant: bool = False,
        cuts: int = CUTS,
    ):  # fmt: skip
        self._rng, self._cuts = np.random.default_rng(seed), cuts
        super().__init__(states, actions, leaves=leaves, task=task, constant=constant)

    def split(self, inputs: np.ndarray, actions: np.ndarray) -> Split:
        """Find the best split among directions of several kinds; perturb the best one in rounds, by less in each."""
        rng, rows = self._rng, self._rng.permutation(len(inputs))[:_SEARCHED]
        stump = partial(_stump, inputs[rows], actions[rows], cuts=_FEW_CUTS, constant=self.constant)
        best = stump(_directions(inputs[rows], actions[rows], rng))
        for size in np.geomspace(1.0, 0.1, _ROUNDS):
            moved = _unit(best.direction + size * rng.normal(size=(_TRIED, inputs.shape[1])))
            best = stump(np.vstack([best.direction, moved]))
        return _stump(inputs, actions, best.direction[None], cuts=self._cuts, constant=self.constant)


def _directions(inputs: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return directions of unit length along which a node may be split. (c, d)"""
    from sklearn.cluster import KMeans

    centred, d = inputs - inputs.mean(axis=0), inputs.shape[1]
    covariance = centred.T @ centred + 1e-6 * len(inputs) * np.eye(d)
    maps = np.linalg.solve(covariance, centred.T @ actions)
    directions = [np.eye(d), np.linalg.eigh(covariance)[1].T, maps.T]
    if len(np.unique(actions, axis=0)) > 1:
        cluster = KMeans(2, n_init=1, random_state=int(rng.integers(2**31))).fit_predict(actions)
        gap = inputs[cluster == 1].mean(axis=0) - inputs[cluster == 0].mean(axis=0)
        directions.append(np.linalg.solve(covariance, gap)[None])
    return _unit(np.vstack(directions))


def _unit(directions: np.ndarray) -> np.ndarray:
    """Scale directions to length 1; a zero vector becomes the first axis."""
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    return np.where(length > 0, directions / np.where(length > 0, length, 1.0), np.eye(directions.shape[1])[0])
