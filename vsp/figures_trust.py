"""Pictures of what was measured of speed, scale and cost. Arrays and frames in, `Axes` out, as in `figures.py`."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from .figures import COLOURS, DISTILLED, GOAL, OTHER, TEACHER
from .scaling import POINTS, power_law

_LINES = (DISTILLED, TEACHER, GOAL, COLOURS[4])
_MARKS = "osD^"
_PARTS = {"teacher": TEACHER, "physics": OTHER, "distillation": DISTILLED, "evaluation": GOAL}


def growth(ax: Axes, frame: pd.DataFrame, quantity: str = "seconds") -> Axes:
    """`quantity` over size on logarithmic axes: a mark per measurement, a line per thing, dashed the fitted law."""
    for (what, part), color, mark in zip(frame.groupby("what", sort=False), _LINES, _MARKS):
        sizes, values = part["size"].to_numpy(), part[quantity].to_numpy()
        label = what
        if len(part) >= POINTS:
            fitted, exponent, _ = power_law(sizes, values)
            ax.plot(sizes, fitted, color=color, ls="--", lw=0.8)
            label = f"{what}, exponent {exponent:.1f}"
        ax.plot(sizes, values, mark, color=color, ms=3.5, ls="" if len(part) >= POINTS else "-", label=label)
    ax.set(xscale="log", yscale="log", xlabel=frame["over"].iloc[0], ylabel=quantity)
    return ax


def ratios(ax: Axes, names: list[str], found: np.ndarray, wanted: np.ndarray) -> Axes:
    """How many times faster things are (n,), as bars on a logarithmic axis, beside what was to be reached, as ticks."""
    rows = np.arange(len(names))
    ax.barh(rows, found, color=DISTILLED, height=0.6, label="measured")
    ax.plot(wanted, rows, "|", color="black", ms=14, mew=1.5, label="to reach")
    for row, value in zip(rows, found):
        ax.annotate(f"{value:.3g}×", (value, row), (3, 0), textcoords="offset points", va="center", fontsize=7)
    ax.set(xscale="log", xlim=(1, 6 * max(found)), xlabel="times faster", yticks=rows, yticklabels=names)
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
