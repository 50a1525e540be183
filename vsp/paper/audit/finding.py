"""What a finding is: what the paper prints, the arithmetic, and the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .. import printed

VERDICTS = HOLDS, CONTRADICTS, OPEN = "holds", "contradicts itself", "open"


@dataclass(frozen=True)
class Finding:
    """What the paper prints in one place, beside what follows from its other numbers."""

    title: str
    printed: str  # what the paper prints, and where
    arithmetic: str  # the computation with its numbers filled in
    verdict: str  # one of VERDICTS
    concerns: tuple[str, ...] = ()  # ids of the printed values that a contradiction puts in doubt


def compared(title: str, printed: str, arithmetic: str, agrees: bool, concerns: Sequence[str] = ()) -> Finding:
    """Return a finding that holds if the numbers agree, and otherwise puts `concerns` in doubt."""
    return Finding(title, printed, arithmetic, HOLDS if agrees else CONTRADICTS, () if agrees else tuple(concerns))


def quote(*ids: str) -> str:
    """Quote printed values and their places, without the transcription's own remarks after a semicolon."""
    rows = printed.printed_values().set_index("id").loc[list(ids)].itertuples()
    return "; ".join(f"{row.quantity} {row.paper} ({row.where.partition(';')[0]})" for row in rows)
