"""Follow a policy of linear maps from every start of SimpleGoal at once, in exact arithmetic.

In each step the square of starts is cut into convex pieces on which the next state is one affine function of the start.
The cuts are the borders of the cells, the limits of the actions, and the walls. Goal and pit cut once more. The numbers
of the policy are taken as they are stored, those of the task as they are written: a stride of 1/10, a pit from 2/5 to
3/5.

Long integers take most of the time: each step makes the corners some 50 to 90 binary digits longer. For the paper's
policy of 13 cells they have 115 digits after one step, and up to 1,400 after 16.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from math import gcd, lcm

from vsp.policy import VoronoiPolicy
from vsp.tasks.base import GOAL, PIT, RUNNING, TRUNCATED
from vsp.tasks.simplegoal import TASK

from .polygons import Line, Polygon, box, line_of, reduced
from .proof import check_provable

STRIDE, GOAL_EDGE = Fraction(1, 10), Fraction(1, 10)
PIT_LOW, PIT_HIGH = Fraction(2, 5), Fraction(3, 5)
MOST = 200_000  # most pieces: some minutes
SQUARE = box((Fraction(0), Fraction(1)), (Fraction(0), Fraction(1)))

Form = tuple[Fraction, Fraction, Fraction]  # p x + q y + r of a state (x, y)
ONE = Fraction(1)
X, Y = (Fraction(1), Fraction(0), Fraction(0)), (Fraction(0), Fraction(1), Fraction(0))


@dataclass(frozen=True)
class State:
    """The state as an affine function of the start (x, y): (a x + b y + c) / unit for each of its coordinates."""

    coordinates: tuple[Line, Line] = ((1, 0, 0), (0, 1, 0))
    unit: int = 1

    def pull(self, line: Line) -> Line:
        """Return the line of those starts whose states lie on `line`; (0, 0, 0) if all do."""
        return reduced(self._combined(*line))

    def moved(self, forms: tuple[Form, Form]) -> State:
        """Return the state whose coordinates are `forms` of this one."""
        common = lcm(*(number.denominator for form in forms for number in form))
        found = [self._combined(*(int(number * common) for number in form)) for form in forms]
        shared = gcd(unit := common * self.unit, *found[0], *found[1])
        return State(tuple(tuple(number // shared for number in one) for one in found), unit // shared)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the state from one start, rounded."""
        return tuple(a / self.unit * x + b / self.unit * y + c / self.unit for a, b, c in self.coordinates)

    def _combined(self, p: int, q: int, r: int) -> Line:
        (a, b, c), (d, e, f) = self.coordinates
        return p * a + q * d, p * b + q * e, p * c + q * f + r * self.unit


@dataclass(frozen=True)
class Step:
    """What all states of a piece have in common in a step: the cell, and for each coordinate the limit that the action
    reaches and the wall that the next state reaches (-1 the low one, 1 the high one, 0 neither)."""

    cell: int
    limits: tuple[int, int]
    walls: tuple[int, int] = (0, 0)


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
        found = []
        for a, b, c in self.state.coordinates:
            values = [Fraction(a * x + b * y + c * w, self.state.unit * w) for x, y, w in self.starts.corners]
            found.append((min(values), max(values)))
        return found


def follow(policy: VoronoiPolicy, *, starts: Polygon = SQUARE, most: int = MOST) -> list[Piece]:
    """Cut `starts` into pieces and follow each to its end: at the goal, in the pit, or truncated.

    Raises ValueError for a policy of another task or class, for the metric "chebyshev", and for more than
    `most` pieces: a policy that wanders cuts the square ever finer.
    """
    loop, ended, running = Loop(policy), [], [Piece(starts)]
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
        self.maps = [[tuple(_exact(numbers)) for numbers in one.T] for one in policy.coefficients]  # a form per action
        self.distance = Distance(policy)

    def advance(self, piece: Piece) -> Iterator[Piece]:
        """Cut `piece` by one step, and yield the parts after the step."""
        for part, cell in self.distance.cells(piece):
            for acting, actions, limits in _clipped_both(part, self.maps[cell], -ONE, ONE):
                wanted = [_sum(state, action, STRIDE) for state, action in zip((X, Y), actions)]
                for moving, forms, walls in _clipped_both(acting, wanted, 0 * ONE, ONE):
                    steps = (*piece.steps, Step(cell, limits, walls))
                    yield from _ended(replace(moving, state=piece.state.moved(forms), before=piece.state, steps=steps))


