"""Figures of the comparison of methods."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from vsp.show.style import COLOURS, DISTILLED, OTHER, TEACHER

# Methods before tuning, and our cells after it. Ours has its own colour; the two weakest methods are grey
IMITATIONS: dict[str, dict] = {
    "our cells, tuned": {"color": DISTILLED, "lw": 1.8, "zorder": 5, "label": "our cells, tuned on the return"},
    "our cells": {"color": DISTILLED, "ls": "--", "lw": 1.4, "zorder": 4, "label": "our cells"},
    "oblique tree, linear leaves, DAgger": {"color": COLOURS[3], "label": "oblique tree, linear leaves"},
    "small network, DAgger": {"color": COLOURS[9], "label": "small network"},
    "CART, DAgger": {"color": OTHER, "label": "axis tree, constants"},
    "k-means cells, DAgger": {"color": "0.65", "ls": "--", "label": "k-means cells, linear maps"},
}

# Our policies, from the best policy and from the teacher, and their rivals
LIMITS: dict[str, dict] = {
    "at the limit": {"color": COLOURS[2], "lw": 1.8, "zorder": 6, "label": "our cells, from the best policy"},
    "our cells, tuned": {"color": DISTILLED, "lw": 1.8, "zorder": 5, "label": "our cells, from the teacher"},
    "oblique tree, linear leaves, DAgger, tuned": {"color": COLOURS[3], "label": "oblique tree, linear leaves"},
    "small network, DAgger, tuned": {"color": COLOURS[9], "label": "small network"},
    "one linear map, tuned": {"color": "black", "marker": "s", "label": "one linear map"},
}


# Policies of robots
ROBOTS: dict[str, dict] = {
    "cells, trained further": {"color": DISTILLED, "lw": 1.8, "zorder": 5, "label": "our cells, trained further"},
    "cells": {"color": DISTILLED, "ls": "--", "label": "our cells, imitation alone"},
    "one map, random search": {"color": "black", "marker": "s", "label": "one linear map, random search"},
    "one map, longer search": {"color": "black", "marker": "D", "label": "one linear map, longer search"},
    "oblique tree, trained further": {"color": COLOURS[3], "label": "oblique tree, trained further"},
    "oblique tree": {"color": COLOURS[3], "ls": "--", "label": "oblique tree, imitation alone"},
}

# Marker and label of other methods, by the beginning of their names
RIVAL_KINDS = {"oblique tree": ("^", "oblique tree"), "CART": ("s", "axis tree"), "k-means": ("D", "k-means"),
               "small network": ("P", "small network"),
               "critic-driven": ("<", "critic-driven"), "advantage-weighted": (">", "advantage-weighted")}  # fmt: skip
OUR_SIZES = {2: COLOURS[1], 4: COLOURS[2], 8: COLOURS[4]}  # colours of our lines in `fidelity_map`, by number of cells
MARK = {"ls": "", "ms": 4.5, "mec": "white", "mew": 0.4, "elinewidth": 0.7, "zorder": 6}  # of a method without a size
LARGEST = 13  # most leaves of a method drawn there


def fidelity_map(ax: Axes, points: pd.DataFrame, teacher: float, *, linear: float) -> Axes:
    """Plot return over fidelity. Policies further right act more like the teacher; policies higher up return more.

    `points` has the columns method, size, mean and r2 of `studies.comparison.possible`. Each line is ours with one
    number of cells. It runs from the highest R² (circle), through the highest returns at a given R², to the highest
    return (star). Marks are other methods by kind: open for imitation, filled if tuned, larger for more leaves. The
    scale is logarithmic in 1 - R², and in the return beyond `linear`.
    """
    points = points.assign(unlike=1.0 - points["r2"], gap=points["mean"] - teacher)
    others = points[points["size"] <= LARGEST]
    for start, (marker, kind) in RIVAL_KINDS.items():
        rows = others[others["method"].str.startswith(start)]
        tuned = rows["method"].str.endswith(", tuned")
        look = {"marker": marker, "edgecolor": OTHER, "lw": 0.5, "alpha": 0.7}
        for part, face, name in ((rows[~tuned], "none", kind), (rows[tuned], OTHER, None)):
            ax.scatter(part["unlike"], part["gap"], s=6 + 1.5 * part["size"], facecolor=face, label=name, **look)
    maps = points[points["method"].str.startswith("one linear map")]
    ax.scatter(maps["unlike"], maps["gap"], marker="x", s=18, color="black", lw=1.0, label="one linear map", zorder=4)
    for size, color in OUR_SIZES.items():
        _our_line(ax, points[points["size"] == size], color, f"ours, {size} cells")
    ax.axhline(0, color=TEACHER, ls="--", lw=1.0, zorder=3, label="teacher’s return")
    ax.axvline(1, color=OTHER, ls=":", lw=0.8, label="a constant")
    ax.set_yscale("symlog", linthresh=linear)
    ax.margins(y=0.08)
    ax.yaxis.set_major_formatter("{x:g}")
    drawn = points.loc[(points["size"] <= LARGEST) & (points["method"] != "teacher"), "unlike"]
    ax.set(xscale="log", xlim=(1.3 * drawn.max(), drawn.min() / 1.3), xlabel="R² of the actions")
    ticks = {5: "−4", 1: "0", 0.3: ".7", 0.1: ".9", 0.05: ".95", 0.01: ".99", 0.001: ".999"}
    ax.set_xticks(list(ticks), list(ticks.values()))
    ax.set_xlim(1.3 * drawn.max(), drawn.min() / 1.3)  # again: ticks beyond these limits widen them
    ax.minorticks_off()
    return ax


def _our_line(ax: Axes, points: pd.DataFrame, color: str, label: str) -> None:
    rows = points[points["method"].str.match("faithful|our cells, tuned$")].sort_values("unlike")
    ax.plot(rows["unlike"], rows["gap"], color=color, lw=1.2, marker=".", ms=4, zorder=5, label=label)
    for method, marker in (("faithful", "o"), ("our cells, tuned", "*")):
        end = rows[rows["method"] == method]
        ax.plot(end["unlike"], end["gap"], marker, color=color, mec="white", mew=0.4, ms=6, zorder=6)


def likeness_over_cells(ax: Axes, table: pd.DataFrame) -> Axes:
    """Plot three measures of likeness over the number of cells, from the `table` of `studies.comparison.likeness`.

    These are R² of the actions (band: from the lowest seed to the median), sameness of the cells, and ratio of the
    actions' differences.
    """
    ax.set_xscale("log")
    ax.fill_between(table["size"], table["r2_least"], table["r2"], color=TEACHER, alpha=0.2, lw=0)
    for column, color, marker, label in (
        ("r2", TEACHER, "o", "R², median (band: to the lowest)"),
        ("index", DISTILLED, "s", "sameness of the cells"),
        ("ratio", COLOURS[2], "^", "ratio of the actions’ differences"),
    ):
        ax.plot(table["size"], table[column], color=color, marker=marker, ms=3.5, label=label)
    ax.set_ylim(min(0.0, table["r2_least"].min()) - 0.05, 0.05 + max(1.0, table["ratio"].max()))
    ax.set_xlabel("cells")
    return _ticks_at(ax, table.loc[table["size"] != 7, "size"])  # the label of 7 would touch that of 8


def return_over_cells(
    ax: Axes, frame: pd.DataFrame, teacher: float, *, linear: float, looks: dict[str, dict] = IMITATIONS
) -> Axes:
    """Plot `over_cells` of the mean return minus the teacher's, on a scale linear up to `linear`, then logarithmic."""
    ax.set_yscale("symlog", linthresh=linear)
    over_cells(ax, frame.assign(gap=frame["mean"] - teacher), "gap", looks)
    ax.axhline(0, color=TEACHER, ls="--", lw=1.0, zorder=3, label="teacher")
    ax.set_ylabel("mean return − teacher’s")
    ax.yaxis.set_major_formatter("{x:g}")
    return ax


