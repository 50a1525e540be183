"""Follow a policy of linear maps from every start of SimpleGoal at once, in exact arithmetic.

In each step the square of starts is cut into convex pieces on which the next state is one affine function of the start.
The cuts are the borders of the cells, the limits of the actions, and the walls. Goal and pit cut once more. The numbers
of the policy are taken as they are stored, those of the task as they are written: a stride of 1/10, a pit from 2/5 to
3/5.

Long integers take most of the time: each step makes the corners some 50 to 90 binary digits longer. For the paper's
policy of 13 cells they have 115 digits after one step, and up to 1,400 after 16.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from math import gcd, lcm

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.tasks.base import GOAL, PIT, RUNNING, TRUNCATED
from vsp.tasks.simplegoal import TASK

from .polygons import Line, Polygon, box, line_of, reduced
from .proof import check_provable

STRIDE, GOAL_EDGE = Fraction(1, 10), Fraction(1, 10)
PIT_LOW, PIT_HIGH = Fraction(2, 5), Fraction(3, 5)
MOST = 200_000  # most pieces: some minutes
SQUARE = box((Fraction(0), Fraction(1)), (Fraction(0), Fraction(1)))

Form = np.ndarray  # (3,) fractions p, q, r: p x + q y + r of a state (x, y)
X, Y, ONE = np.array([[Fraction(i == j) for i in range(3)] for j in range(3)])
IN_GOAL = [line_of(GOAL_EDGE * ONE - axis) for axis in (X, Y)]  # inside, a state is on the positive side of all
IN_PIT = [line_of(form) for axis in (X, Y) for form in (axis - PIT_LOW * ONE, PIT_HIGH * ONE - axis)]


@dataclass(frozen=True, eq=False)
class State:
    """The state as an affine function of the start (x, y).

    `matrix` (3, 3), of integers, times (x, y, 1) is (x', y', 1) times a positive integer, where (x', y') is the state.
    """

    matrix: np.ndarray = field(default_factory=lambda: np.eye(3, dtype=int).astype(object))

    def pull(self, line: Line) -> Line:
        """Return the line of those starts whose states lie on `line`; (0, 0, 0) if all do."""
        return reduced(tuple(np.array(line, dtype=object) @ self.matrix))

    def moved(self, move: np.ndarray) -> State:
        """Return the state after a `move`, a matrix (3, 3) as in a state."""
        matrix = move @ self.matrix
        return State(matrix // gcd(*matrix.flat))

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the state from one start, rounded."""
        unit = self.matrix[2, 2]
        return tuple(a / unit * x + b / unit * y + c / unit for a, b, c in self.matrix[:2])


@dataclass(frozen=True)
class Step:
    """What all states of a piece have in common in a step: the cell, and for each coordinate the limit that the action
    reaches and the wall that the next state reaches (-1 the low one, 1 the high one, 0 neither)."""

    cell: int
    limits: tuple[int, ...]
    walls: tuple[int, ...] = (0, 0)


@dataclass(frozen=True)
class Piece:
    """Starts that share every step: a convex polygon, and the state as a function of the start."""

    starts: Polygon
    state: State = State()
    before: State = State()  # one step earlier
    steps: tuple[Step, ...] = ()
    outcome: int = RUNNING

    def bounds(self) -> list[tuple[Fraction, Fraction]]:
        """Return the least and the largest value of each coordinate of the state."""
        states = self.state.matrix @ np.array(self.starts.corners, dtype=object).T  # (3, corners)
        values = [[Fraction(value, unit) for value, unit in zip(row, states[2])] for row in states[:2]]
        return [(min(row), max(row)) for row in values]


def follow(policy: VoronoiPolicy, *, most: int = MOST) -> list[Piece]:
    """Cut the square of starts into pieces and follow each to its end: at the goal, in the pit, or truncated.

    Raises ValueError for a policy of another task or class, for the metric "chebyshev", and for more than
    `most` pieces: a policy that wanders cuts the square ever finer."""
    loop, ended, running = Loop(policy), list[Piece](), [Piece(SQUARE)]
    for t in range(TASK.max_steps):
        moved = [after for piece in running for after in loop.advance(piece)]
        if len(ended) + len(moved) > most:
            raise ValueError(f"{len(ended) + len(moved):,} pieces after {t + 1} steps, expected at most {most:,}")
        ended += [piece for piece in moved if piece.outcome != RUNNING]
        running = [piece for piece in moved if piece.outcome == RUNNING]
    return ended + [replace(piece, outcome=TRUNCATED) for piece in running]


