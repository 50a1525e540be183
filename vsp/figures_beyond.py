"""Pictures beyond the paper: why a policy acts as it does, the comparison of methods, the study of look-ups.

Arrays and frames in, `Axes` out, as in `figures.py`, whose colours these share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from . import geometry
from .figures import (
    CODEWORD,
    COLOURS,
    DISTILLED,
    FORCE_MAP,
    GOAL,
    OTHER,
    TEACHER,
    cells,
    codewords,
    extent,
    legend_below,
    letter,
    panels,
)  # fmt: skip

if TYPE_CHECKING:
    from .policy import Explanation, VoronoiPolicy

# The methods of vsp.methods: a colour per family, dashed where a method lacks a part that its family has
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
# What vsp.lookup_study measures: a colour per method, dashed for the Manhattan distance
_MEASURED = {"cdist": OTHER, "matrix product": GOAL, "kd-tree": COLOURS[4]}
_MEASURED |= {"witnesses": GOAL, "linear programmes": OTHER, "Delaunay": COLOURS[3]}


# Why a policy acts as it does


def whereabouts(ax: Axes, policy: VoronoiPolicy, state: np.ndarray) -> Axes:
    """Where `policy.explain(state)` says that a two-dimensional state is: its cell, its codeword, its nearest border.

    The arrow is the change of one input alone that leads to another cell, the least one in units of the look-up's
    distance. The view is the box of the states, dashed if the codeword lies outside, and as much more as shows it.
    Raises ValueError for a task of other than two inputs.
    """
    why, task = policy.explain(state), policy.task
    if len(task.inputs) != 2:
        raise ValueError(f"{task.name} has inputs {task.inputs}, expected two: `contributions` takes any number")
    ends = np.array([task.low, task.high, why.codeword])
    outside = ((why.codeword < task.low) | (why.codeword > task.high)).any()
    room = 0.06 * np.ptp(ends, axis=0) * outside
    x, y, grid = geometry.grid(ends.min(axis=0) - room, ends.max(axis=0) + room, 401)
    index, way = policy.cells(grid).reshape(x.shape), _way_out(why, policy.scale)
    _two_cells(ax, x, y, index, why.cell, way[2] if way else None)
    inside = ((grid >= task.low) & (grid <= task.high)).all(axis=1).reshape(x.shape)
    for cell in set(index[inside]) - {why.cell}:
        _number(ax, x, y, inside & (index == cell), cell)
    values = ", ".join(f"{name} = {value:.3g}" for name, value in zip(task.inputs, state)).replace("-", "−")
    ax.plot(*state, "o", color=DISTILLED, mec="white", mew=0.6, ms=5, zorder=5, ls="", label=f"state: {values}")
    ax.plot(*np.transpose([state, why.codeword]), color=CODEWORD, lw=0.7, ls=":", zorder=3)
    codewords(ax, why.codeword[None], label=f"its codeword, of cell {why.cell}")
    if way:
        _arrow(ax, np.asarray(state), way, task.inputs)
    if outside:
        ax.add_patch(Rectangle(task.low, *(task.high - task.low), **_FRAME))
    ax.set(xlim=x[0, [0, -1]], ylim=y[[0, -1], 0], xlabel=task.input_labels[0], ylabel=task.input_labels[1])
    return ax


_FRAME = {"fill": False, "lw": 0.6, "ls": "--", "edgecolor": OTHER, "zorder": 2, "label": "box of the states"}


def _way_out(why: Explanation, scale: np.ndarray) -> tuple[int, float, int] | None:
    """The input whose change leads out of the cell by the least distance, the change, and the cell behind."""
    changes = why.borders["change"].to_numpy()
    if np.isnan(changes).all():
        return None
    axis = int(np.nanargmin(np.abs(changes) / scale))
    return axis, float(changes[axis]), int(why.borders["cell"].iloc[axis])


def _two_cells(ax: Axes, x: np.ndarray, y: np.ndarray, index: np.ndarray, own: int, behind: int | None) -> None:
    """The borders of all cells, with one in a tint of the policy's colour and another in grey."""
    shades = np.ones((*x.shape, 4))
    shades[index == behind] = mpl.colors.to_rgba("0.91")
    shades[index == own] = mpl.colors.to_rgba(sns.light_palette(DISTILLED, 8)[2])
    ax.imshow(shades, origin="lower", extent=extent(x, y), aspect=ax.get_aspect(), interpolation="nearest", zorder=0)
    cells(ax, x, y, index)


