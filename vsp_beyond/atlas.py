"""The atlas of a network: the convex pieces on which it is linear, and how far a policy of few cells is from it.

n polygons are an array of corners (n, k, 2), in order around each; one with fewer corners repeats its last. An affine
function is two slopes and its value at 0 (3,). All is float64 with the weights as stored; bounds are rounded outwards.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vsp.policy import VoronoiPolicy
from vsp.teachers import Teacher

KNOTS = np.array([-1e30, *np.linspace(-4.0, 4.0, 81), 1e30])  # of the output before the tanh
LEAST = 1e-12  # a function that passes 0 by less within a polygon does not cut it
OUTWARD = 1e-11  # more than float64 loses in a tanh, chord or tangent, and relative to its size in a policy's map
SLIVER = 1e-12  # more than an edge is from the line along which it was cut, relative to coordinates
ONE = np.eye(3)[2]  # the affine function 1


class Pieces(NamedTuple):
    """n polygons that fill the box of a task; on each, the network before its tanh is one affine function."""

    teacher: Teacher
    corners: np.ndarray  # (n, k, 2)
    maps: np.ndarray  # (n, m, 3) of the outputs before the tanh
    rounding: float  # bounds the error of `maps` in their pieces, against the network without any rounding


class Region(NamedTuple):
    """Polygons that touch, and hold states in which an action is farther from the network's than some distance."""

    corners: np.ndarray  # (p, k, 2)
    share: float  # of the box, at most
    greatest: tuple[float, float]  # bounds of the greatest distance


