"""Pieces and bounds, compared with what is known by hand, in exact arithmetic, or by counting in another way."""

from dataclasses import replace
from decimal import Decimal, getcontext
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS, network_teacher, random_policy

from vsp import VoronoiPolicy, get_task, show
from vsp.teachers import Teacher, load_teacher
from vsp.teachers.actors import Actor
from vsp.teachers.normalization import Normalization
from vsp_beyond import atlas


def network(*layers, task=SIMPLEGOAL, **options):
    return Teacher(Actor([(np.array(w, np.float32), np.array(b, np.float32)) for w, b in layers], **options), task)


def in_float64(teacher):
    return Actor([(weight.astype(float), bias.astype(float)) for weight, bias in teacher.layers])


def constant(*actions, at=((0.5, 0.5),), **options):
    """A policy with one action in each cell."""
    maps = np.array([[(0, 0), (0, 0), action] for action in actions])
    return VoronoiPolicy(np.array(at), maps, task=SIMPLEGOAL, **{"metric": "euclidean"} | options)


ODD = ({"activation": "Tanh"}, {"squashed": False}, {"clip_mean": 2.0})
exactly = np.vectorize(Fraction, otypes=[object])
SLOPE = network([[[1, 0], [0, 0]], [0, 0]], [[[10, 0], [0, 0]], [-5, 0]])  # Δx = tanh(10 x - 5), Δy = 0
NOTHING = network([np.zeros((2, 1)), [1]], [np.zeros((1, 2)), [0, 0]])


def test_pieces_by_hand():
    """Two units cut the square into four; a unit of the second layer passes 0 in one of these, on y = x - 1 / 4."""
    pieces = atlas.pieces_of(network([np.eye(2), [-0.5, -0.25]], [[[1], [-1]], [0]], [[[4, 0]], [0, 0.5]]))
    assert sorted(atlas.areas(pieces.corners)) == pytest.approx([1 / 8, 1 / 8, 1 / 8, 1 / 4, 3 / 8])
    assert {tuple(each) for each in pieces.maps[:, 0].round(12).tolist()} == {(0, 0, 0), (4, 0, -2), (4, -4, -1)}
    assert (pieces.maps[:, 1] == [0, 0, 0.5]).all()


