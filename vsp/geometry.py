"""Distances, nearest codewords, and neighbouring cells.

A distance is a `Metric`; those in `METRICS` are also known by name. All functions take codewords (k, d) that are
already divided by the scale of the distance. They raise ValueError for arrays of a wrong shape, numbers that are not
finite, no codewords, or an unknown metric.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree
from scipy.spatial.distance import cdist

from .checks import check_array, check_choice, check_number

KDTREE_FROM = 512  # codewords from which the kd-tree is faster in low dimensions; see tests/bench
WITNESSES = 4096  # number of points that test which cells touch


@dataclass(frozen=True)
class Metric:
    """A distance between a state and a codeword, in every language in which a policy acts.

    `order` is the p of a Minkowski distance, numpy.inf for the largest difference; code in C, Python and JavaScript
    follows from it. Another distance is a sum over the inputs: `between(states, codewords)` returns (n, k) for arrays
    (n, d) and (k, d). `term` is the code of one input's share in terms of `gap`, the difference there, valid in C and
    Python as `PolicyClass.code` is. Without it exports refuse the metric by its name, and the explorer always does.
    Raises ValueError unless there is either a positive order or a function."""

    name: str
    order: float | None = None
    between: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    term: str = ""

    def __post_init__(self) -> None:
        if (self.order is None) == (self.between is None):
            raise ValueError(f"metric {self.name!r} has order {self.order!r}, expected either an order or `between`")
        if self.order not in (None, np.inf):
            check_number(f"the order of metric {self.name!r}", self.order, least=1)

    def distances(self, states: np.ndarray, codewords: np.ndarray) -> np.ndarray:
        """Distance of every state (n, d) to every codeword (k, d), without checks. (n, k)"""
        if self.between is not None:
            return self.between(states, codewords)
        if self.order in _KINDS:
            return cdist(states, codewords, _KINDS[self.order])
        return cdist(states, codewords, "minkowski", p=self.order)

    @property
    def code(self) -> tuple[str, str]:
        """One input's share in the distance as code of `gap`, and the root of their sum as code of `distance`.

        Both are valid in C and Python; of the order inf, shares are not added but their maximum is taken. Raises
        ValueError for a metric without code."""
        if self.order is None:
            if not self.term:
                raise ValueError(f"metric {self.name!r} has no code, expected its `term`: it cannot be exported")
            return self.term, "distance"
        if self.order == 2:
            return "gap * gap", "sqrt(distance)"
        if self.order in (1, np.inf):
            return "fabs(gap)", "distance"
        return f"pow(fabs(gap), {float(self.order)!r})", f"pow(distance, 1.0 / {float(self.order)!r})"


_KINDS = {1: "cityblock", 2: "euclidean", np.inf: "chebyshev"}  # SciPy's names, by order
METRICS = {name: Metric(name, order) for name, order in (("manhattan", 1), ("euclidean", 2), ("chebyshev", np.inf))}
LOOKUP = "manhattan"  # the paper's distance, the default of `Config.metric`


def metric_of(metric: str | Metric) -> Metric:
    """Return the metric of this name, or a `Metric` as it is. Raises ValueError for an unknown name."""
    if isinstance(metric, Metric):
        return metric
    check_choice("metric", metric, METRICS)
    return METRICS[metric]


def distances(states: np.ndarray, codewords: np.ndarray, metric: str | Metric = LOOKUP) -> np.ndarray:
    """Distance of every state (n, d) to every codeword (k, d). (n, k)"""
    metric, codewords, states = _checked(codewords, states, metric)
    return metric.distances(states, codewords)


def nearest(codewords: np.ndarray, states: np.ndarray, metric: str | Metric = LOOKUP) -> np.ndarray:
    """Index of the nearest codeword (k, d) of each state (n, d); the lowest index if several are equally near. (n,)

    Paper, Algorithm 1 line 6: kd-tree(C, s_t). Brute force gives the same indices and is faster for the few dozen
    codewords of the paper. So the kd-tree is used for `KDTREE_FROM` codewords or more."""
    metric, codewords, states = _checked(codewords, states, metric)
    return look_up(codewords, states, metric)


def look_up(codewords: np.ndarray, states: np.ndarray, metric: Metric) -> np.ndarray:
    """`nearest` without checks, for arrays checked before: a distillation and a policy call it thousands of times."""
    if len(codewords) < KDTREE_FROM or metric.order is None:
        return metric.distances(states, codewords).argmin(axis=1)
    gaps, index = cKDTree(codewords).query(states, k=2, p=metric.order)
    index = index[:, 0]
    tied = np.isclose(gaps[:, 0], gaps[:, 1], rtol=1e-12, atol=0)  # the tree returns ties in any order
    index[tied] = metric.distances(states[tied], codewords).argmin(axis=1)
    return index


def all_differ(points: np.ndarray) -> bool:
    """Whether no two of `points` (n, d) are equal."""
    return len(set(map(tuple, points.tolist()))) == len(points)


def delaunay_neighbours(codewords: np.ndarray) -> np.ndarray:
    """Which codewords share an edge of the Euclidean Delaunay triangulation. (k, k) bool, symmetric, diagonal False.

    Qhull rejects points on a line or plane, so they are first projected onto the affine subspace that they span. Up to
    r + 1 points in r dimensions are all neighbours. Raises ValueError for duplicate codewords, because Qhull
    leaves them without neighbours."""
    codewords = check_codewords(codewords)
    k = len(codewords)
    if not all_differ(codewords):
        raise ValueError(f"{k} codewords, expected all to differ: {codewords.tolist()}")
    points = _flatten(codewords)
    rank = points.shape[1]
    if k <= rank + 1:
        return ~np.eye(k, dtype=bool)
    if rank == 1:
        order = points[:, 0].argsort()
        edges = np.column_stack([order[:-1], order[1:]])
    else:
        edges = _triangulated(points)
    return _adjacency(k, edges)


def lookup_neighbours(
    codewords: np.ndarray, low: np.ndarray, high: np.ndarray, metric: str | Metric = LOOKUP
) -> np.ndarray:
    """Which cells touch inside the box [low, high] under the look-up's metric. (k, k) bool, symmetric.

    Two cells are neighbours when some witness has their codewords as its two nearest (Martinetz & Schulten 1994), for
    any metric and dimension. The witnesses are an unscrambled Halton sequence, so the result is deterministic. They
    fill the box, much of which a task may never visit. A border without a witness near it is missed."""
    from scipy.stats import qmc

    k, d = check_codewords(codewords).shape
    low, high = check_array("low", low, (d,)), check_array("high", high, (d,))
    if not (low < high).all():
        raise ValueError(f"the box is {low.tolist()} to {high.tolist()}, expected each low below its high")
    witnesses = qmc.scale(qmc.Halton(d, scramble=False).random(WITNESSES), low, high)
    gaps = distances(witnesses, codewords, metric)
    if k <= 2:
        return ~np.eye(k, dtype=bool)
    return _adjacency(k, np.argpartition(gaps, 1, axis=1)[:, :2])


def check_codewords(codewords: np.ndarray) -> np.ndarray:
    """`codewords` (k, d) in float64. Raises ValueError unless they are finite and there is at least one."""
    codewords = check_array("codewords", codewords, (-1, -1))
    if not codewords.size:
        raise ValueError(f"codewords have shape {codewords.shape}, expected at least one codeword")
    return codewords


def _checked(codewords: np.ndarray, states: np.ndarray, metric: str | Metric) -> tuple[Metric, np.ndarray, np.ndarray]:
    metric, codewords = metric_of(metric), check_codewords(codewords)
    return metric, codewords, check_array("states", states, (-1, codewords.shape[1]))


def _flatten(points: np.ndarray) -> np.ndarray:
    """Coordinates of `points` (k, d) in the affine subspace of rank r that they span. (k, r)"""
    centred = points - points.mean(axis=0)
    _, singular, axes = np.linalg.svd(centred, full_matrices=False)
    rank = max(1, int((singular > 1e-9 * max(singular[0], 1e-300)).sum()))
    return points if rank == points.shape[1] else centred @ axes[:rank].T


def _triangulated(points: np.ndarray) -> np.ndarray:
    """Pairs of `points` (k, r) that share an edge. (e, 2)

    If Qhull leaves points out because of rounding, the points are centred, which reduces rounding, and triangulated
    again. A point that is still left out becomes a neighbour of its nearest vertex."""
    mesh = Delaunay(points)
    if len(mesh.coplanar):
        mesh = Delaunay(points - points.mean(axis=0))
    starts, others = mesh.vertex_neighbor_vertices
    edges = np.column_stack([np.repeat(np.arange(len(points)), np.diff(starts)), others])
    return np.concatenate([edges, mesh.coplanar[:, [0, 2]]])


def _adjacency(k: int, edges: np.ndarray) -> np.ndarray:
    graph = np.zeros((k, k), dtype=bool)
    graph[edges[:, 0], edges[:, 1]] = graph[edges[:, 1], edges[:, 0]] = True
    return graph