class Loop:
    """The closed loop of a policy and the task."""

    def __init__(self, policy: VoronoiPolicy):
        check_provable(policy, TASK)
        self.actions = _exact(policy.coefficients.transpose(0, 2, 1))  # (k, 2, 3): a form per action
        self.distance = Distance(policy)

    def advance(self, piece: Piece) -> Iterator[Piece]:
        """Cut `piece` by one step, and yield the parts after the step."""
        for part, cell in self.distance.cells(piece):
            for acting, limits in _by_sides(part, self.limits(cell)):
                for moving, walls in _by_sides(acting, self.walls(cell, limits)):
                    state = piece.state.moved(self.move(cell, limits, walls))
                    steps = (*piece.steps, Step(cell, limits, walls))
                    yield from _ended(replace(moving, state=state, before=piece.state, steps=steps))

    @cache  # noqa: B019 - it lives as long as the proof
    def limits(self, cell: int) -> list[tuple[Line, Line]]:
        """Return for each action the lines on which it reaches its limits."""
        return [(line_of(form + ONE), line_of(form - ONE)) for form in self.actions[cell]]

    @cache  # noqa: B019
    def walls(self, cell: int, limits: tuple[int, ...]) -> list[tuple[Line, Line]]:
        """Return for each coordinate of the next state the lines on which it reaches its walls."""
        return [(line_of(form), line_of(form - ONE)) for form in self._next(cell, limits)]

    @cache  # noqa: B019
    def move(self, cell: int, limits: tuple[int, ...], walls: tuple[int, ...]) -> np.ndarray:
        """Return the matrix of a step, as in `State`."""
        forms = [max(side, 0) * ONE if side else form for side, form in zip(walls, self._next(cell, limits))]
        matrix = np.array([*forms, ONE])
        return np.vectorize(int, otypes=[object])(lcm(*(number.denominator for number in matrix.flat)) * matrix)

    def _next(self, cell: int, limits: tuple[int, ...]) -> list[Form]:
        actions = [side * ONE if side else form for side, form in zip(limits, self.actions[cell])]
        return [axis + STRIDE * action for axis, action in zip((X, Y), actions)]


