"""Prove MountainCar over the reals: follow short pieces of the line of starts to the flag, with bounds on the error.

The states of a piece are c + g t + r, with t from -1 to 1 along the piece. The remainder r is bounded in a norm in
which the car's swing at the bottom of the valley is a rotation, so the bound hardly grows there. (Boxes would grow with
every step.) A piece that crosses a border of cells, a limit of the action, the wall or the flag is cut in three. For
two parts the side is certain. The sliver between them is followed in every way that it may go; at a limit of the action
once, with a larger remainder.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.run import workers
from vsp.tasks.mountaincar import FLAG, TASK
from vsp_beyond.proofs.mountaincar import LEFT, RIGHT
from vsp_beyond.proofs.proof import check_provable

SWING = 0.0866  # rad per step, at the bottom: a velocity counts 1 / SWING times as much as a position
BOTH = np.hypot(1.0, 1.0 / SWING)  # norm of an error of 1 in both coordinates
POWER, PULL = 0.0015, 0.0025
BEND = 4.5 * PULL  # half the largest second derivative of the pull along the position
ROUNDING = 1e-15  # per coordinate and step: several times what float64 loses
FASTEST, WALL = 0.07, -1.2
LOST = 1e-3  # a piece with this remainder is given up
N_PIECES, N_PARTS = 100_000, 100  # pieces of the line, and parts of it that are proved separately
SHORTER, N_TRIALS = 4, 4  # pieces that are given up are cut in so many and tried again; trials in all
MOST_AGAIN = 1000  # more short pieces are not tried: the car seems to fail there
MARGIN = 1e-12  # by which ranges that are given up are widened: more than thousands of cuts round the ends of a piece
SUMMED = 1e-11  # more than the costs of 999 steps, at most 100, lose in float64


@dataclass(frozen=True)
class Pieces:
    """Pieces of the line of starts, each with its states after some steps."""

    low: np.ndarray  # (n,) ends of the range of starts
    high: np.ndarray
    centre: np.ndarray  # (2, n) c
    along: np.ndarray  # (2, n) g
    rest: np.ndarray  # (n,) bound on r, in the norm of x and v / SWING
    cost: np.ndarray  # (n,) upper bound on the cost of the actions so far
    cell: np.ndarray  # (n,) cell of the states; -1: undecided

    def __len__(self) -> int:
        return len(self.low)

    def at(self, index: np.ndarray) -> Pieces:
        """Return the pieces at `index`."""
        return Pieces(*(getattr(self, field.name)[..., index] for field in fields(self)))

    def between(self, begin: np.ndarray, end: np.ndarray) -> Pieces:
        """Return the part of each piece from t = `begin` to `end`, without empty parts."""
        kept = np.flatnonzero(end > begin)
        whole, begin, end = self.at(kept), begin[kept], end[kept]
        low, high = (whole.low + (t + 1) / 2 * (whole.high - whole.low) for t in (begin, end))
        centre, along = whole.centre + (begin + end) / 2 * whole.along, (end - begin) / 2 * whole.along
        return replace(whole, low=low, high=high, centre=centre, along=along, rest=whole.rest + ROUNDING * BOTH)

    def ranges(self, x, v, constant, lost=0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bound the linear function with coefficients `x`, `v` and `constant`. Return its value in the middle, its
        change from there to the end of the piece, and the largest effect of the remainder. (n,) each. `lost` is the
        size of the terms that cancelled in its coefficients."""
        size = self.rest * np.hypot(x, v * SWING) + ROUNDING * (np.abs(x) + np.abs(v) + np.abs(constant) + lost)
        return x * self.centre[0] + v * self.centre[1] + constant, x * self.along[0] + v * self.along[1], size

    def cut(self, x, v, constant, lost=0.0) -> tuple[Pieces, Pieces, Pieces]:
        """Return the parts where a linear function of the state is surely below 0, where its sign is undecided, and
        where it is surely above 0."""
        value, change, size = self.ranges(x, v, constant, lost)
        change = np.where(np.abs(change) > 1e-300, change, 1e-300)
        up, ends = change > 0, np.ones(len(self))
        first, last = np.sort([(-2 * size - value) / change, (2 * size - value) / change], axis=0).clip(-1.0, 1.0)
        below = self.between(np.where(up, -ends, last), np.where(up, first, ends))
        return below, self.between(first, last), self.between(np.where(up, last, -ends), np.where(up, ends, first))


def joined(parts: list[Pieces]) -> Pieces:
    """Join all pieces of `parts`."""
    return Pieces(*(np.concatenate([getattr(part, one.name) for part in parts], axis=-1) for one in fields(Pieces)))


@dataclass(frozen=True)
class Part:
    """The result for a part of the line of starts."""

    share: float  # share of the starts from which the car surely arrives
    longest: int  # most steps from these starts
    least: float  # lower bound on the return from these starts


