"""Figures of the comparison of methods."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from vsp.show.style import OTHER, OURS, TEACHER

# Methods of tables, after tuning (solid) and before it (dashed). Ours have their colour, others a grey and a marker
TUNING: dict[str, dict] = {
    "our cells, tuned": {"color": OURS, "lw": 1.8, "zorder": 5, "label": "our cells, tuned"},
    "oblique tree, linear leaves, DAgger, tuned": {"color": OTHER, "marker": "^", "label": "oblique tree, tuned"},
    "small network, DAgger, tuned": {"color": "0.65", "marker": "P", "label": "small network, tuned"},
    "our cells": {"color": OURS, "ls": "--", "lw": 1.4, "zorder": 4, "label": "our cells"},
    "oblique tree, linear leaves, DAgger": {"color": OTHER, "ls": "--", "marker": "^", "label": "oblique tree"},
    "small network, DAgger": {"color": "0.65", "ls": "--", "marker": "P", "label": "small network"},
}

# Our policies, by where their search begins
LIMITS: dict[str, dict] = {
    "at the limit": {"color": OURS, "lw": 1.8, "zorder": 6, "label": "search begins at the best policy"},
    "our cells, tuned": {"color": OURS, "ls": "--", "label": "search begins at the teacher"},
}

# Policies of robots, in the order of their returns with sixteen cells or leaves
ROBOTS: dict[str, dict] = {
    "oblique tree, trained further": {"color": OTHER, "marker": "^", "label": "oblique tree, trained further"},
    "cells, trained further": {"color": OURS, "lw": 1.8, "zorder": 5, "label": "our cells, trained further"},
    "oblique tree": {"color": OTHER, "ls": "--", "marker": "^", "label": "oblique tree, imitation alone"},
    "cells": {"color": OURS, "ls": "--", "label": "our cells, imitation alone"},
}

# Marks of `fidelity_map`: label, its side of the mark, colour and marker
MARKED = {
    "teacher": ("teacher", "bottom", TEACHER, "D"),
    "faithful": ("ours, most like the teacher and as good", "left", OURS, "o"),
    "faithful, R² 0.9": ("ours, with an R² of 0.9", "top", OURS, "o"),
    "our cells, tuned": ("ours, tuned for the return", "top", OURS, "o"),
    "oblique tree, linear leaves, DAgger": ("tree, fitted to the teacher", "left", OTHER, "^"),
    "oblique tree, our fit": ("tree, fitted as our cells are", "left", OTHER, "^"),
    "oblique tree, linear leaves, DAgger, tuned": ("tree, tuned for the return", "right", OTHER, "^"),
}
SIDES = {"left": ((-6, 0), "right", "center"), "right": ((6, 0), "left", "center"),
         "top": ((0, 5), "center", "bottom"), "bottom": ((0, -5), "center", "top")}  # fmt: skip


def fidelity_map(ax: Axes, points: pd.DataFrame) -> Axes:
    """Plot mean return over R²: policies further right act more like the teacher, policies higher up return more.

    `points` has the columns method, mean and r2. Methods in `MARKED` are drawn; a line joins ours.
    """
    places = points.set_index("method").loc[list(MARKED), ["r2", "mean"]]
    ax.plot(*places[places.index.str.match("faithful|our cells")].sort_values("r2").T.to_numpy(), color=OURS)
    for method, (label, side, color, marker) in MARKED.items():
        place, (away, ha, va) = places.loc[method], SIDES[side]
        ax.plot(*place, marker, color=color, mec="white", mew=0.4, ms=6, zorder=5)
        ax.annotate(label, place, away, textcoords="offset points", ha=ha, va=va, fontsize=7, color=color)
    ax.set(xlabel="R² of the actions", ylabel="mean return")
    return ax


def likeness_over_cells(ax: Axes, tables: dict[str, pd.DataFrame]) -> Axes:
    """Plot R² over the number of cells, a line per task, from tables of `studies.comparison.likeness` by title."""
    ax.set_xscale("log")
    for (title, table), marker in zip(tables.items(), "os^D"):
        ax.plot(table["size"], table["r2"], color=OURS, marker=marker, ms=3.5)
        first = table.loc[0, ["size", "r2"]]
        ax.annotate(title, first, (-6, 0), textcoords="offset points", ha="right", va="center", fontsize=7)
    ax.set(xlim=(0.58, 14), xlabel="cells", ylabel="R² of the actions")
    return _ticks_at(ax, pd.concat(tables)["size"])


def over_cells(ax: Axes, frame: pd.DataFrame, column: str, looks: dict[str, dict]) -> Axes:
    """Plot a column of `frame` over the number of cells or leaves: one line per method, the median of its seeds.

    `frame` has the columns method, size and seed of `studies.comparison`. Only the methods in `looks` are drawn. Our
    bands span the 10 % to 90 % quantiles over the seeds.
    """
    ax.set_xscale("log")
    for method, look in looks.items():
        rows = frame[frame["method"] == method]
        low, middle, high = (rows.groupby("size")[column].quantile(share) for share in (0.1, 0.5, 0.9))
        ax.plot(middle.index, middle, **{"lw": 0.9, "marker": ".", "ms": 4, "label": method, **look})
        if look["color"] == OURS:
            ax.fill_between(middle.index, low, high, color=OURS, alpha=0.2, lw=0)
    ax.set_xlabel("cells or leaves")
    return _ticks_at(ax, frame.loc[frame["method"].isin(looks) & (frame["size"] > 0), "size"])


def _ticks_at(ax: Axes, values: pd.Series) -> Axes:
    """Put ticks at exactly these values."""
    places = np.unique(values.astype(int))
    ax.set_xticks(places, [str(place) for place in places])
    ax.minorticks_off()
    return ax
