"""Pictures of what was measured of speed, scale and cost. Arrays and frames in, `Axes` out, as in `figures.py`."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, NullFormatter, PercentFormatter

from .figures import COLOURS, DISTILLED, GOAL, OTHER, TEACHER
from .scaling import POINTS, power_law

_LINES = (DISTILLED, TEACHER, GOAL, COLOURS[4])
_MARKS = "osD^"
_PARTS = {"teacher": TEACHER, "physics": OTHER, "distillation": DISTILLED, "evaluation": GOAL}


def growth(ax: Axes, frame: pd.DataFrame, quantity: str = "seconds", *, law: bool = True) -> Axes:
    """`quantity` over size n, logarithmic: a mark per measurement, dashed the fitted law; the legend is below.

    Without a `law`, or with fewer sizes than it needs, marks are joined.
    """
    frame = frame.dropna(subset=[quantity])
    for (what, part), color, mark in zip(
        frame.groupby("what", sort=False), itertools.cycle(_LINES), itertools.cycle(_MARKS)
    ):
        sizes, values = part["size"].to_numpy(), part[quantity].to_numpy()
        label, fits = what.partition(",")[0], law and len(part) >= POINTS
        if fits:
            upper, fitted, exponent, _ = power_law(sizes, values)
            ax.plot(upper, fitted, color=color, ls="--", lw=0.8)
            label += f", $n^{{{exponent:.1f}}}$"
        ax.plot(sizes, values, mark, color=color, ms=3.5, ls="" if fits else "-", label=label)
    ax.set(xscale="log", yscale="log", xlabel=f"$n$ = {frame['over'].iloc[0]}", ylabel=quantity)
    _few_numbers(ax.xaxis, frame["size"])
    _few_numbers(ax.yaxis, frame[quantity])
    ax.legend(
        loc="upper left", bbox_to_anchor=(-0.35, -0.28), frameon=False, borderaxespad=0, handletextpad=0, fontsize=6
    )
    return ax


def _few_numbers(axis: Axis, values: pd.Series) -> None:
    """Numbers along a logarithmic axis: at 1, 2 and 5 where `values` span less than two decades, else at decades."""
    if values.max() < 100 * values.min():
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def kills(ax: Axes, frame: pd.DataFrame) -> Axes:
    """How long the re-run took over the moment of the kill, both as shares of the time of a run nobody disturbed."""
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


def told(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table of trust.csv that tell how many times faster something is: what, times and wanted.

    What it is faster than, and the version of a task, are left out of `what`: there is little room beside a bar.
    """
    rows = frame[frame["measured"].str.match(_TIMES) & frame["to hold"].str.match(_TIMES)]
    first = {name: rows[column].str.extract(_TIMES)[0].astype(float) for name, column in _READ.items()}
    short = rows["what"].replace({r" against .*, ": ", ", r"(Continuous)?-v\d+$": ""}, regex=True)
    return rows.assign(what=short, **first)[["what", *first]]


_TIMES = r"([\d.]+) times"
_READ = {"times": "measured", "wanted": "to hold"}


def ratios(ax: Axes, frame: pd.DataFrame) -> Axes:
    """How many times faster the things of `told` are, as bars on a logarithmic axis; marks: what was to be reached."""
    rows = np.arange(len(frame))
    ax.barh(rows, frame["times"], color=DISTILLED, height=0.6, label="measured")
    ax.plot(frame["wanted"], rows, "|", color="black", ms=11, mew=1.5, label="to reach")
    for row, value, wanted in zip(rows, frame["times"], frame["wanted"]):
        number = f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
        ax.annotate(
            f"{number}×", (max(value, wanted), row), (4, 0), textcoords="offset points", va="center", fontsize=7
        )
    ax.set(xscale="log", xlim=(1, 8 * frame["times"].max()), xlabel="times faster", yticks=rows)
    ax.set_yticklabels(frame["what"])
    ax.legend(loc="upper right", frameon=False)
    ax.invert_yaxis()
    return ax


def costs(ax: Axes, frame: pd.DataFrame) -> Axes:
    """Core-hours per task of `scaling.cost`, as bars of what they go into."""
    rows, left = np.arange(len(frame)), np.zeros(len(frame))
    for part, color in _PARTS.items():
        ax.barh(rows, frame[part], left=left, color=color, height=0.7, label=part)
        left += frame[part].to_numpy()
    ax.set(xlabel="core-hours", yticks=rows, yticklabels=[f"{row.task}, d = {row.d}" for row in frame.itertuples()])
    ax.invert_yaxis()
    return ax