def over_cells(ax: Axes, frame: pd.DataFrame, column: str, looks: dict[str, dict] = IMITATIONS) -> Axes:
    """Plot a column of `frame` over the number of cells or leaves: one line per method, the median of its seeds.

    `frame` has the columns method, size, seed and cells of `studies.comparison`. Only the methods in `looks` are drawn.
    A method that chooses its own size (size 0) is a mark at its median number of cells. Our bands and the error bars of
    marks span the 10 % to 90 % quantiles over the seeds.
    """
    ax.set_xscale("log")
    for method, style in looks.items():
        rows = frame[frame["method"] == method]
        if not len(rows):
            continue
        low, middle, high = (rows.groupby("size")[column].quantile(share) for share in (0.1, 0.5, 0.9))
        if "marker" not in style:
            ax.plot(middle.index, middle, **{"lw": 0.9, "marker": ".", "ms": 4, "label": method, **style})
            if style["color"] == DISTILLED and len(middle) > 2:  # a band over fewer sizes would hide more than it shows
                ax.fill_between(middle.index, low, high, color=DISTILLED, alpha=0.2, lw=0)
            continue
        bounds = [middle - low, high - middle]
        ax.errorbar(max(1, rows["cells"].median()), middle, bounds, **MARK | {"label": method} | style)
    ax.set_xlabel("cells or leaves")
    return _ticks_at(ax, frame.loc[frame["method"].isin(looks) & (frame["size"] > 0), "size"])


def _ticks_at(ax: Axes, values: pd.Series) -> Axes:
    """Put ticks at exactly these values."""
    places = np.unique(values.astype(int))
    ax.set_xticks(places, [str(place) for place in places])
    ax.minorticks_off()
    return ax
