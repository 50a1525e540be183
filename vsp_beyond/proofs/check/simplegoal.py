"""Check SimpleGoal's certificates by another method than the prover's: move the corners of polygons.

A certificate names a policy, a claim, and the itineraries of all starts: per step the cell, which actions are at a
limit and which coordinates at a wall. For each itinerary the checker cuts from the square of starts those that follow
it. No start follows two itineraries, so the parts do not overlap. If their areas add up to 1, nothing is missing except
lines without area. All numbers are fractions.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np

from .refused import Refused

SQUARE = [(Fraction(x), Fraction(y)) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
STRIDE, GOAL, PIT, N_STEPS = Fraction(1, 10), Fraction(1, 10), (Fraction(2, 5), Fraction(3, 5)), 50
AXES = [(Fraction(1), Fraction(0), Fraction(0)), (Fraction(0), Fraction(1), Fraction(0))]  # the coordinates of a state
DOUBT = 1e-9  # relative to the numbers added up: far more than the rounding error
SIDES = {"-": -1, "=": 0, "+": 1}


def check_content(content: dict) -> dict:
    """Return the claim of a certificate that was read. Raises `Refused` if it is not proved."""
    policy, areas, longest = Policy(**content["policy"]), {"goal": 0, "pit": 0, "left": 0}, 0
    pieces = [line.split(" ") for line in content["pieces"]]
    corners = [[corner(start, start) for start in SQUARE]]
    for end, depth, area in followed(policy, corners, sorted((steps, end) for end, *steps in pieces), 0):
        areas[end] += area
        longest = max(longest, depth)
    claim, proved = content["claim"], {**{end: str(Fraction(area)) for end, area in areas.items()}, "longest": longest}
    claimed = {name: str(Fraction(value)) for name, value in claim.items()}
    if sum(areas.values()) != 1:
        raise Refused(f"the pieces cover {float(sum(areas.values()))!r} of the square, expected all of it")
    if claimed != {name: str(value) for name, value in proved.items()}:
        raise Refused(f"the pieces prove {proved}, but the claim is {claim}")
    return claim


def followed(policy: Policy, polygons: list, pieces: list[tuple[list[str], str]], depth: int):
    """Yield end, depth and area of all `pieces`, which share their first `depth` steps; `polygons` are their starts.

    A polygon is a list of corners made by `corner`."""
    ended = {end for steps, end in pieces if len(steps) == depth}
    if ended and depth == N_STEPS:
        if ended != {"left"}:
            raise Refused(f"a piece ends as {ended} after {N_STEPS} steps, expected 'left'")
        yield "left", depth, area(polygons)
    longer = [piece for piece in pieces if len(piece[0]) > depth] if depth < N_STEPS else []
    while longer:
        step = longer[0][0][depth]
        alike = [piece for piece in longer if piece[0][depth] == step]
        longer = longer[len(alike) :]
        goal, rest = inside(policy.step(polygons, step), IN_GOAL)
        pit, rest = inside(rest, IN_PIT)
        ends = {end for steps, end in alike if len(steps) == depth + 1 and end != "left"}
        for end, polygons_there in (("goal", goal), ("pit", pit)):
            if end in ends:
                yield end, depth + 1, area(polygons_there)
        going = [piece for piece in alike if len(piece[0]) > depth + 1 or piece[1] == "left"]
        if going:
            yield from followed(policy, rest, going, depth + 1)


class Form:
    """p x + q y + r of a state (x, y)."""

    def __init__(self, p, q, r):
        self.exact = p, q, r
        self.rough = [float(number) for number in self.exact]
        self.doubt = DOUBT * sum(map(abs, self.rough))

    def at(self, state) -> Fraction:
        """Return its value in a state."""
        *slopes, value = self.exact
        for slope, coordinate in zip(slopes, state):
            if slope:
                value += coordinate if slope == 1 else slope * coordinate
        return value

    def signs(self, polygon: list) -> list:
        """Return numbers with the signs of the values at the corners: rounded ones where their signs are certain, else
        exact ones."""
        p, q, r = self.rough
        values = [p * x + q * y + r for _, _, (x, y) in polygon]
        sure = min(values) > self.doubt or max(values) < -self.doubt
        return values if sure else [self.at(state) for _, state, _ in polygon]


def corner(start, state) -> tuple:
    """Return a start, the state that it leads to, and that state rounded."""
    return start, state, (float(state[0]), float(state[1]))


class Policy:
    """Linear maps, each for the states that are nearest to its codeword; of equally near codewords the first counts."""

    def __init__(self, codewords, coefficients, scale, metric):
        if metric not in ("euclidean", "manhattan"):
            raise Refused(f"the metric is {metric!r}, expected 'euclidean' or 'manhattan'")
        self.metric, self.scale = metric, [Fraction(s) for s in scale]
        self.codewords = [[Fraction(number) for number in codeword] for codeword in codewords]
        self.sizes = np.array(scale)
        self.rough = np.array(codewords) / self.sizes
        self.maps = [[[Fraction(row[axis]) for row in rows] for axis in (0, 1)] for rows in coefficients]

    def step(self, polygons: list, step: str) -> list:
        """Return the parts of `polygons` that make this step, such as "3+=--", with the states after it."""
        number, limits, moves, stops, walls = self.plan(step)
        parts = [part for polygon in polygons for part in self.cell(polygon, number)]
        parts = [moved(part, moves) for part in left_by(parts, limits)]
        parts = left_by(parts, stops)
        return [moved(part, walls) for part in parts] if walls else parts

    @cache  # noqa: B019 - it lives as long as the check
    def plan(self, step: str) -> tuple:
        """Return the cell of a step, the cuts at the limits of the actions, the forms of the next state, the cuts at
        the walls, and the forms of the state at the walls (None: at no wall)."""
        if step[:-4] not in map(str, range(len(self.maps))):  # a cell has one spelling, so no start is counted twice
            raise Refused(f"a step is {step!r}, expected one in a cell from 0 to {len(self.maps) - 1}")
        number, sides = int(step[:-4]), [SIDES[sign] for sign in step[-4:]]
        actions = [(0, 0, side) if side else form for form, side in zip(self.maps[number], sides)]
        moves = [Form(*(a + STRIDE * b for a, b in zip(axis, action))) for axis, action in zip(AXES, actions)]
        walls = [Form(0, 0, Fraction(side > 0)) if side else Form(*axis) for axis, side in zip(AXES, sides[2:])]
        limits = [cut for form, side in zip(self.maps[number], sides) for cut in limit_cuts(form, -1, side)]
        stops = [cut for axis, side in zip(AXES, sides[2:]) for cut in limit_cuts(axis, 0, side)]
        return number, limits, moves, stops, walls if any(sides[2:]) else None

    def cell(self, polygon: list, number: int) -> list:
        """Return the convex parts of `polygon` in a cell."""
        parts = [polygon]
        for other in self.rivals(polygon, number):
            parts = [nearer for part in parts for nearer in self.nearer(part, number, other)]
        return parts

    def rivals(self, polygon: list, number: int) -> list[int]:
        """Return other codewords that may be nearer to some of `polygon`, be it only by rounding.

        In the Manhattan distance, each coordinate adds a monotone function to the difference, which is largest at an
        end."""
        far = np.zeros(len(self.codewords), dtype=bool)
        if self.metric == "manhattan":
            states = np.array([rough for _, _, rough in polygon]) / self.sizes
            gaps = np.abs([states.min(axis=0) - self.rough, states.max(axis=0) - self.rough])  # (ends, k, axes)
            most = (gaps[:, [number]] - gaps).max(axis=0).sum(axis=1)
            far = most < -DOUBT * (1 + gaps.sum() + np.abs(self.rough).sum())
        return [other for other in np.flatnonzero(~far).tolist() if other != number]

    def nearer(self, polygon: list, number: int, other: int) -> list:
        """Return the convex parts of `polygon` that are nearer to codeword `number` than to `other`."""
        parts: list[tuple[list, tuple[int, ...]]] = [(polygon, ())]
        if self.metric == "manhattan":  # between the coordinates of the codewords, distances are linear
            for axis in (0, 1):
                for i in (number, other):
                    (p, q, _), value = AXES[axis], self.codewords[i][axis]
                    cut = [(halves(part, Form(p, q, -value)), at) for part, at in parts]
                    parts = [(half, (*at, side)) for both, at in cut for half, side in zip(both, (-1, 1)) if half]
        nearer = []
        for part, at in parts:
            gap = self.gap(number, other, at)
            tied = not any(gap.signs(part))
            if half := (part if number < other else None) if tied else halves(part, gap)[0]:
                nearer.append(half)
        return nearer

    @cache  # noqa: B019 - it lives as long as the check
    def gap(self, number: int, other: int, at: tuple) -> Form:
        """Return the distance to codeword `number` minus that to `other`; Euclidean distances are squared.

        `at`: on which side of each of the two codewords the first coordinate is, then the second."""
        slopes, constant = [], Fraction(0)
        for axis, scale in enumerate(self.scale):
            c, d = self.codewords[number][axis], self.codewords[other][axis]
            if self.metric == "euclidean":
                slopes.append(2 * (d - c) / scale**2)
                constant += (c * c - d * d) / scale**2
            else:
                slopes.append((at[2 * axis] - at[2 * axis + 1]) / scale)
                constant += (at[2 * axis + 1] * d - at[2 * axis] * c) / scale
        p, q = slopes
        return Form(p, q, constant)


def limit_cuts(form, low: int, side: int) -> list[tuple[Form, int]]:
    """Return the cuts to where a form is below `low` (side -1), above 1 (side 1), or between (0). A cut is a form, and
    which of the `halves` is meant."""
    p, q, r = form
    above_low, above_high = Form(p, q, r - low), Form(p, q, r - 1)
    return {-1: [(above_low, 0)], 0: [(above_low, 1), (above_high, 0)], 1: [(above_high, 1)]}[side]


def left_by(polygons: list, cuts: list) -> list:
    """Return the parts of `polygons` that are left by all cuts."""
    for form, half in cuts:
        polygons = [part for polygon in polygons if (part := halves(polygon, form)[half])]
    return polygons


def moved(polygon: list, forms: list[Form]) -> list:
    """Return the same starts, with new states: `forms` of the states before."""
    return [corner(start, tuple(form.at(state) for form in forms)) for start, state, _ in polygon]


def inside(polygons: list, forms: list) -> tuple[list, list]:
    """Return the parts where all forms are positive, and the rest."""
    rest = []
    for form in forms:
        both = [halves(polygon, form) for polygon in polygons]
        rest += [low for low, _ in both if low]
        polygons = [high for _, high in both if high]
    return polygons, rest


def halves(polygon: list, form: Form) -> tuple[list | None, list | None]:
    """Return the parts of `polygon` where `form` is at most 0, and above 0; None for a part without area."""
    values = form.signs(polygon)
    if max(values) <= 0:
        return polygon, None
    if min(values) >= 0:
        return None, polygon
    low, high = [], []
    for here, there, current, following in zip(values, values[1:] + values[:1], polygon, polygon[1:] + polygon[:1]):
        if here <= 0:
            low.append(current)
        if here >= 0:
            high.append(current)
        if here * there < 0:
            share = here / (here - there)
            new = corner(*(tuple(p + share * (q - p) for p, q in zip(current[i], following[i])) for i in (0, 1)))
            low.append(new)
            high.append(new)
    return low, high


def area(polygons: list) -> Fraction:
    """The area of the starts."""
    total = Fraction(0)
    for polygon in polygons:
        points = [start for start, _, _ in polygon]
        total += sum(x * v - u * y for (x, y), (u, v) in zip(points, points[1:] + points[:1])) / 2
    return total


IN_GOAL = [Form(-p, -q, GOAL) for p, q, _ in AXES]  # inside, all of these are positive
IN_PIT = [form for p, q, _ in AXES for form in (Form(p, q, -PIT[0]), Form(-p, -q, PIT[1]))]
