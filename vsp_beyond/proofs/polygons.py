"""Convex polygons with exact corners: cut by lines, measured, never rounded.

A line (a, b, c) of integers stands for a x + b y + c = 0; its positive side is a x + b y + c > 0. A corner (X, Y, W) of
integers with W > 0 stands for the point (X / W, Y / W). Each corner is the intersection of two of the lines that cut
the polygon. So its numbers grow only with those of the lines, not with the number of cuts.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

Line = tuple[int, int, int]
Corner = tuple[int, int, int]


@dataclass(frozen=True)
class Polygon:
    """A convex polygon of positive area. `edges[i]` joins `corners[i]` to the next one, anticlockwise."""

    corners: tuple[Corner, ...]
    edges: tuple[Line, ...]

    def cut(self, line: Line) -> tuple[Polygon | None, Polygon | None]:
        """Return the parts on the negative and on the positive side; None for a part without area.

        For a line (0, 0, c), everything lies on the side of the sign of c. The line (0, 0, 0) has no sides."""
        sides = [_side(line, corner) for corner in self.corners]
        if min(sides) >= 0:
            return None, self
        if max(sides) <= 0:
            return self, None
        return self._part(sides, line, -1), self._part(sides, line, 1)

    def _part(self, sides: list[int], line: Line, wanted: int) -> Polygon:
        """Return the part where the sides are `wanted` or 0. (Sutherland and Hodgman 1974)"""
        corners, edges = [], []
        for i, (corner, edge) in enumerate(zip(self.corners, self.edges)):
            here, there = wanted * sides[i], wanted * sides[(i + 1) % len(sides)]
            if here >= 0:
                corners.append(corner)
                edges.append(line if here == 0 > there else edge)
            if here * there < 0:
                corners.append(meet(edge, line))
                edges.append(edge if here < 0 else line)
        return Polygon(tuple(corners), tuple(edges))

    def middle(self) -> tuple[float, float]:
        """Return the mean of the corners, rounded."""
        x, y = zip(*self.points())
        return sum(x) / len(x), sum(y) / len(y)

    def points(self) -> list[tuple[float, float]]:
        """Return the corners, rounded."""
        return [(x / w, y / w) for x, y, w in self.corners]

    def area(self) -> Fraction:
        """Return the exact area, by the shoelace formula."""
        common = lcm(*(w for _, _, w in self.corners))
        points = [(x * (common // w), y * (common // w)) for x, y, w in self.corners]
        twice = sum(x * v - u * y for (x, y), (u, v) in zip(points, points[1:] + points[:1]))
        return Fraction(twice, 2 * common * common)


def box(x: tuple[Fraction, Fraction], y: tuple[Fraction, Fraction]) -> Polygon:
    """Return the rectangle between two values of x and two of y."""
    edges = [line_of((0, 1, -y[0])), line_of((-1, 0, x[1])), line_of((0, -1, y[1])), line_of((1, 0, -x[0]))]
    return Polygon(tuple(meet(edges[i - 1], edges[i]) for i in range(4)), tuple(edges))


def line_of(numbers: Collection[Fraction | int]) -> Line:
    """Return the line with coefficients in the ratio of the three `numbers`, in the smallest integers."""
    common = lcm(*(number.denominator for number in numbers))
    return reduced(tuple(number.numerator * (common // number.denominator) for number in numbers))


def reduced(line: Sequence[int]) -> Line:
    """Return the same line, in the smallest integers."""
    shared, (a, b, c) = gcd(*line) or 1, line
    return a // shared, b // shared, c // shared


def meet(first: Line, second: Line) -> Corner:
    """Return the intersection of two lines that are not parallel."""
    (a, b, c), (d, e, f) = first, second
    x, y, w = b * f - c * e, c * d - a * f, a * e - b * d
    return (x, y, w) if w > 0 else (-x, -y, -w)


def total(numbers: list[Fraction]) -> Fraction:
    """Return the exact sum. Numbers are added in pairs, so that few additions have large denominators."""
    while len(numbers) > 1:
        numbers = [sum(numbers[i : i + 2], Fraction(0)) for i in range(0, len(numbers), 2)]
    return numbers[0] if numbers else Fraction(0)


def _side(line: Line, corner: Corner) -> int:
    value = line[0] * corner[0] + line[1] * corner[1] + line[2] * corner[2]
    return (value > 0) - (value < 0)
