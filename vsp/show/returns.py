"""Figures of returns: distributions, intervals, the ledger."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from .style import DISTILLED, TEACHER

_VERDICTS = {"reproduced": "o", "cannot be told": "o", "differs": "D", "contradicts itself": "X"}


def box_plot(ax: Axes, returns: dict[str, np.ndarray]) -> None:
    """Draw box plots of the returns of the teacher and of the distilled policies, in this order, without outliers."""
    names = [f"{name}\n(n = {values.size:,})" for name, values in returns.items()]
    look = {"widths": 0.5, "patch_artist": True, "medianprops": {"color": "black"}, "showfliers": False}
    drawn = ax.boxplot([values.ravel() for values in returns.values()], tick_labels=names, **look)
    for box, colour in zip(drawn["boxes"], (TEACHER, DISTILLED)):
        box.set(facecolor=colour)
    ax.set(ylabel="return per episode")


def over_iterations(ax: Axes, values: np.ndarray, *, ylabel: str, log: bool = False) -> None:
    """Plot one quantity over the iterations of a distillation."""
    ax.plot(np.arange(len(values)), values, color=DISTILLED)
    ax.set(xlabel="iteration n", ylabel=ylabel, yscale="log" if log else "linear")
    if not log:
        ax.locator_params("y", integer=True)


def ticks(ax: Axes, iterations: np.ndarray, name: str, *, row: int) -> None:
    """Mark iterations by ticks in a row above the axis, the first at the bottom, with a name at the right."""
    height, place = 0.08 * (row + 0.6), ax.get_xaxis_transform()
    ax.plot(iterations, np.full(len(iterations), height), "|", color="black", ms=4, mew=0.5, transform=place)
    ax.text(ax.dataLim.x1, height, name, transform=place, ha="right", va="center", fontsize=7)


def phase(ax: Axes, begin: int, name: str) -> None:
    """Shade the iterations from `begin` on and name them."""
    ax.axvspan(begin, ax.dataLim.x1, color="0.9", lw=0, zorder=0)
    ax.text(begin, 1.0, f" {name}", transform=ax.get_xaxis_transform(), va="bottom", fontsize=7)


def broken(left: Axes, right: Axes) -> None:
    """Mark that the horizontal axis of `left` goes on in `right` after a gap."""
    right.spines["left"].set_visible(False)
    right.tick_params(left=False, labelleft=False)
    for ax, end in ((left, 1), (right, 0)):
        ax.plot(end, 0, marker=[(-1, -2), (1, 2)], ms=6, color="black", clip_on=False, transform=ax.transAxes)


def intervals(ax: Axes, frame: pd.DataFrame, *, color: str | list[str] = DISTILLED) -> Axes:
    """Draw a dot on its interval for each row of `frame` (index: names; columns here, low, high), the first on top."""
    rows = np.arange(len(frame))
    ax.hlines(rows, frame["low"], frame["high"], color=color, lw=1.2)
    ax.scatter(frame["here"], rows, color=color, s=10, zorder=3)
    ax.set(yticks=rows, yticklabels=frame.index, ylim=(len(frame) - 0.5, -0.5))
    ax.grid(axis="x", color="0.9", lw=0.5)
    ax.set_axisbelow(True)
    return ax


def margin(ax: Axes, texts: list[str], title: str) -> None:
    """Write a text beside each row of `intervals`, right of the axes, under a title."""
    for row, text in enumerate([title, *texts], start=-1):
        ax.text(1.03, row, text, transform=ax.get_yaxis_transform(), va="center", fontsize=7, color="0.3")


def reference(ax: Axes, value: float, name: str, *, color: str = TEACHER, ls: str = "-") -> Axes:
    """Draw a vertical line at a reference value."""
    ax.axvline(value, color=color, lw=0.8, ls=ls, zorder=1, label=name)
    return ax


def ledger_gaps(ax: Axes, frame: pd.DataFrame, *, band: float, limit: float) -> None:
    """Plot the paper's values minus the rerun's, in half-widths of the rerun's intervals: one row per value. `frame`
    (index: names) has the columns subject (a line divides them), verdict (its marker) and gap. Values inside the shaded
    `band` count as reproduced. A gap beyond `limit` is a number with an arrow."""
    ax.axvspan(-band, band, color="0.9", lw=0)
    ax.axvline(0, color="0.6", lw=0.6)
    ax.axhline((frame["subject"] == "teacher").sum() - 0.5, color="0.6", lw=0.6)
    gaps = frame["gap"].clip(-limit, limit).to_numpy()
    for verdict, marker in _VERDICTS.items():
        rows, face = np.flatnonzero(frame["verdict"] == verdict), "white" if verdict == "cannot be told" else "black"
        ax.plot(gaps[rows], rows, marker, color="black", mfc=face, ms=4.5, mew=0.8, label=verdict)
    for row in np.flatnonzero(gaps != frame["gap"]):
        text = f"{frame['gap'].iloc[row]:.0f}".replace("-", "−")
        look = {"va": "center", "ha": "left" if gaps[row] < 0 else "right", "arrowprops": {"arrowstyle": "->"}}
        ax.annotate(text, (1.1 * gaps[row], row), (0.88 * gaps[row], row), fontsize=7, **look)
    places = {"yticks": np.arange(len(frame)), "yticklabels": frame.index, "ylim": (len(frame) - 0.5, -0.5)}
    ax.set(xlim=(-1.1 * limit, 1.1 * limit), **places)
