"""Figures of benchmarks: the time of look-ups, neighbour graphs and fits, and the cost of a killed run."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from vsp.show.style import COLOURS, DISTILLED, GOAL, OTHER, TEACHER

from .methods import ticks_at

# Colours of the methods that `beyond.benchmarks.lookup` measures; lines for the Manhattan distance are dashed
_METHODS = {"cdist": OTHER, "matrix product": GOAL, "kd-tree": COLOURS[4]}
_METHODS |= {"witnesses": GOAL, "linear programmes": OTHER, "Delaunay": COLOURS[3]}


def times_over_dimension(ax: Axes, frame: pd.DataFrame, *, limit: float | None = None) -> Axes:
    """Plot seconds over the number of dimensions, both logarithmic: one line per method and metric.

    `frame` has rows of `beyond.benchmarks.lookup` for one number of codewords. A missing time means more than `limit`
    seconds; a cross marks the first missing time of each line.
    """
    for (method, metric), rows in frame.groupby(["method", "metric"], sort=False):
        dashed, color = metric == "manhattan", _METHODS[method]
        name = f"{method}, Manhattan" if dashed else method
        ax.plot(rows["d"], rows["seconds"], "--" if dashed else "-", marker=".", ms=3, color=color, label=name)
        given_up = rows.loc[rows["seconds"].isna(), "d"]
        if len(given_up) and limit:
            ax.plot(given_up.min(), limit, "x", color=color, ms=5, mew=1.2, clip_on=False, zorder=5)
    ax.set(xscale="log", yscale="log", xlabel="dimensions", ylabel="seconds")
    return ticks_at(ax, frame["d"])


def fit_times(ax: Axes, frame: pd.DataFrame, varied: str) -> Axes:
    """Plot the milliseconds per evaluation of the loss over the quantity `varied`, both logarithmic.

    The dotted line is proportional to `varied`. `frame` has rows of `beyond.benchmarks.fits`.
    """
    rows = frame[frame["varied"] == varied]
    taken = 1000 * rows["seconds"]
    ax.plot(rows[varied], taken, marker=".", ms=4, color=DISTILLED, label="measured")
    ax.plot(rows[varied], taken.iloc[-1] * rows[varied] / rows[varied].iloc[-1], ":", color=OTHER, label="proportional")
    ax.set(xscale="log", yscale="log", xlabel="inputs" if varied == "dimensions" else varied)
    return ticks_at(ax, rows[varied])


def kills(ax: Axes, frame: pd.DataFrame) -> Axes:
    """Plot the time of the re-run over the moment of the kill, both as shares of the time of an undisturbed run."""
    moment, again = frame["moment"] / frame["undisturbed"], frame["again"] / frame["undisturbed"]
    held = frame["wrong"].isna()
    ax.axhline(1, color=TEACHER, lw=0.8, label="undisturbed, from nothing")
    ax.plot(moment[held], again[held], "o", color=DISTILLED, ms=3, label="the same bytes")
    if not held.all():
        ax.plot(moment[~held], again[~held], "X", color=COLOURS[3], ms=5, label="other bytes")
    ax.set(xlabel="moment of the kill", ylabel="time of the re-run", xlim=(0, 1), ylim=(0, None))
    ax.xaxis.set_major_formatter(PercentFormatter(1))
    ax.yaxis.set_major_formatter(PercentFormatter(1))
    ax.legend(loc="lower left", frameon=False)
    return ax