class Comparison(NamedTuple):
    """p polygons that fill the box; on each, the network's actions minus the policy's lie between two affine maps."""

    corners: np.ndarray  # (p, k, 2)
    bounds: np.ndarray  # (2, p, m, 3) below and above the difference

    def within(self, distance: float) -> tuple[float, float]:
        """Return the share of the box where every action is certainly within `distance`, and the most it can be."""
        total, edges = areas(self.corners).sum(), self.corners - np.roll(self.corners, 1, axis=1)
        slivers = 2 * SLIVER * abs(self.corners).max() * np.linalg.norm(edges, axis=2).sum()
        possible, certain = (areas(self._farther(distance, both)[0]).sum() for both in (self.bounds, self.bounds[::-1]))
        return 1 - (possible + slivers) / total, 1 - (certain - slivers) / total

    def farther(self, distance: float) -> list[Region]:
        """Return all regions outside of which every action is within `distance`, the largest first."""
        corners, of = self._farther(distance, self.bounds)
        pairs = cKDTree(corners.reshape(-1, 2)).query_pairs(1e-9, output_type="ndarray") // corners.shape[1]
        touching = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(corners),) * 2)  # which share a corner
        region, share = connected_components(touching)[1], areas(corners) / areas(self.corners).sum()
        low, high = values(self.bounds[:, of, :, None], corners[:, None])  # (p, m, k)
        least, most = (np.maximum(one, -other).max(axis=(1, 2)) for one, other in ((low, high), (high, low)))
        chosen = [region == i for i in np.argsort(-np.bincount(region, share))]
        return [Region(corners[i], share[i].sum(), (least[i].max(), most[i].max())) for i in chosen]

    def _farther(self, distance: float, bounds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return disjoint polygons in which a first bound is below -`distance` or a second above it, for some action,
        and the polygon of `corners` from which each comes."""
        corners, of, far = self.corners, np.arange(len(self.corners)), np.zeros(len(self.corners), dtype=bool)
        for action in range(bounds.shape[2]):
            for sign, bound in zip((-1, 1), bounds):
                corners, parents, beyond = cut(corners, sign * values(bound[of, action, None], corners) - distance)
                of, far = of[parents], far[parents] | beyond
        return corners[far], of[far]


def pieces_of(teacher: Teacher) -> Pieces:
    """Cut the box of the teacher's task along the border of every unit of its network, layer by layer.

    Raises ValueError unless the network sees two raw observations, and has rectified units (ReLU) and a tanh."""
    task, actor = teacher.task, teacher.actor
    form = (len(task.low), actor.activation, actor.squashed, actor.clip_mean, bool(teacher.normalization))
    if form != (2, "ReLU", True, np.inf, False):
        raise ValueError(f"{task.name}: expected a network of two raw inputs with ReLU and tanh, got {form}")
    layers = [(weight.astype(np.float64), bias.astype(np.float64)) for weight, bias in teacher.layers]
    (a, b), (c, d) = task.low, task.high
    corners, maps = np.array([[[a, b], [c, b], [c, d], [a, d]]], dtype=np.float64), np.eye(3)[None, :, :2]  # (n, 3, w)
    for weight, bias in layers[:-1]:
        maps, of = maps @ weight + bias * ONE[:, None], np.arange(len(corners))
        for unit in range(len(bias)):
            corners, parents, _ = cut(corners, values(maps[of, None, :, unit], corners), LEAST)
            of = of[parents]
        maps = maps[of] * (values(maps[of].swapaxes(1, 2), corners.mean(axis=1, keepdims=True)) > 0)[:, None]
    outputs = maps @ layers[-1][0] + layers[-1][1] * ONE[:, None]
    return Pieces(teacher, corners, outputs.swapaxes(1, 2), _rounding(layers, task.low, task.high))


def compare(pieces: Pieces, policy: VoronoiPolicy) -> Comparison:
    """Bound the difference between the actions of a network and of a policy, over the box of their task.

    Pieces are cut along borders of cells, at limits of actions, and at `KNOTS`, between which the tanh lies between a
    chord and a tangent. Raises ValueError unless the policy has the network's task, linear maps, and the Euclidean or
    the Manhattan distance."""
    policy.check_linear()
    task = pieces.teacher.task
    if policy.task.name != task.name or policy.metric not in ("euclidean", "manhattan"):
        raise ValueError(f"expected a policy of {task.name} by the Euclidean or Manhattan distance, got {policy!r}")
    corners, index = _in_cells(pieces, policy)
    for action, limits in enumerate(np.column_stack([task.action_low, task.action_high])):
        for i, maps, levels in ((0, pieces.maps[:, action], KNOTS), (1, policy.coefficients[:, :, action], limits)):
            corners, of = _cut_at(levels, maps[index[i]], corners)
            index = index[:, of]
    low, high, middles = task.action_low[:, None], task.action_high[:, None], corners.mean(axis=1, keepdims=True)
    linear, output, half = policy.coefficients[index[1]].swapaxes(1, 2), pieces.maps[index[0]], (high - low) / 2
    raw = values(linear, middles)[..., None]  # (p, m, 1); linear and output: (p, m, 3)
    clipped = np.where(raw < low, low * ONE, np.where(raw > high, high * ONE, linear))
    interval = KNOTS.searchsorted(values(output, middles))[..., None]
    (left, right), middle = KNOTS[[interval - 1, interval]], KNOTS[[interval - 1, interval]].mean(axis=0)
    slope = (np.tanh(right) - np.tanh(left)) / (right - left)
    chord = slope * output + (np.tanh(left) - slope * left) * ONE
    slope = 1 - np.tanh(middle) ** 2
    tangent = slope * output + (np.tanh(middle) - slope * middle) * ONE
    sums = 1 + values(abs(clipped), abs(middles) + 1)[..., None]  # at least their size in the polygon
    slack = (half * (2 * pieces.rounding + OUTWARD) + OUTWARD * sums) * ONE  # also if z passes a knot by its rounding
    lines = (np.where((middle > 0) == concave, chord, tangent) for concave in (True, False))  # it is concave above 0
    bounds = [half * line + (high + low) / 2 * ONE - clipped + sign * slack for sign, line in zip((-1, 1), lines)]
    return Comparison(corners, np.stack(bounds))


def values(maps: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the affine functions `maps` (..., 3) at `points` (..., 2)."""
    return maps[..., 0] * points[..., 0] + maps[..., 1] * points[..., 1] + maps[..., 2]


def cut(corners: np.ndarray, heights: np.ndarray, least: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut polygons (n, k, 2) where a function, `heights` (n, k) at the corners, passes 0 by more than `least` on both
    sides (Sutherland and Hodgman 1974). Return all polygons, from which each comes, and whether it is above 0."""
    low, high = heights.min(axis=1), heights.max(axis=1)
    crossed = (low < -least) & (high > least)
    whole, edges, here = np.flatnonzero(~crossed), corners[crossed], heights[crossed]
    there, after = (np.roll(array, -1, axis=1) for array in (here, edges))
    passed, new, (n, k) = here * there < 0, np.ones(here.shape, dtype=bool), here.shape
    new[:, 1:] = (edges[:, 1:] != edges[:, :-1]).any(axis=2)  # a repeated corner counts once
    share = (here / np.where(passed, here - there, 1.0))[..., None]
    points, polygons = np.stack([edges, edges + share * (after - edges)], axis=2).reshape(n, 2 * k, 2), [corners[whole]]
    for sign in (1, -1):
        kept = np.stack([(sign * here >= 0) & new, passed], axis=2).reshape(n, 2 * k)
        places = np.minimum(np.arange(kept.sum(axis=1).max(initial=1)), kept.sum(axis=1, keepdims=True) - 1)
        order = np.take_along_axis(np.argsort(~kept, axis=1, kind="stable"), places, axis=1)
        polygons.append(np.take_along_axis(points, order[..., None], axis=1))
    k = max(some.shape[1] for some in polygons)
    wide = [np.pad(some, ((0, 0), (0, k - some.shape[1]), (0, 0)), mode="edge") for some in polygons]
    above = np.concatenate([(high > -low)[whole], np.ones(n, dtype=bool), np.zeros(n, dtype=bool)])
    return np.concatenate(wide), np.concatenate([whole, *[np.flatnonzero(crossed)] * 2]), above


def areas(corners: np.ndarray) -> np.ndarray:
    """Return the area of each polygon (n, k, 2), by the shoelace formula. (n,)"""
    x, y = np.moveaxis(corners - corners[:, :1], 2, 0)  # from a corner, so that small areas keep their digits
    return abs((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)) / 2


def _in_cells(pieces: Pieces, policy: VoronoiPolicy) -> tuple[np.ndarray, np.ndarray]:
    """Cut the pieces along the borders of the cells. Return the polygons, and piece and cell of each (2, p)."""
    corners, piece, words = pieces.corners, np.arange(len(pieces.corners)), policy.codewords
    manhattan = policy.metric == "manhattan"
    for axis in (0, 1) if manhattan else ():
        corners, of = _cut_at(np.unique(words[:, axis]), np.tile(np.eye(3)[axis], (len(corners), 1)), corners)
        piece = piece[of]
    middles = corners.mean(axis=1)[:, None]  # without what is the same for all codewords, distances are affine:
    slopes = np.sign(middles - words) / policy.scale if manhattan else 0 * middles - 2 * words / policy.scale**2
    offsets = -(slopes * words).sum(axis=2, keepdims=True) / (1 if manhattan else 2)
    distances, of = np.concatenate([slopes, offsets], axis=2), np.arange(len(corners))
    cell = np.zeros_like(of)
    for other in range(1, len(words)):  # which may be nearer than the nearest so far
        gap = (distances[of, cell] - distances[of, other])[:, None]
        corners, parents, nearer = cut(corners, values(gap, corners))
        of, cell = of[parents], np.where(nearer, other, cell[parents])
    return corners, np.stack([piece[of], cell])


def _cut_at(levels: np.ndarray, maps: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut polygons where their `maps` (n, 3) are at one of the sorted `levels`, in each pass at the middle one of those
    inside. Return the polygons, and from which each comes."""
    of, n = np.arange(len(corners)), 0
    while n < len(corners):
        heights, n = values(maps[of, None], corners), len(corners)
        first, last = levels.searchsorted([heights.min(axis=1) + LEAST, heights.max(axis=1) - LEAST])
        level = np.where(first < last, levels[np.minimum((first + last) // 2, len(levels) - 1)], np.inf)
        corners, parents, _ = cut(corners, heights - level[:, None], LEAST)
        of = of[parents]
    return corners, of


def _rounding(layers: list[tuple[np.ndarray, np.ndarray]], low: np.ndarray, high: np.ndarray) -> float:
    """Bound the error of the maps. A sum of n terms loses at most about n half units in the last place of the sum of
    their sizes (Higham 2002, section 3.1), each cut of an edge two; a unit may pass 0 by `LEAST` within a piece."""
    size, error = np.maximum(abs(low), abs(high)), np.zeros(2)  # of the inputs of a layer, over the box
    lost = 4 * sum(len(weight) for weight, _ in layers) * np.finfo(np.float64).eps
    for weight, bias in layers:
        size = size @ abs(weight) + abs(bias)
        error = error @ abs(weight) + lost * size + LEAST
    return float(error.max())
