"""SimpleGoal: how the episodes of a policy end, from every start."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from ...policy import VoronoiPolicy
from ...tasks.base import GOAL, PIT, TRUNCATED
from . import returns
from .polygons import total
from .proof import Proof
from .simplegoal import Piece, follow

ENDS = {GOAL: "goal", PIT: "pit", TRUNCATED: "left"}
SIDES = {-1: "-", 0: "=", 1: "+"}  # the low limit or wall, none, the high one


@dataclass(frozen=True)
class SimpleGoalProof(Proof):
    """Convex pieces of the square of starts, which share every step.

    It is about real numbers. The program rounds, so near the borders of pieces it may do otherwise. The lines between
    pieces have no area, and nothing is said of them. `steps_to_goal` covers both.
    """

    pieces: tuple[Piece, ...]

    @cached_property
    def areas(self) -> dict[str, Fraction]:
        """The exact areas of the starts by how their episodes end: "goal", "pit", or "left" after all steps."""
        return {
            name: total([piece.starts.area() for piece in self.pieces if piece.outcome == end])
            for end, name in ENDS.items()
        }

    @property
    def longest(self) -> int:
        """The most steps of an episode."""
        return max(len(piece.steps) for piece in self.pieces)

    def mean_return(self) -> tuple[float, float]:
        """Bounds of the mean return over all starts, at most 1e-6 apart."""
        return returns.mean_return(self.pieces)

    def worst_start(self) -> tuple[np.ndarray, float]:
        """A start (2,) whose return is the lowest, to 1e-6, and this return."""
        return returns.worst_start(self.pieces)

    @property
    def claim(self) -> dict:
        """The areas, as fractions, and the most steps."""
        return {**{name: str(area) for name, area in self.areas.items()}, "longest": self.longest}

    def parts(self) -> list:
        """The itineraries: lines "end step step ...", where each step is the cell, at which limits the two actions are,
        and at which walls the next state, as in "3+=--"."""
        return sorted({_itinerary(piece) for piece in self.pieces})


def prove_simplegoal(policy: VoronoiPolicy) -> SimpleGoalProof:
    """Follow `policy` from every start of SimpleGoal to the end, in exact arithmetic; seconds to a minute.

    Raises ValueError for a policy of another task or class, or with the metric "chebyshev".
    """
    return SimpleGoalProof(policy, tuple(follow(policy)))


def _itinerary(piece: Piece) -> str:
    steps = [f"{step.cell}{''.join(SIDES[side] for side in (*step.limits, *step.walls))}" for step in piece.steps]
    return " ".join([ENDS[piece.outcome], *steps])
