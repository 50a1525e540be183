"""Draw the figure of docs/trust.md from data/beyond/kills.csv: how much time a kill costs."""

from __future__ import annotations

import os

from studies.results import read_results
from vsp import show


def save_kills(out: str | os.PathLike) -> None:
    """Write OUT/figures/kills.pdf and .png from the committed kill tests."""
    frame = read_results("kills")
    fig, (ax,) = show.panels(height=2.2)
    show.kills(ax, frame)
    held, share = frame["wrong"].isna().sum(), frame["again"] / frame["undisturbed"]
    alt = (
        f"How long a second make takes over the moment at which the first was killed: {held} of {len(frame)} end with "
        f"the same bytes, after {share.min():.0%} to {share.max():.0%} of the time that an undisturbed make takes."
    )
    show.save_figure(fig, "kills", out=out, alt=alt)