@pytest.mark.parametrize(("task", "n"), [(SIMPLEGOAL, 12_152), (MOUNTAINCAR, 11_494)])
def test_pieces_fill_the_box_and_are_the_network(task, n):
    """Also exactly, up to the bound. They are counted in another way: lines make one piece of a convex polygon, one
    more each, and one more for each crossing of two inside."""
    teacher, corners, maps, rounding = atlas.pieces_of(load_teacher(task))
    (first, start), (second, offset), (third, last) = layers = in_float64(teacher).layers
    middles, (a, b), (c, d) = corners.mean(axis=1), teacher.task.low, teacher.task.high
    assert n == len(corners) > 1000 * corners.shape[1] and atlas.areas(corners).sum() == pytest.approx(
        (c - a) * (d - b), abs=0, rel=1e-9
    )
    assert np.allclose(np.tanh(atlas.values(maps, middles[:, None])), teacher.predict(middles)[0], rtol=0, atol=1e-4)
    sums = exactly(middles[n // 2])
    for weight, bias in layers:
        sums = (sums if weight is first else np.maximum(sums, 0)) @ exactly(weight) + exactly(bias)
    assert max(abs(atlas.values(maps[n // 2], middles[n // 2]) - sums.astype(float))) <= rounding < 1e-7
    lines, first_alone = np.vstack(layers[0]), network(layers[0], (0 * second @ third, last), task=task)
    cut = atlas.pieces_of(first_alone).corners
    sums = (cut.mean(axis=1) @ first + start > 0)[:, None] * lines @ second + np.eye(3)[:, 2:] * offset
    assert len(cut) == counted(np.array([[a, b], [c, b], [c, d], [a, d]]), lines)
    assert sum(map(counted, cut, sums)) == n


def counted(corners, lines):
    at = corners @ lines[:2] + lines[2]
    lines = lines[:, (at.min(axis=0) < 0) & (at.max(axis=0) > 0)].T
    edges, crossings = np.roll(corners, -1, axis=0) - corners, 0
    for one, other in combinations(lines, 2):
        gaps = np.linalg.solve([one[:2], other[:2]], [-one[2], -other[2]]) - corners
        crossings += bool((edges[:, 0] * gaps[:, 1] >= edges[:, 1] * gaps[:, 0]).all())
    return 1 + len(lines) + crossings


def test_shares_by_hand():
    """Of a tanh, of a limited action, and of cells; bounds are close, and on the right side."""
    ramp = VoronoiPolicy(np.array([[0.5, 0.5]]), np.array([[[4, 0], [0, 0], [0, 0]]]), task=SIMPLEGOAL)
    wide = replace(get_task(SIMPLEGOAL), action_low=np.array([-1.0, -1.0]), action_high=np.array([3.0, 1.0]))
    scaled = Teacher(SLOPE.actor, wide)  # Δx = 1 + 2 tanh(10 x - 5)
    halves, fan = ((0.25, 0.5), (0.75, 0.5)), ((0, 0), (1, 1), (0.5, 0.5))
    for teacher, policy, distance, share in (
        (SLOPE, constant((0, 0)), 0.5, np.arctanh(0.5) / 5),
        (scaled, constant((1, 0)), 1.0, np.arctanh(0.5) / 5),
        (SLOPE, constant((0.9, 0)), 0.25, 0.5 - np.arctanh(0.65) / 10),
        (SLOPE, constant((-1, 0.3)), 0.29, 0.0), (NOTHING, ramp, 0.5, 1 / 8), (NOTHING, ramp, 1.001, 1.0),
        (NOTHING, constant((0, 0.5), (0, -1), at=halves, scale=[0.2, 7]), 0.6, 0.5),
        (NOTHING, constant((1, 0), (0, 1), (0.1, 0.1), at=fan), 0.5, 3 / 4),
    ):  # fmt: skip
        least, most = atlas.compare(atlas.pieces_of(teacher), policy).within(distance)
        assert least <= share <= most < least + 2e-3


@pytest.mark.parametrize("metric", ["euclidean", "manhattan"])
@pytest.mark.parametrize("task", TASKS)
def test_bounds_hold_in_every_polygon(task, metric):
    """At its corners, moved inwards a little, and in its middle; and on a grid in sum."""
    teacher, policy = network_teacher(task, seed=3), random_policy(5, task=task, metric=metric, scaled=True)
    compared = atlas.compare(atlas.pieces_of(teacher), policy)
    wide = atlas.areas(compared.corners) > 1e-9
    corners, middles = compared.corners[wide], compared.corners[wide].mean(axis=1, keepdims=True)
    points = np.concatenate([middles, middles + (1 - 1e-7) * (corners - middles)], axis=1)
    gap = in_float64(teacher).forward(points) - policy.predict(points.reshape(-1, 2))[0].reshape(*points.shape[:2], -1)
    low, high = atlas.values(compared.bounds[:, wide, None], points[:, :, None])
    assert (low < gap + 1e-9).all() and (gap < high + 1e-9).all() and (high - low < 1e-3).all()
    states = show.grid(policy.task.low, policy.task.high, 500)[2]
    apart = abs(teacher.predict(states)[0] - policy.predict(states)[0]).max(axis=1)
    for distance in (0.1, 0.5, 1.0):
        least, most = compared.within(distance)
        assert least - 0.003 < (apart <= distance).mean() < most + 0.003 and least <= most < least + 0.01
        assert sum(region.share for region in compared.farther(distance)) == pytest.approx(1 - least, abs=1e-6)


def test_rounding_is_outwards():
    """At knots the chord meets the tanh, so that only the rounding keeps the bounds apart from it."""
    getcontext().prec = 40
    wider, compared = (atlas.compare(atlas.pieces_of(SLOPE)._replace(rounding=x), constant((0.3, 0))) for x in (0.1, 0))
    assert np.allclose((wider.bounds - compared.bounds)[..., 2], [[[-0.2]], [[0.2]]])
    for corners, maps in zip(compared.corners.tolist(), compared.bounds[:, :, 0].swapaxes(0, 1).tolist()):
        for x, y in corners:
            exact = 1 - 2 / ((20 * Decimal(x) - 10).exp() + 1) - Decimal(0.3)
            low, high = (Decimal(a) * Decimal(x) + Decimal(b) * Decimal(y) + Decimal(c) for a, b, c in maps)
            assert min(exact - low, high - exact) > 2e-11


def test_regions_by_hand():
    """Two corners that do not touch; the larger comes first."""
    at = ((0.5, 0.5), (-0.1, -0.1), (1.2, 1.2))
    compared = atlas.compare(atlas.pieces_of(NOTHING), constant((0, 0.2), (0.8, 0), (0, -0.6), at=at))
    first, second = compared.farther(0.5)
    assert (first.share, second.share) == pytest.approx((0.08, 0.045))
    assert 0.7999 < first.greatest[0] < 0.8 < first.greatest[1] < 0.8001 and 0.59 < second.greatest[0] < 0.61
    assert (first.corners.max(), second.corners.min()) == pytest.approx((0.4, 0.7))
    assert [len(compared.farther(distance)) for distance in (0.1, 0.7, 0.9)] == [1, 1, 0]


def test_faults():
    normalized = Teacher(NOTHING.actor, SIMPLEGOAL, normalization=Normalization(*np.ones((2, 2)), 0.0, 1.0))
    for teacher in (load_teacher(PENDULUM), normalized, *(network([np.eye(2), [0, 0]], **odd) for odd in ODD)):
        with pytest.raises(ValueError, match="two raw inputs with ReLU and tanh"):
            atlas.pieces_of(teacher)
    with pytest.raises(ValueError, match="expected 'linear'"):
        atlas.compare(atlas.pieces_of(NOTHING), random_policy(form="quadratic"))
    for policy in (random_policy(2, task=MOUNTAINCAR), constant((0, 0), metric="chebyshev")):
        with pytest.raises(ValueError, match="a policy of SimpleGoal-v0 by the Euclidean or Manhattan"):
            atlas.compare(atlas.pieces_of(NOTHING), policy)
