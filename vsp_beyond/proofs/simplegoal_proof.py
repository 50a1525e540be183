"""Prove how the episodes of a policy end, from every start of SimpleGoal."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.tasks.base import GOAL, PIT, TRUNCATED

from .polygons import total
from .proof import Proof
from .simplegoal import IN_PIT, Piece, follow, within

ENDS = {GOAL: "goal", PIT: "pit", TRUNCATED: "left"}
SIDES = {-1: "-", 0: "=", 1: "+"}  # at the low limit or wall, at none, at the high one


@dataclass(frozen=True)
class SimpleGoalProof(Proof):
    """Convex pieces of the square of starts. All starts of a piece share the cell, the limits and the walls of every
    step.

    The proof is about real numbers. The program rounds, so it may behave differently near the borders of pieces. The
    lines between pieces have no area, and the proof says nothing about them. `steps_to_goal` covers borders and lines.
    """

    pieces: tuple[Piece, ...]

    @cached_property
    def areas(self) -> dict[str, Fraction]:
        """The exact area of the starts for each end of an episode: "goal", "pit", or "left" (neither, after all
        steps)."""
        return {
            name: total([piece.starts.area() for piece in self.pieces if piece.outcome == end])
            for end, name in ENDS.items()
        }

    @cached_property
    def failing_outside(self) -> Fraction:
        """The exact area of the starts outside the pit that do not reach the goal."""
        failing = [Piece(piece.starts) for piece in self.pieces if piece.outcome != GOAL]
        parts = [part for piece in failing for part in within(piece, IN_PIT)]
        return total([part.starts.area() for part, in_pit in parts if not in_pit])

    def polygons(self) -> list[np.ndarray]:
        """Return the corners of every piece (k, 2), as floats, for plots."""
        return [np.array(piece.starts.points()) for piece in self.pieces]

    @property
    def claim(self) -> dict:
        """The areas, as fractions, and the number of steps of the longest episode."""
        areas = {name: str(area) for name, area in self.areas.items()}
        return areas | {"longest": max(len(piece.steps) for piece in self.pieces)}

    def parts(self) -> list:
        """Return the itineraries as lines "end step step ...". A step such as "3+=--" gives the cell, the limit that
        each of the two actions reaches, and the wall that each coordinate of the next state reaches."""
        return sorted({_itinerary(piece) for piece in self.pieces})


def prove_simplegoal(policy: VoronoiPolicy) -> SimpleGoalProof:
    """Follow `policy` from every start of SimpleGoal to the end, in exact arithmetic. Takes seconds to a minute.

    Raises ValueError for a policy of another task or class, or with the metric "chebyshev"."""
    return SimpleGoalProof(policy, tuple(follow(policy)))


def _itinerary(piece: Piece) -> str:
    steps = [f"{step.cell}{''.join(SIDES[side] for side in (*step.limits, *step.walls))}" for step in piece.steps]
    return " ".join([ENDS[piece.outcome], *steps])
