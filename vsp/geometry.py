"""Distances, nearest codewords, and neighbouring cells.

A metric is a name that `scipy.spatial.distance.cdist` knows; `METRICS` maps the names used here to SciPy's and to the
order p of the kd-tree. All functions take codewords (k, d) already divided by the scale of the distance, and raise
ValueError for arrays of a wrong shape, numbers that are not finite, no codewords, or a metric of another name.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay, cKDTree
from scipy.spatial.distance import cdist

from .checks import check_array, check_choice

METRICS = {"manhattan": ("cityblock", 1), "euclidean": ("euclidean", 2), "chebyshev": ("chebyshev", np.inf)}
LOOKUP = "manhattan"  # the distance that finds a state's cell
KDTREE_FROM = 512  # codewords from which the kd-tree is faster in a few dimensions; see `vsp.beyond.benchmarks.lookup`
WITNESSES = 4096  # points that look for touching cells


def distances(states: np.ndarray, codewords: np.ndarray, metric: str = LOOKUP) -> np.ndarray:
    """Distance of every state (n, d) to every codeword (k, d). (n, k)"""
    codewords, states = _checked(codewords, states, metric)
    return cdist(states, codewords, METRICS[metric][0])


def nearest(
    codewords: np.ndarray, states: np.ndarray, metric: str = LOOKUP, *, kdtree: bool | None = None
) -> np.ndarray:
    """Index of the nearest codeword (k, d) of each state (n, d); of equally near ones the lowest. (n,)

    Paper, Algorithm 1 line 6: kd-tree(C, s_t). Comparing with all codewords gives the same indices and is faster for
    the few dozen of the paper; `kdtree` says which way to take, None: the faster one.
    """
    codewords, states = _checked(codewords, states, metric)
    return look_up(codewords, states, metric, kdtree=kdtree)


def look_up(
    codewords: np.ndarray, states: np.ndarray, metric: str = LOOKUP, *, kdtree: bool | None = None
) -> np.ndarray:
    """`nearest` for arrays that were checked before: a distillation and a policy ask thousands of times."""
    kind, order = METRICS[metric]
    if len(codewords) == 1 or not (len(codewords) >= KDTREE_FROM if kdtree is None else kdtree):
        return cdist(states, codewords, kind).argmin(axis=1)
    gaps, index = cKDTree(codewords).query(states, k=2, p=order)
    index = index[:, 0]
    tied = np.isclose(gaps[:, 0], gaps[:, 1], rtol=1e-12, atol=0)  # the tree answers ties in any order
    index[tied] = cdist(states[tied], codewords, kind).argmin(axis=1)
    return index


def all_differ(points: np.ndarray) -> bool:
    """Whether no two of `points` (n, d) are equal."""
    return len(set(map(tuple, points.tolist()))) == len(points)


def delaunay_neighbours(codewords: np.ndarray) -> np.ndarray:
    """Which codewords share an edge of the Euclidean Delaunay triangulation. (k, k) bool, symmetric, diagonal False.

    Qhull refuses points in a line or plane, so they are first projected onto the flat they span; up to r + 1 points in
    r dimensions are all neighbours. Raises ValueError for duplicate codewords: Qhull leaves them without neighbours.
    """
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


def lookup_neighbours(codewords: np.ndarray, low: np.ndarray, high: np.ndarray, metric: str = LOOKUP) -> np.ndarray:
    """Which cells touch inside the box [low, high] under the look-up's metric. (k, k) bool, symmetric.

    The witnesses are an unscrambled Halton sequence, so the answer is always the same. They fill the box, where a task
    may hardly ever be: see `visited_neighbours`.
    """
    from scipy.stats import qmc

    d = check_codewords(codewords).shape[1]
    low, high = check_array("low", low, (d,)), check_array("high", high, (d,))
    if not (low < high).all():
        raise ValueError(f"the box is {low.tolist()} to {high.tolist()}, expected each low below its high")
    points = qmc.scale(qmc.Halton(len(low), scramble=False).random(WITNESSES), low, high)
    return visited_neighbours(codewords, points, metric)


def visited_neighbours(codewords: np.ndarray, witnesses: np.ndarray, metric: str = LOOKUP) -> np.ndarray:
    """Which cells touch where `witnesses` (n, d) are, under the look-up's metric. (k, k) bool, symmetric.

    Two cells are neighbours when some witness has their codewords as its two nearest (Martinetz & Schulten 1994), for
    any metric and dimension. Of a box's points some lie where no state ever is, off the circle that the cosine and
    sine of an angle fill, off the curves that episodes follow, and there cells meet that have nothing to do with each
    other; the more dimensions, the more such points, and some boxes have no limits. States that a teacher visited say
    which cells touch where the policy is asked to act. A border that none of them is near is missed; up to two
    codewords are neighbours.
    """
    codewords, witnesses = _checked(codewords, witnesses, metric)
    k = len(codewords)
    if k <= 2:
        return ~np.eye(k, dtype=bool)
    return _adjacency(k, np.argpartition(distances(witnesses, codewords, metric), 1, axis=1)[:, :2])


def check_codewords(codewords: np.ndarray) -> np.ndarray:
    """`codewords` (k, d) in float64. Raises ValueError unless they are finite and there is at least one."""
    codewords = check_array("codewords", codewords, (-1, -1))
    if not codewords.size:
        raise ValueError(f"codewords have shape {codewords.shape}, expected at least one codeword")
    return codewords


def _checked(codewords: np.ndarray, states: np.ndarray, metric: str) -> tuple[np.ndarray, np.ndarray]:
    check_choice("metric", metric, METRICS)
    codewords = check_codewords(codewords)
    return codewords, check_array("states", states, (-1, codewords.shape[1]))


def _flatten(points: np.ndarray) -> np.ndarray:
    """Coordinates of `points` (k, d) in the flat of rank r that they span. (k, r)"""
    centred = points - points.mean(axis=0)
    _, singular, axes = np.linalg.svd(centred, full_matrices=False)
    rank = max(1, int((singular > 1e-9 * max(singular[0], 1e-300)).sum()))
    return points if rank == points.shape[1] else centred @ axes[:rank].T


def _triangulated(points: np.ndarray) -> np.ndarray:
    """Pairs of `points` (k, r) that share an edge. (e, 2)

    What Qhull leaves out because of rounding is looked at again from the middle, where there is less of it; what then
    still lies on another point is the neighbour of that one.
    """
    found = Delaunay(points)
    if len(found.coplanar):
        found = Delaunay(points - points.mean(axis=0))
    starts, others = found.vertex_neighbor_vertices
    edges = np.column_stack([np.repeat(np.arange(len(points)), np.diff(starts)), others])
    return np.concatenate([edges, found.coplanar[:, [0, 2]]])


def _adjacency(k: int, edges: np.ndarray) -> np.ndarray:
    graph = np.zeros((k, k), dtype=bool)
    graph[edges[:, 0], edges[:, 1]] = graph[edges[:, 1], edges[:, 0]] = True
    return graph
