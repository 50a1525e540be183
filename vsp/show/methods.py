"""Figures of the comparison of methods."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from .style import COLOURS, DISTILLED, OTHER, TEACHER, legend_below, letter, panels

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

# Of those at the limit
LIMITS = {
    "at the limit": {"color": COLOURS[2], "lw": 1.8, "zorder": 6},
    "refined": METHODS["refined"],
    "oblique tree, linear leaves, DAgger, tuned": {"color": COLOURS[3]},
    "small network, DAgger, tuned": {"color": COLOURS[9]},
    "one linear map, tuned": {"color": "black", "marker": "s"},
}


def method_comparison(frame: pd.DataFrame, teacher: float, *, linear: float) -> Figure:
    """All methods over their cells: mean return minus the teacher's, and the action error where the teacher goes."""
    fig, axes = panels(2, height=3.6)
    return_over_cells(axes[0], frame, teacher, linear=linear)
    over_cells(axes[1], frame[frame["method"] != "teacher"], "error_teacher")
    axes[1].set(yscale="log", ylabel="action error / half range")
    axes[1].yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes[1].yaxis.set_major_formatter("{x:g}")
    axes[1].yaxis.set_minor_locator(NullLocator())
    letter(axes, ["return", "action error"])
    legend_below(fig, axes[0], ncol=2)
    return fig


# Other methods by how their names begin: marker and label
RIVAL_KINDS = {"oblique tree": ("^", "oblique tree"), "CART": ("s", "axis tree"), "k-means": ("D", "k-means"),
               "small network": ("P", "small network"), "soft tree": ("v", "soft tree"),
               "critic-driven": ("<", "critic-driven"), "advantage-weighted": (">", "advantage-weighted")}  # fmt: skip
OWN_SIZES = {2: COLOURS[1], 4: COLOURS[2], 8: COLOURS[4]}  # cells of the lines on the map
LARGEST = 13  # leaves of what is drawn there


def fidelity_map(ax: Axes, points: pd.DataFrame, teacher: float, *, linear: float) -> Axes:
    """Return over fidelity: what can be had. To the right, policies act more like the teacher; up, they return more.

    `points` has method, size, mean and r2, as `beyond.comparison.possible` makes it. Lines are our cells, a colour per
    number of cells: from the closest (circle) over those with the highest return at a given R² to the highest return
    (star). Marks are other methods by kind, open as they imitate, filled where they are tuned; the larger the more
    leaves. The scale is logarithmic in 1 - R² and, beyond `linear`, in the return.
    """
    points = points.assign(unlike=1.0 - points["r2"], gap=points["mean"] - teacher)
    others = points[points["size"] <= LARGEST]
    for start, (marker, kind) in RIVAL_KINDS.items():
        rows = others[others["method"].str.startswith(start)]
        tuned = rows["method"].str.endswith(", tuned")
        look = {"marker": marker, "edgecolor": OTHER, "lw": 0.5, "alpha": 0.7}
        for part, face, name in ((rows[~tuned], "none", kind), (rows[tuned], OTHER, None)):
            ax.scatter(part["unlike"], part["gap"], s=6 + 1.5 * part["size"], facecolor=face, label=name, **look)
    one = points[points["method"].str.startswith("one linear map")]
    ax.scatter(one["unlike"], one["gap"], marker="x", s=18, color="black", lw=1.0, label="one linear map", zorder=4)
    for size, color in OWN_SIZES.items():
        _own_line(ax, points[points["size"] == size], color, f"ours, {size} cells")
    ax.axhline(0, color=TEACHER, ls="--", lw=1.0, zorder=3, label="teacher’s return")
    ax.axvline(1, color=OTHER, ls=":", lw=0.8, label="a constant")
    ax.set_yscale("symlog", linthresh=linear)
    ax.margins(y=0.08)
    ax.yaxis.set_major_formatter("{x:g}")
    drawn = points.loc[(points["size"] <= LARGEST) & (points["method"] != "teacher"), "unlike"]
    ax.set(xscale="log", xlim=(1.3 * drawn.max(), drawn.min() / 1.3), xlabel="R² of the actions")
    ticks = {5: "−4", 1: "0", 0.3: ".7", 0.1: ".9", 0.05: ".95", 0.01: ".99", 0.001: ".999"}
    ax.set_xticks(list(ticks), list(ticks.values()))
    ax.set_xlim(1.3 * drawn.max(), drawn.min() / 1.3)  # ticks beyond it would widen it
    ax.minorticks_off()
    return ax


def _own_line(ax: Axes, points: pd.DataFrame, color: str, label: str) -> None:
    rows = points[points["method"].str.match("faithful|refined$")].sort_values("unlike")
    ax.plot(rows["unlike"], rows["gap"], color=color, lw=1.2, marker=".", ms=4, zorder=5, label=label)
    for method, marker in (("faithful", "o"), ("refined", "*")):
        end = rows[rows["method"] == method]
        ax.plot(end["unlike"], end["gap"], marker, color=color, mec="white", mew=0.4, ms=6, zorder=6)


def likeness_over_cells(ax: Axes, table: pd.DataFrame) -> Axes:
    """R² of the actions (from the lowest seed to the median), sameness of the cells and ratio of the actions'
    differences over the number of cells; `table` as `beyond.comparison.likeness` makes it."""
    ax.set_xscale("log")
    ax.fill_between(table["size"], table["r2_least"], table["r2"], color=TEACHER, alpha=0.2, lw=0)
    for column, color, marker, label in (
        ("r2", TEACHER, "o", "R², median (band: to the lowest)"),
        ("index", DISTILLED, "s", "index: same cells"),
        ("ratio", COLOURS[2], "^", "ratio: different actions"),
    ):
        ax.plot(table["size"], table[column], color=color, marker=marker, ms=3.5, label=label)
    ax.set_ylim(min(0.0, table["r2_least"].min()) - 0.05, 0.05 + max(1.0, table["ratio"].max()))
    ax.set_xlabel("cells")
    return ticks_at(ax, table.loc[table["size"] != 7, "size"])  # whose label would touch that of 8


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


def over_cells(ax: Axes, frame: pd.DataFrame, column: str, looks: dict[str, dict] = METHODS) -> Axes:
    """A column of `frame` over the number of cells or leaves: a line per method, the median of its seeds.

    `frame` has method, size, seed and cells, as `beyond.comparison` makes it. Only the methods in `looks` are drawn;
    those that choose their own size (size 0) as a mark at their median number of cells. Our bands and the bars of marks
    span the 10 % to 90 % quantiles over the seeds.
    """
    ax.set_xscale("log")
    for method, style in looks.items():
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