def prove_reals(policy: VoronoiPolicy, *, jobs: int | str = -1) -> list[Part]:
    """Prove from which starts the car reaches the flag, in real numbers, for each part of the line. Takes minutes.

    `jobs` as in `vsp.run.workers`. Raises ValueError for a policy that is not made of linear
    maps and Euclidean cells for MountainCar.
    """
    check_provable(policy, TASK, ["euclidean"])
    work = [(policy, low, high) for low, high in _cut(np.array([[LEFT, RIGHT]]), N_PARTS).tolist()]
    found = dict(workers.results(prove_part, work, "all starts", jobs=jobs, total=len(work), unit="parts"))
    return [found[i] for i in range(len(work))]


def prove_part(policy: VoronoiPolicy, low: float, high: float, n: int = N_PIECES // N_PARTS) -> Part:
    """Prove from which starts between `low` and `high` the car reaches the flag, by `n` pieces that are cut where
    needed. Where this fails, shorter pieces are tried: their remainders grow more slowly."""
    loop, longest, least, open_ranges = Loop(policy), 0, np.inf, _cut(np.array([[low, high]]), n)
    for _ in range(N_TRIALS):
        lost, steps, bound = _followed(loop, started(*open_ranges.T))
        longest, least, open_ranges = max(longest, steps), min(least, bound), _cut(lost.clip(low, high), SHORTER)
        if not 0 < len(open_ranges) <= MOST_AGAIN:
            break
    return Part(1.0 - _length(open_ranges) / (high - low), longest, least)


def _cut(ranges: np.ndarray, n: int) -> np.ndarray:
    """Cut each of `ranges` (m, 2) into `n` of the same length. (m n, 2)"""
    ends = np.linspace(*ranges.T, n + 1)
    return np.column_stack([ends[:-1].ravel(), ends[1:].ravel()])


def _followed(loop: Loop, pieces: Pieces) -> tuple[np.ndarray, int, float]:
    """Follow pieces to the flag. Return the ranges of starts that are given up (n, 2), the most steps of the others,
    and the least return."""
    lost, longest, least = [], 0, np.inf
    for t in range(1, TASK.max_steps + 1):
        pieces, arrived, failed = loop.step(pieces)
        lost.append(failed)
        if len(arrived):
            longest, least = t, min(least, 100.0 - SUMMED - float(arrived.cost.max()))
        if not len(pieces):
            break
    lost = joined([*lost, pieces])
    return np.column_stack([lost.low - MARGIN, lost.high + MARGIN]), longest, least


def started(low: np.ndarray, high: np.ndarray) -> Pieces:
    """Make pieces of the line of starts, with the car at rest."""
    zero, half = np.zeros(len(low)), (high - low) / 2
    centre, along = np.stack([(low + high) / 2, zero]), np.stack([half, zero])
    return Pieces(low, high, centre, along, np.full(len(low), ROUNDING), zero, np.full(len(low), -1))


class Loop:
    """The closed loop of a policy and the car."""

    def __init__(self, policy: VoronoiPolicy):
        weights = 1.0 / policy.scale**2
        self.slopes, self.offsets = 2 * policy.codewords * weights, np.square(policy.codewords) @ weights
        self.maps = policy.coefficients[:, :, 0]
        self.largest = 4 * float(np.abs(self.slopes).sum(axis=1).max() + self.offsets.max())  # the terms that cancel

    def step(self, pieces: Pieces) -> tuple[Pieces, Pieces, Pieces]:
        """Advance pieces by one step. Return those that go on, those that arrived, and those that are given up."""
        moved = self.moved(self.in_cells(pieces))
        speed, change, size = moved.ranges(0.0, 1.0, 0.0)
        sure = (np.abs(speed) + np.abs(change) + size < FASTEST) & (moved.rest < LOST)
        failed, (stopped, doubt, moved) = moved.at(~sure), _sides(moved.at(sure), WALL)
        moved = joined([moved, doubt, _at_wall(joined([stopped, doubt]))])
        below, doubt, above = _sides(moved, FLAG)  # a car that passes the flag was left of it: it does not roll back
        return joined([below, doubt]), joined([above, doubt]), failed

    def in_cells(self, pieces: Pieces) -> Pieces:
        """Return the parts of `pieces` with their cells; a sliver on a border is listed for each cell that it may be
        in."""
        decided = []
        while len(pieces):
            near = self.slopes @ pieces.centre - self.offsets[:, None]  # (k, n)
            best = near.argmax(axis=0)
            doubt = self._doubt(pieces, best, near)  # (k, n), at least 0 where another codeword may be nearer
            rival = doubt.argmax(axis=0)
            sure = doubt.max(axis=0) < 0
            decided.append(replace(pieces.at(sure), cell=best[sure]))
            pieces, best, rival = pieces.at(~sure), best[~sure], rival[~sure]
            if not len(pieces):
                break
            border = *(self.slopes[best] - self.slopes[rival]).T, self.offsets[rival] - self.offsets[best]
            below, sliver, above = pieces.cut(*border, self.largest)
            near = self.slopes @ sliver.centre - self.offsets[:, None]
            best = near.argmax(axis=0)
            doubt = self._doubt(sliver, best, near)
            doubt[best, np.arange(len(best))] = 0.0
            cells, index = np.nonzero(doubt >= 0)
            decided.append(replace(sliver.at(index), cell=cells))
            pieces = joined([below, above])
        return joined(decided)

    def _doubt(self, pieces: Pieces, best: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Bound by how much each codeword may be nearer than `best`, the nearest in the middle; -inf for `best` itself.
        (k, n)"""
        columns, found = np.arange(len(best)), np.empty_like(near)
        for k in range(len(near)):
            x, v = (self.slopes[best] - self.slopes[k]).T
            _, change, size = pieces.ranges(x, v, self.offsets[k] - self.offsets[best], self.largest)
            found[k] = np.abs(change) + size - (near[best, columns] - near[k])
        found[best, columns] = -np.inf
        return found

    def moved(self, pieces: Pieces) -> Pieces:
        """Advance the pieces by one step, cut where the action reaches a limit."""
        parts = []
        for side in (1, -1):
            x, v, bias = side * self.maps[pieces.cell].T
            value, change, size = pieces.ranges(x, v, bias - 1.0)
            beyond = value - np.abs(change) - size > 0
            doubtful = ~beyond & (value + np.abs(change) + size > 0)
            parts.append(self._after(pieces.at(beyond), side))
            if doubtful.any():
                x, v, bias = side * self.maps[pieces.cell[doubtful]].T
                below, sliver, above = pieces.at(doubtful).cut(x, v, bias - 1.0)
                parts += [self._after(above, side), self._after(sliver, 0)]
                pieces = joined([pieces.at(~beyond & ~doubtful), below])
            elif beyond.any():
                pieces = pieces.at(~beyond)
        return joined([*parts, self._after(pieces, 0)])

    def _after(self, pieces: Pieces, side: int) -> Pieces:
        """Advance the pieces by one step, with the action at a limit (side -1 or 1) or as the map gives it (side 0).
        Where the map goes a little beyond a limit, the remainder grows by as much."""
        x, v, bias = (0.0 if side else 1.0) * self.maps[pieces.cell].T
        action, change, size = pieces.ranges(x, v, bias + side)
        most = np.abs(action) + np.abs(change) + size
        position, velocity = pieces.centre
        p, q = POWER * x + 3 * PULL * np.sin(3 * position), 1.0 + POWER * v
        velocity = velocity + POWER * action - PULL * np.cos(3 * position)
        rise = p * pieces.along[0] + q * pieces.along[1]
        width = np.abs(pieces.along[0]) + pieces.rest
        error = BEND * width**2 + POWER * np.maximum(most - 1.0, 0.0) + 4 * ROUNDING
        error = error + POWER * ROUNDING * (np.abs(x) + np.abs(v) + np.abs(bias))
        rest = _norm(1.0 + p, q * SWING, p / SWING, q) * pieces.rest * (1 + 1e-12) + BOTH * error
        return replace(
            pieces, centre=np.stack([position + velocity, velocity]), along=np.stack([pieces.along[0] + rise, rise]),
            rest=rest, cost=pieces.cost + 0.1 * np.minimum(most, 1.0) ** 2, cell=np.full(len(pieces), -1),
        )  # fmt: skip


def _sides(pieces: Pieces, position: float) -> tuple[Pieces, Pieces, Pieces]:
    """Return the parts surely to the left of a position, the undecided parts, and the parts surely to the right."""
    gap, change, size = pieces.ranges(1.0, 0.0, -position)
    near = np.abs(gap) <= np.abs(change) + size
    left, doubt, right = pieces.at(near).cut(1.0, 0.0, -position)
    return joined([pieces.at(~near & (gap < 0)), left]), doubt, joined([pieces.at(~near & (gap > 0)), right])


def _at_wall(pieces: Pieces) -> Pieces:
    """Stop the pieces at the wall on the left: each is then a single state."""
    centre, zero = np.array([[WALL], [0.0]]) + 0 * pieces.centre, np.zeros(len(pieces))
    return replace(pieces, centre=centre, along=0 * pieces.along, rest=zero)


def _norm(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The largest singular value of ((a, b), (c, d))."""
    first, second, mixed = a * a + c * c, b * b + d * d, a * b + c * d
    return np.sqrt((first + second) / 2 + np.hypot((first - second) / 2, mixed))


def _length(ranges: np.ndarray) -> float:
    """Return the length of the union of `ranges` (n, 2)."""
    total, end = 0.0, -np.inf
    for low, high in sorted(ranges.tolist()):
        total, end = total + max(0.0, high - max(low, end)), max(end, high)
    return total