class Distance:
    """Finds the nearest codeword. Of equally near ones it takes the first, because a tie over an area has to be decided
    too."""

    def __init__(self, policy: VoronoiPolicy):
        self.codewords, self.weights = _exact(policy.codewords), 1 / _exact(policy.scale)
        self.metric = policy.metric

    def cells(self, piece: Piece) -> Iterator[tuple[Piece, int]]:
        """Yield the parts of `piece`, each with its cell."""
        state = [float(value) for value in piece.state.at(*piece.starts.middle())]
        near = sorted(range(len(self.codewords)), key=lambda i: self._between(state, i))  # nearest first, for speed
        bounds = piece.bounds() if self.metric == "manhattan" else None
        yield from self._among(piece, near, bounds)

    def _between(self, state: list[float], i: int) -> float:
        gaps = [abs(float(w) * (s - float(c))) for w, s, c in zip(self.weights, state, self.codewords[i])]
        return sum(gaps) if self.metric == "manhattan" else sum(gap * gap for gap in gaps)

    def _among(self, piece: Piece, rivals: list[int], bounds) -> Iterator[tuple[Piece, int]]:
        if len(rivals) == 1:
            yield piece, rivals[0]
            return
        i, j = sorted(rivals[:2])
        least, most = self._range(i, j, bounds) if bounds else (-1, 1)
        compared = [(piece, i)] if most <= 0 else [(piece, j)] if least > 0 else self._compared(piece, i, j)
        for part, nearer in compared:
            yield from self._among(part, [nearer, *rivals[2:]], bounds)

    def _range(self, i: int, j: int, bounds) -> tuple[Fraction, Fraction]:
        """Return the least and the largest value of `gap` for states within `bounds`: it is monotone in each
        coordinate."""
        least = most = Fraction(0)
        for weight, ends, c, d in zip(self.weights, bounds, self.codewords[i], self.codewords[j]):
            low, high = sorted(weight * (abs(end - c) - abs(end - d)) for end in ends)
            least, most = least + low, most + high
        return least, most

    def _compared(self, piece: Piece, i: int, j: int) -> Iterator[tuple[Piece, int]]:
        """Yield the parts of `piece`, each with the nearer of two codewords; `i` is the lower index."""
        sides: tuple[int, ...] = ()
        if self.metric == "manhattan":  # a distance is affine where no coordinate passes the codeword's
            for axis, value in ((axis, self.codewords[which][axis]) for axis in (0, 1) for which in (i, j)):
                low, high = _split(piece, line_of((X, Y)[axis] - value * ONE))
                if low and high:
                    yield from self._compared(low, i, j)
                    yield from self._compared(high, i, j)
                    return
                sides += (1 if high else -1,)
        nearer, farther = _split(piece, self.gap(i, j, sides))
        if nearer:
            yield nearer, i
        if farther:
            yield farther, j

    @cache  # noqa: B019 - it lives as long as the proof
    def gap(self, i: int, j: int, sides: tuple[int, ...] = ()) -> Line:
        """Return the line of equal distance to `i` and `j`; on its positive side, `j` is nearer.

        `sides`, for "manhattan": on which side of each of the two codewords the first coordinate lies, then the second.
        """
        form = 0 * ONE
        for axis, weight in enumerate(self.weights):
            c, d = self.codewords[i][axis], self.codewords[j][axis]
            if self.metric == "euclidean":
                form = form + weight**2 * (2 * (d - c) * (X, Y)[axis] + (c * c - d * d) * ONE)
            else:
                at_i, at_j = sides[2 * axis : 2 * axis + 2]
                form = form + weight * ((at_i - at_j) * (X, Y)[axis] + (at_j * d - at_i * c) * ONE)
        return line_of(form)


def _ended(piece: Piece) -> Iterator[Piece]:
    """Yield the parts of `piece` in the goal, in the pit, and elsewhere; goal and pit are open sets."""
    for part, inside in within(piece, IN_GOAL):
        if inside:
            yield replace(part, outcome=GOAL)
            continue
        for rest, fell in within(part, IN_PIT):
            yield replace(rest, outcome=PIT if fell else RUNNING)


def within(piece: Piece, lines: Sequence[Line]) -> Iterator[tuple[Piece, bool]]:
    """Yield the parts of `piece` that are not on the positive side of a line, and the part on that of all lines."""
    for line in lines:
        outside, inside = _split(piece, line)
        if outside:
            yield outside, False
        if not inside:
            return
        piece = inside
    yield piece, True


def _by_sides(piece: Piece, lines: Sequence[tuple[Line, Line]]) -> Iterator[tuple[Piece, tuple[int, ...]]]:
    """Yield the parts of `piece` by where they lie of each pair of `lines`: on the negative side of the first (-1),
    between both (0), or on the positive side of the second (1)."""
    if not lines:
        yield piece, ()
        return
    low, high = lines[0]
    below, rest = _split(piece, low)
    between, above = _split(rest, high) if rest else (None, None)
    for part, side in ((below, -1), (between, 0), (above, 1)):
        if part:
            yield from ((smaller, (side, *others)) for smaller, others in _by_sides(part, lines[1:]))


def _split(piece: Piece, line: Line) -> tuple[Piece | None, Piece | None]:
    """Return the parts of `piece` whose states lie on the negative side of `line`, or on it, and on the positive side;
    None for a part without area."""
    pulled = piece.state.pull(line)
    if pulled == (0, 0, 0):
        return piece, None
    low, high = (replace(piece, starts=part) if part else None for part in piece.starts.cut(pulled))
    return low, high


def _exact(numbers: np.ndarray) -> np.ndarray:
    return np.vectorize(Fraction, otypes=[object])(numbers)
