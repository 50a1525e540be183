"""Figures of the comparison of methods."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from vsp.show.style import OTHER, OURS, TEACHER

# Methods of tables; names of tuned ones end with ", tuned". Ours have their colour, others a grey and a marker. Labels
# stand at the ends of the lines, `up` points above them
TUNING: dict[str, dict] = {
    "our cells": {"color": OURS, "lw": 1.8, "zorder": 5, "label": "our cells", "up": -4},
    "oblique tree, linear leaves, DAgger": {"color": OTHER, "marker": "^", "label": "oblique tree", "up": 4},
    "small network, DAgger": {"color": "0.6", "marker": "P", "label": "small network"},
}

# Our policies, by where their search begins
LIMITS: dict[str, dict] = {
    "at the limit": {"color": OURS, "lw": 1.8, "zorder": 6, "label": "from the best policy"},
    "our cells, tuned": {"color": OURS, "ls": "--", "label": "from the teacher"},
}

# Policies of robots, in the order of their returns with sixteen cells or leaves
ROBOTS: dict[str, dict] = {
    "oblique tree, trained further": {"color": OTHER, "marker": "^", "label": "trees, trained further"},
    "cells, trained further": {"color": OURS, "lw": 1.8, "zorder": 5, "label": "our cells, trained further"},
    "oblique tree": {"color": OTHER, "ls": "--", "marker": "^", "label": "trees, imitation alone"},
    "cells": {"color": OURS, "ls": "--", "label": "our cells, imitation alone"},
}

# Marks of `fidelity_map`: label, its side of the mark, colour and marker
MARKED = {
    "teacher": ("teacher", "right", TEACHER, "D"),
    "faithful": ("ours, most alike and as good", "corner", OURS, "o"),
    "faithful, R² 0.9": ("ours, with an R² of 0.9", "above", OURS, "o"),
    "our cells, tuned": ("ours, tuned for the return", "below", OURS, "o"),
    "oblique tree, linear leaves, DAgger": ("tree, fitted to the teacher", "left", OTHER, "^"),
    "oblique tree, our fit": ("tree, fitted as our cells are", "left", OTHER, "^"),
    "oblique tree, linear leaves, DAgger, tuned": ("tree, tuned for the return", "right", OTHER, "^"),
}
SIDES = {"left": ((-6, 0), "right", "center"), "right": ((6, 0), "left", "center"),
         "above": ((5, 6), "right", "bottom"), "below": ((6, -5), "left", "top"),
         "corner": ((-2, -6), "right", "top")}  # fmt: skip


def fidelity_map(ax: Axes, points: pd.DataFrame) -> Axes:
    """Plot mean return over R²: policies further right act more like the teacher, policies higher up return more.

    `points` has the columns method, mean and r2. Methods in `MARKED` are drawn; a line joins ours.
    """
    ax.axvline(0, color="0.8", lw=0.8)
    ax.text(-0.02, 0.05, "a constant action", transform=ax.get_xaxis_transform(), ha="right", fontsize=7, color=OTHER)
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
    ax.axhline(0.9, color="black", ls=":", lw=0.8)
    ax.text(0.6, 0.91, "R² of 0.9", fontsize=7, va="bottom")
    for (title, table), shade in zip(tables.items(), ("#93418a", "#4a1c43", "#d67fc9", "#b660a9")):
        ax.plot(table["size"], table["r2"], color=shade, marker="o", ms=3.5, lw=1.4)
        first = table.loc[0, ["size", "r2"]]
        look = {"ha": "right", "va": "center", "fontsize": 7, "color": shade}
        ax.annotate(title, first, (-6, 0), textcoords="offset points", **look)
    ax.set(xlim=(0.58, 14), xlabel="cells", ylabel="R² of the actions")
    return _ticks_at(ax, pd.concat(tables)["size"])


def over_cells(ax: Axes, frame: pd.DataFrame, column: str, looks: dict[str, dict]) -> Axes:
    """Plot a column of `frame` over the number of cells or leaves: one labelled line per method, the median of its seeds.

    `frame` has the columns method, size and seed of `studies.comparison`. Only the methods in `looks` are drawn. Our
    bands span the 10 % to 90 % quantiles over the seeds.
    """
    ax.set_xscale("log")
    for method, look in looks.items():
        up, look = look.get("up", 0), {name: value for name, value in look.items() if name != "up"}
        rows = frame[frame["method"] == method]
        low, middle, high = (rows.groupby("size")[column].quantile(share) for share in (0.1, 0.5, 0.9))
        ax.plot(middle.index, middle, **{"lw": 0.9, "marker": ".", "ms": 4, "label": method, **look})
        end = {"textcoords": "offset points", "va": "center", "fontsize": 7, "color": look["color"]}
        ax.annotate(look.get("label", method), (middle.index[-1], middle.iloc[-1]), (6, up), **end)
        if look["color"] == OURS:
            ax.fill_between(middle.index, low, high, color=OURS, alpha=0.2, lw=0)
    ax.margins(x=0.02)
    ax.set_xlabel("cells or leaves")
    return _ticks_at(ax, frame.loc[frame["method"].isin(looks) & (frame["size"] > 0), "size"])


def _ticks_at(ax: Axes, values: pd.Series) -> Axes:
    """Put ticks at exactly these values."""
    places = np.unique(values.astype(int))
    ax.set_xticks(places, [str(place) for place in places])
    ax.minorticks_off()
    return ax
