"""Figures of the comparison of methods."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from vsp.show.style import OTHER, OURS, TEACHER

# Methods of tables; names of tuned ones end with ", tuned". Ours have their colour, others a grey and a marker. Labels
# stand at the ends of the lines, `up` points above them
TUNING: dict[str, dict] = {
    "our cells": {"color": OURS, "lw": 1.8, "zorder": 5, "label": "our cells", "up": -4},
    "oblique tree, linear leaves, DAgger": {"color": "0.2", "marker": "^", "label": "oblique tree", "up": 5},
    "small network, DAgger": {"color": "0.6", "marker": "P", "label": "small network", "up": 5},
}

# Our policies, by where their search begins
LIMITS: dict[str, dict] = {
    "at the limit": {"color": OURS, "lw": 1.8, "zorder": 6, "label": "from the best policy"},
    "our cells, tuned": {"color": OURS, "ls": "--", "label": "from the teacher", "up": 8},
}

# Policies of robots, in the order of their returns with sixteen cells or leaves
ROBOTS: dict[str, dict] = {
    "oblique tree, trained further": {"color": OTHER, "marker": "^", "label": "trees, trained further"},
    "cells, trained further": {"color": OURS, "lw": 1.8, "zorder": 5, "label": "our cells, trained further"},
    "oblique tree": {"color": OTHER, "ls": "--", "marker": "^", "label": "trees, imitation alone"},
    "cells": {"color": OURS, "ls": "--", "label": "our cells, imitation alone"},
}

# Marks of `fidelity_map`: label, its place beside the mark in points, colour and marker
MARKED = {
    "teacher": ("teacher", (6, -1), TEACHER, "D"),
    "faithful": ("ours, most alike", (-6, -1), OURS, "o"),
    "faithful, R² 0.9": ("ours, R² of 0.9", (-6, 4), OURS, "o"),
    "our cells, tuned": ("ours, tuned for the return", (4, -8), OURS, "o"),
    "oblique tree, linear leaves, DAgger": ("tree, fitted to the teacher", (-6, -1), OTHER, "^"),
    "oblique tree, our fit": ("tree, fitted as our cells are", (-6, -1), OTHER, "^"),
    "oblique tree, linear leaves, DAgger, tuned": ("tree, tuned for the return", (6, -1), OTHER, "^"),
}


def fidelity_map(ax: Axes, points: pd.DataFrame) -> Axes:
    """Plot mean return over R²: policies further right act more like the teacher, policies higher up return more.
    `points` has the columns method, mean and r2. Methods in `MARKED` are drawn; a line joins ours."""
    ax.axvline(0, color="0.8", lw=0.8)
    places = points.set_index("method").loc[list(MARKED), ["r2", "mean"]]
    ax.plot(*places[places.index.str.match("faithful|our cells")].sort_values("r2").T.to_numpy(), color=OURS)
    for method, (label, away, color, marker) in MARKED.items():
        place, ha = places.loc[method], "left" if away[0] > 0 else "right"
        ax.plot(*place, marker, color=color, mec="white", mew=0.4, ms=6, zorder=5)
        ax.annotate(label, place, away, textcoords="offset points", ha=ha, va="center", fontsize=7, color=color)
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
    """Plot a column of `frame` over the number of cells or leaves: one labelled line per method, the median of its
    seeds. `frame` has the columns method, size and seed of `studies.comparison`. Only the methods in `looks` are drawn.
    Our bands span the 10 % to 90 % quantiles over the seeds."""
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
    places = np.unique(values.astype(int))
    ax.set_xticks(places, [str(place) for place in places])
    ax.minorticks_off()
    return ax