def _number(ax: Axes, x: np.ndarray, y: np.ndarray, inside: np.ndarray, cell: int) -> None:
    """The number of a cell where its region of a grid is widest, unless there is no room for it."""
    from scipy.ndimage import distance_transform_edt

    room = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    place = np.unravel_index(room.argmax(), x.shape)
    if room[place] > 0.04 * len(x):
        ax.text(x[place], y[place], str(cell), color=OTHER, fontsize=7, ha="center", va="center", zorder=2)


def _arrow(ax: Axes, state: np.ndarray, way: tuple[int, float, int], names: tuple[str, ...]) -> None:
    """The way out of a cell, and a line without points that says it in a legend."""
    axis, change, cell = way
    style = {"arrowstyle": "-|>", "lw": 0.9, "color": "black", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
    ax.annotate("", state + change * np.eye(2)[axis], state, arrowprops=style, zorder=4)
    text = f"{names[axis]} {'−' if change < 0 else '+'} {abs(change):.2g} leads to cell {cell}"
    ax.plot([], [], color="black", marker=">", ms=3, lw=0.9, markevery=[-1], label=text)


def contributions(ax: Axes, policy: VoronoiPolicy, state: np.ndarray) -> Axes:
    """How `policy.explain(state)` adds the contributions of the inputs and the bias up to each action, as a waterfall.

    One block per action: a bar per term, from where the last one ended, then their sum and what the action's limits,
    dashed, leave of it. Orange is more, purple is less, as in the force map. Raises ValueError unless maps are linear.
    """
    policy.check_linear()
    why, task = policy.explain(state), policy.task
    row, labels = 0.0, {}
    for j, output in enumerate(task.outputs):
        weights, terms = policy.coefficients[why.cell, :, j], why.contributions.loc[output].to_numpy()
        names = [*(f"{weight:.2f} {name}" for weight, name in zip(weights, task.inputs)), "bias", "sum", "limited"]
        rows = row + 1 + np.arange(len(names))
        colours = [mpl.colormaps[FORCE_MAP](0.8 if term > 0 else 0.2) for term in terms] + ["0.65", "0.2"]
        lefts = np.array([0.0, *terms.cumsum()[:-1], 0.0, 0.0])
        _waterfall(ax, rows, lefts, np.array([*terms, why.raw[j], why.action[j]]), colours)
        limits = task.action_low[j], task.action_high[j]
        ax.vlines(limits, rows[0] - 0.5, rows[-1] + 0.5, color=OTHER, lw=0.6, ls="--", zorder=1)
        labels |= {row: output} | dict(zip(rows, names))
        row = rows[-1] + 1.3
    ax.axvline(0, color="black", lw=0.6, zorder=1)
    ax.set_yticks(list(labels), [label.replace("-", "−") for label in labels.values()])
    for label in ax.get_yticklabels():
        label.set_fontweight("bold" if label.get_text() in task.outputs else "normal")
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    ax.use_sticky_edges = False  # a bar may end at no edge of the axes
    ax.margins(x=0.03)
    ax.set(ylim=(row - 0.7, -0.6), xlabel="action, and what adds up to it")
    ax.xaxis.set_major_locator(MaxNLocator(5, min_n_ticks=3))
    return ax


def _waterfall(ax: Axes, rows: np.ndarray, lefts: np.ndarray, lengths: np.ndarray, colours: list) -> None:
    """Bars with their lengths in the margin, and thin lines from the end of one to the beginning of the next."""
    ax.barh(rows, lengths, left=lefts, height=0.72, color=colours, zorder=2)
    ax.vlines((lefts + lengths)[:-2], rows[:-2] + 0.36, rows[1:-1] - 0.36, color="0.4", lw=0.5, zorder=3)
    for row, length in zip(rows, lengths):
        text, place = f"{length:.2f}".replace("-", "−"), ax.get_yaxis_transform()
        ax.text(1.17, row, text, transform=place, va="center_baseline", ha="right", fontsize=7)


def comparison(frame: pd.DataFrame, teacher: float, *, linear: float) -> Figure:
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
    """Share of the teacher's return over the time it took: the median of every method and setting, as vsp.race has it.

    Bars hold eight seeds of ten; `enough` is drawn as a line.
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
    """Mean return minus the teacher's, by `over_cells`, on a scale linear up to `linear` and logarithmic beyond."""
    ax.set_yscale("symlog", linthresh=linear)
    over_cells(ax, frame.assign(gap=frame["mean"] - teacher), "gap")
    ax.axhline(0, color=TEACHER, ls="--", lw=1.0, zorder=3, label="teacher")
    ax.set_ylabel("mean return − teacher’s")
    ax.yaxis.set_major_formatter("{x:g}")
    return ax


def simplified(ax: Axes, frame: pd.DataFrame, tolerance: float) -> Axes:
    """The policy that `vsp.simplify` ended with, in `return_over_cells`, by `frame` of what it tried; the tolerance as
    a line."""
    last = frame[frame["kept"]].iloc[-1]
    look = {"ls": "", "marker": "o", "ms": 5, "color": "black", "mec": "white", "mew": 0.5, "zorder": 7}
    ax.plot(last["cells"], last["mean"] - frame.attrs["teacher"], **look, label="simplified")
    ax.axhline(-tolerance, color="black", lw=0.8, ls=":", zorder=3, label="tolerance")
    return ax


def over_cells(ax: Axes, frame: pd.DataFrame, column: str) -> Axes:
    """A column of `frame` over the number of cells or leaves: a line per method, the median of its seeds.

    `frame` has method, size, seed and cells, as vsp.beyond makes it. Methods are drawn as `METHODS` says and others
    not; those of size 0, whose size is their own, as a mark at their median cells. Our bands and the bars of marks hold
    eight seeds of ten.
    """
    ax.set_xscale("log")
    for method, style in METHODS.items():
        rows = frame[frame["method"] == method]
        if not len(rows):
            continue
        low, middle, high = (rows.groupby("size")[column].quantile(share) for share in (0.1, 0.5, 0.9))
        if "marker" not in style:
            ax.plot(middle.index, middle, **{"lw": 0.9, "marker": ".", "ms": 4, **style}, label=method)
            if style["color"] == DISTILLED and len(middle) > 2:  # of fewer sizes it would hide more than it shows
                ax.fill_between(middle.index, low, high, color=DISTILLED, alpha=0.2, lw=0)
            continue
        look = {"ls": "", "ms": 4.5, "mec": "white", "mew": 0.4, "elinewidth": 0.7, "zorder": 6, **style}
        ax.errorbar(max(1, rows["cells"].median()), middle, [middle - low, high - middle], **look, label=method)
    ax.set_xlabel("cells or leaves")
    return _ticks(ax, frame.loc[frame["size"] > 0, "size"])


# The study of look-ups


def times_over_dimension(ax: Axes, frame: pd.DataFrame, *, limit: float | None = None) -> Axes:
    """Seconds over the number of dimensions, both logarithmic: a line per method and metric.

    `frame` has rows of vsp.lookup_study for one number of codewords. Where a method has no time, it took more than
    `limit` seconds: a cross there marks the first such place.
    """
    for (method, metric), rows in frame.groupby(["method", "metric"], sort=False):
        dashed, color = metric == "manhattan", _MEASURED[method]
        name = f"{method}, Manhattan" if dashed else method
        ax.plot(rows["d"], rows["seconds"], "--" if dashed else "-", marker=".", ms=3, color=color, label=name)
        given_up = rows.loc[rows["seconds"].isna(), "d"]
        if len(given_up) and limit:
            ax.plot(given_up.min(), limit, "x", color=color, ms=5, mew=1.2, clip_on=False, zorder=5)
    ax.set(xscale="log", yscale="log", xlabel="dimensions", ylabel="seconds")
    return _ticks(ax, frame["d"])


def shares_over(ax: Axes, frame: pd.DataFrame, *, x: str, y: str, by: str) -> Axes:
    """A share over a number, logarithmic: a line per value of the column `by`, darker by its rank."""
    groups = list(frame.dropna(subset=y).sort_values(x).groupby(by))
    for color, (value, rows) in zip(sns.color_palette("viridis_r", len(groups) + 1)[1:], groups):
        ax.plot(rows[x], rows[y], marker=".", ms=3, color=color, label=f"{by} = {value}")
    ax.set(xscale="log", ylim=(0, 1.03), xlabel=x, ylabel=y)
    ax.legend(frameon=False, fontsize=7, handlelength=1.0, labelspacing=0.15, borderaxespad=0.1)
    return _ticks(ax, frame[x])


def _ticks(ax: Axes, values: pd.Series) -> Axes:
    """Ticks at the values themselves and nowhere else; powers of two from 1024 on are so many k."""
    places = np.unique(values.dropna().astype(int))
    ax.set_xticks(places, [f"{place // 1024}k" if place >= 1024 else str(place) for place in places])
    ax.minorticks_off()
    return ax
