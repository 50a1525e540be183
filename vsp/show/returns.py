"""Figures of returns: distributions, intervals, the ledger.

seaborn is imported where it is used: the import takes a second, and most notebooks do not need it.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ..checks import check_array, check_finite
from ..evaluation import fences
from .style import COLOURS, DISTILLED, GOAL, TEACHER

_VERDICTS = {"reproduced": (GOAL, "o"), "differs": (COLOURS[3], "D"), "contradicts itself": (COLOURS[4], "X")}


def box_plot(ax: Axes, returns: dict[str, np.ndarray]) -> Axes:
    """Draw box plots of the returns of the teacher and of the distilled policies, in this order."""
    import seaborn as sns

    returns = {name: check_finite(f"returns of {name}", values) for name, values in returns.items()}
    colours = dict(zip(returns, (TEACHER, DISTILLED)))
    sns.boxplot(data=returns, ax=ax, palette=colours, width=0.5, showfliers=False, linewidth=0.8)
    ax.set(ylabel="return per episode")
    ax.set_xticks(range(len(returns)), [f"{name}\n(n = {values.size:,})" for name, values in returns.items()])
    return ax


def over_iterations(ax: Axes, values: np.ndarray, *, ylabel: str, log: bool = False) -> Axes:
    """Plot one quantity over the iterations of a distillation."""
    values = check_array("values", values, (-1,))
    ax.plot(np.arange(len(values)), values, color=DISTILLED)
    ax.set(xlabel="iteration n", ylabel=ylabel, yscale="log" if log else "linear")
    if not log:
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


def phase(ax: Axes, begin: int, name: str) -> Axes:
    """Shade the iterations from `begin` on and name them."""
    ax.axvspan(begin, ax.dataLim.x1, color="0.9", lw=0, zorder=0)
    ax.text(begin, 1.0, f" {name}", transform=ax.get_xaxis_transform(), va="bottom", fontsize=6)
    return ax


def run_means(ax: Axes, means: np.ndarray, teacher: float) -> Axes:
    """Plot the mean return of each run, sorted, against the teacher's."""
    means = check_array("means", means, (-1,))
    ax.plot(np.arange(1, len(means) + 1), np.sort(means), ".", color=DISTILLED, ms=4, label="distilled, one dot a run")
    ax.axhline(teacher, color=TEACHER, label="teacher")
    ax.set(xlabel="run, by mean return", ylabel="mean return")
    ax.legend(frameon=False, loc="lower right")
    return ax


def histogram(ax: Axes, returns: np.ndarray, *, bound: float | None = None) -> Axes:
    """Draw a histogram of the teacher's returns (n,), and their mean as a line; `bound`: the highest possible mean."""
    import seaborn as sns

    returns = check_array("returns", returns, (-1,))
    sns.histplot(returns, ax=ax, color=TEACHER, bins=40, edgecolor="white", linewidth=0.3)
    most = "" if bound is None else f"\n(at most\n{bound:.2f})"
    ax.axvline(returns.mean(), color="black", lw=0.8, label=f"mean {returns.mean():.2f}{most}")
    ax.set(xlabel="return per episode", ylabel="episodes")
    ax.legend(frameon=False, loc="upper left")
    return ax


def intervals(ax: Axes, frame: pd.DataFrame, *, color: str | list[str] = DISTILLED, label: str | None = None) -> Axes:
    """Draw a dot on its interval for each row of `frame` (index: names; columns here, low, high), the first on top."""
    rows = np.arange(len(frame))
    ax.hlines(rows, frame["low"], frame["high"], color=color, lw=1.2)
    ax.scatter(frame["here"], rows, color=color, s=10, zorder=3, label=label)
    ax.set_yticks(rows, frame.index)
    ax.set_ylim(len(frame) - 0.5, -0.5)
    ax.grid(axis="x", color="0.9", lw=0.5)
    ax.set_axisbelow(True)
    return ax


