"""Figures of the comparison of methods."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from .style import COLOURS, DISTILLED, TEACHER, legend_below, letter, panels

# The methods of the comparison: a colour per family, dashed where a method lacks a part that its family has
METHODS = {
    "refined": {"color": DISTILLED, "lw": 1.8, "zorder": 5},
    "refined, not tuned": {"color": DISTILLED, "ls": "--", "lw": 1.4, "zorder": 4},
    "refined, closest": {"color": DISTILLED, "marker": "o"},
    "refined, faithful": {"color": DISTILLED, "marker": "P"},
    "oblique tree, linear leaves, DAgger": {"color": COLOURS[3]},
    "CART, linear leaves, DAgger": {"color": COLOURS[4]},
    "k-means cells, DAgger": {"color": COLOURS[2]},
    "CART, DAgger": {"color": COLOURS[7]},
    "CART": {"color": COLOURS[7], "ls": "--"},
    "soft tree, DAgger": {"color": COLOURS[5]},
    "the paper's method": {"color": "black", "marker": "D"},
    "TD-AVQ": {"color": COLOURS[9], "marker": "^"},
    "TD-AVQ, coarse": {"color": COLOURS[9], "marker": "v"},
    "one linear map": {"color": "black", "marker": "s"},
    "rule of thumb": {"color": "black", "marker": "*"},
    "heuristic": {"color": "black", "marker": "P"},
    "refined, no teacher": {"color": DISTILLED, "ls": ":"},
}


def method_comparison(frame: pd.DataFrame, teacher: float, *, linear: float) -> Figure:
    """All methods over their cells: mean return minus the teacher's, and the action error where the teacher goes."""
    fig, axes = panels(2, height=3.6)
    return_over_cells(axes[0], frame, teacher, linear=linear)
    over_cells(axes[1], frame[frame["method"] != "teacher"], "error_teacher")
    axes[1].set(yscale="log", ylabel="half action boxes")
    axes[1].yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes[1].yaxis.set_major_formatter("{x:g}")
    axes[1].yaxis.set_minor_locator(NullLocator())
    letter(axes, ["return", "action error"])
    legend_below(fig, axes[0], ncol=2)
    return fig


def against_time(ax: Axes, frame: pd.DataFrame, *, enough: float) -> Axes:
    """Share of the teacher's return over seconds: the median of every method and setting.

    `frame` has rows of `beyond.comparison.time_to_quality`. Bars span the 10 % to 90 % quantiles over the seeds;
    `enough` is drawn as a line.
    """
    for method, rows in frame.groupby("method"):
        style = {"color": METHODS[method]["color"], "ls": METHODS[method].get("ls", "-")}
        low, middle, high = (rows.groupby("setting", sort=False)["share"].quantile(share) for share in (0.1, 0.5, 0.9))
        seconds = rows.groupby("setting", sort=False)["seconds"].median()
        ax.errorbar(
            seconds, middle, [middle - low, high - middle], marker="o", ms=3, elinewidth=0.7, **style, label=method
        )
    ax.axhline(enough, color=TEACHER, ls="--", lw=1.0, label=f"{enough:.0%} of the teacher’s return")
    ax.set(xscale="log", xlabel="seconds from the teacher’s weights", ylabel="share of the teacher’s return")
    return ax


def return_over_cells(ax: Axes, frame: pd.DataFrame, teacher: float, *, linear: float) -> Axes:
    """`over_cells` of the mean return minus the teacher's, on a scale linear up to `linear`, logarithmic beyond."""
    ax.set_yscale("symlog", linthresh=linear)
    over_cells(ax, frame.assign(gap=frame["mean"] - teacher), "gap")
    ax.axhline(0, color=TEACHER, ls="--", lw=1.0, zorder=3, label="teacher")
    ax.set_ylabel("mean return − teacher’s")
    ax.yaxis.set_major_formatter("{x:g}")
    return ax


def simplified(ax: Axes, frame: pd.DataFrame, tolerance: float) -> Axes:
    """Add the policy that `vsp.simplify` ended with to `return_over_cells`, and its tolerance as a line.

    `frame` is the one that `vsp.simplify` returns: a row per candidate.
    """
    last = frame[frame["kept"]].iloc[-1]
    look = {"ls": "", "marker": "o", "ms": 5, "color": "black", "mec": "white", "mew": 0.5, "zorder": 7}
    ax.plot(last["cells"], last["mean"] - frame.attrs["teacher"], **look, label="simplified")
    ax.axhline(-tolerance, color="black", lw=0.8, ls=":", zorder=3, label="tolerance")
    return ax


def over_cells(ax: Axes, frame: pd.DataFrame, column: str) -> Axes:
    """A column of `frame` over the number of cells or leaves: a line per method, the median of its seeds.

    `frame` has method, size, seed and cells, as `beyond.comparison` makes it. Only the methods in `METHODS` are drawn;
    those that choose their own size (size 0) as a mark at their median number of cells. Our bands and the bars of marks
    span the 10 % to 90 % quantiles over the seeds.
    """
    ax.set_xscale("log")
    for method, style in METHODS.items():
        rows = frame[frame["method"] == method]
        if not len(rows):
            continue
        low, middle, high = (rows.groupby("size")[column].quantile(share) for share in (0.1, 0.5, 0.9))
        if "marker" not in style:
            ax.plot(middle.index, middle, **{"lw": 0.9, "marker": ".", "ms": 4, **style}, label=method)
            if style["color"] == DISTILLED and len(middle) > 2:  # of fewer sizes a band would hide more than it shows
                ax.fill_between(middle.index, low, high, color=DISTILLED, alpha=0.2, lw=0)
            continue
        look = {"ls": "", "ms": 4.5, "mec": "white", "mew": 0.4, "elinewidth": 0.7, "zorder": 6, **style}
        ax.errorbar(max(1, rows["cells"].median()), middle, [middle - low, high - middle], **look, label=method)
    ax.set_xlabel("cells or leaves")
    return ticks_at(ax, frame.loc[frame["size"] > 0, "size"])


def ticks_at(ax: Axes, values: pd.Series) -> Axes:
    """Ticks at exactly these values; from 1024 on in units of k."""
    places = np.unique(values.dropna().astype(int))
    ax.set_xticks(places, [f"{place // 1024}k" if place >= 1024 else str(place) for place in places])
    ax.minorticks_off()
    return ax