class Distance:
    """Finds the nearest codeword. Of equally near ones it takes the first, because a tie over an area has to be decided
    too."""

    def __init__(self, policy: VoronoiPolicy):
        self.codewords = [_exact(codeword) for codeword in policy.codewords]
        self.weights = [1 / scale for scale in _exact(policy.scale)]
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
        sides = ()
        if self.metric == "manhattan":  # a distance is affine where no coordinate passes the codeword's
            for axis, value in ((axis, self.codewords[which][axis]) for axis in (0, 1) for which in (i, j)):
                low, high = _split(piece, _minus((X, Y)[axis], value))
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
    def gap(self, i: int, j: int, sides: tuple[int, ...] = ()) -> Form:
        """Return the distance (for "euclidean", the squared distance) to `i` minus that to `j`.

        `sides`, for "manhattan": on which side of each of the two codewords the first coordinate lies, then the second.
        """
        found = (0 * ONE, 0 * ONE, 0 * ONE)
        for axis, weight in enumerate(self.weights):
            c, d = self.codewords[i][axis], self.codewords[j][axis]
            if self.metric == "euclidean":
                found = _sum(found, (X, Y)[axis], 2 * weight**2 * (d - c), weight**2 * (c * c - d * d))
            else:
                at_i, at_j = sides[2 * axis : 2 * axis + 2]
                found = _sum(found, (X, Y)[axis], weight * (at_i - at_j), weight * (at_j * d - at_i * c))
        return found


def _ended(piece: Piece) -> Iterator[Piece]:
    """Yield the parts of `piece` in the goal, in the pit, and elsewhere; goal and pit are open sets."""
    for part, inside in _within(piece, IN_GOAL):
        if inside:
            yield replace(part, outcome=GOAL)
            continue
        for rest, fell in _within(part, IN_PIT):
            yield replace(rest, outcome=PIT if fell else RUNNING)


def _within(piece: Piece, forms: list[Form]) -> Iterator[tuple[Piece, bool]]:
    """Yield the parts of `piece` where a form is not positive, and the part where all forms are."""
    for form in forms:
        outside, piece = _split(piece, form)
        if outside:
            yield outside, False
        if not piece:
            return
    yield piece, True


def _clipped_both(piece: Piece, forms: list[Form], low: Fraction, high: Fraction):
    """Yield the parts of `piece` by the limits that two forms reach: the part, the limited forms, and these limits."""
    for first, x, at_x in _clipped(piece, forms[0], low, high):
        for second, y, at_y in _clipped(first, forms[1], low, high):
            yield second, (x, y), (at_x, at_y)


def _clipped(piece: Piece, form: Form, low: Fraction, high: Fraction) -> Iterator[tuple[Piece, Form, int]]:
    below, rest = _split(piece, _minus(form, low))
    if below:
        yield below, (0 * ONE, 0 * ONE, low), -1
    if rest:
        between, above = _split(rest, _minus(form, high))
        if between:
            yield between, form, 0
        if above:
            yield above, (0 * ONE, 0 * ONE, high), 1


def _split(piece: Piece, form: Form) -> tuple[Piece | None, Piece | None]:
    """Return the parts of `piece` where a form of the state is at most 0, and above 0; None for a part without area."""
    line = piece.state.pull(line_of(form))
    if line == (0, 0, 0):
        return piece, None
    return tuple(part and replace(piece, starts=part) for part in piece.starts.cut(line))


def _sum(one: Form, other: Form, factor: Fraction, constant: Fraction = Fraction(0)) -> Form:
    """one + factor * other + constant"""
    a, b, c = (p + factor * q for p, q in zip(one, other))
    return a, b, c + constant


def _minus(form: Form, constant: Fraction) -> Form:
    return form[0], form[1], form[2] - constant


def _below(edge: Fraction, form: Form) -> Form:
    """edge - form"""
    return -form[0], -form[1], edge - form[2]


IN_GOAL = [_below(GOAL_EDGE, axis) for axis in (X, Y)]  # inside, all of these are positive
IN_PIT = [form for axis in (X, Y) for form in (_minus(axis, PIT_LOW), _below(PIT_HIGH, axis))]


def _exact(numbers) -> list[Fraction]:
    return [Fraction(float(number)) for number in numbers]