def again(ax: Axes, frame: pd.DataFrame) -> Axes:
    """Add a second measurement to the rows of `intervals`, as hollow dots; NaN where there is none."""
    rows = np.arange(len(frame))
    ax.hlines(rows, frame["low"], frame["high"], color="black", lw=0.6, zorder=4)
    ax.scatter(frame["here"], rows, facecolor="white", edgecolor="black", s=10, lw=0.6, zorder=5)
    return ax


def margin(ax: Axes, texts: list[str], title: str) -> Axes:
    """Write a text beside each row of `intervals`, right of the axes, under a title."""
    for row, text in enumerate([title, *texts], start=-1):
        ax.text(1.03, row, text, transform=ax.get_yaxis_transform(), va="center", fontsize=7, color="0.3")
    return ax


def reference(ax: Axes, value: float, name: str, *, color: str = TEACHER, ls: str = "-") -> Axes:
    """Draw a vertical line at a reference value."""
    ax.axvline(value, color=color, lw=0.8, ls=ls, zorder=1, label=name)
    return ax


def ledger_gaps(ax: Axes, frame: pd.DataFrame, *, band: float) -> Axes:
    """Plot the paper's values minus the rerun's, in half-widths of the rerun's intervals: one row per value.

    `frame` (index: names) has the columns gap, verdict and wide (drawn hollow). Values inside the shaded `band` count
    as reproduced. The scale is linear in the band and logarithmic outside.
    """
    ax.axvspan(-band, band, color="0.9", lw=0, label="reproduced if here")
    ax.axvline(0, color="0.6", lw=0.6)
    for verdict, (color, marker) in _VERDICTS.items():
        rows = np.flatnonzero(frame["verdict"] == verdict)
        faces = ["white" if wide is True else color for wide in frame["wide"].iloc[rows]]
        ax.scatter(frame["gap"].iloc[rows], rows, color=faces, edgecolor=color, marker=marker, s=14, lw=0.8, zorder=3)
        ax.scatter([], [], color=color, marker=marker, s=14, label=verdict)
    limit = max(10_000, 2 * frame["gap"].abs().max())
    ax.set_xscale("symlog", linthresh=band)
    ax.set(xlim=(-limit, limit), xticks=[-1000, -10, 0, 10, 1000])
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_yticks(np.arange(len(frame)), frame.index)
    ax.set_ylim(len(frame) - 0.5, -0.5)
    return ax


def boxes(ax: Axes, quartiles: dict[str, tuple[float, float, float]], *, colours: list[str]) -> Axes:
    """Draw horizontal boxes from Q1, median and Q3; whiskers end at the bounds beyond which a return is an outlier."""
    stats = [
        {"label": name, "q1": q1, "med": median, "q3": q3, "fliers": []}
        | dict(zip(("whislo", "whishi"), fences(q1, q3), strict=True))
        for name, (q1, median, q3) in quartiles.items()
    ]
    places = np.arange(len(stats))
    drawn = ax.bxp(stats, positions=places, orientation="horizontal", showfliers=False, patch_artist=True, widths=0.5)
    for box, colour in zip(drawn["boxes"], colours):
        box.set(facecolor=colour, alpha=0.6)
    for line in drawn["medians"]:
        line.set(color="black")
    ax.set_ylim(len(stats) - 0.4, -0.6)
    return ax


def by_group(ax: Axes, frame: pd.DataFrame, *, x: str, y: str) -> Axes:
    """Draw one dot per row of `frame`, in columns by `x`, with a bar at the mean of each column."""
    import seaborn as sns

    sns.swarmplot(frame, x=x, y=y, ax=ax, color=DISTILLED, size=3)
    for place, mean in enumerate(frame.groupby(x, sort=False)[y].mean()):
        ax.hlines(mean, place - 0.3, place + 0.3, color="black", lw=1.2, zorder=4, label="mean" if not place else None)
    return ax
