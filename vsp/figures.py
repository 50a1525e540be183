"""Drawing: arrays in, `Axes` out. One colour for one thing everywhere, and one `save_figure`.

Colours come from seaborn's colour-blind palette; the force map runs from purple (push left) to orange (push right).
"""

from __future__ import annotations

import base64
import html
import io
import os
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from PIL import Image

from . import envs, store
from .checks import check_array, check_data, check_finite
from .envs import Task
from .moments import fences
from .rollouts import Episode

TEXT_WIDTH = 12.2 / 2.54  # inches; the text width of LNCS
COLOURS = sns.color_palette("colorblind").as_hex()
TEACHER, DISTILLED, GOAL, PIT = COLOURS[0], COLOURS[1], COLOURS[2], "0.35"
BORDER, CODEWORD, OTHER = "0.25", "black", "0.4"
FORCE_MAP = "PuOr_r"
_VERDICTS = {"reproduced": (GOAL, "o"), "differs": (COLOURS[3], "D"), "contradicts itself": (COLOURS[4], "X")}

_STYLE = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "figure.dpi": 150,
    "figure.facecolor": "white",
    "savefig.dpi": 300,
    "pdf.fonttype": 42,  # TrueType fonts, embedded
    "svg.hashsalt": "vsp",
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def panels(
    n: int = 1, *, height: float = 2.3, width: float = TEXT_WIDTH, stacked: bool = False, **subplots
) -> tuple[Figure, np.ndarray]:
    """A figure of LNCS text width with n panels in a row, or in a column; height in inches. Returns it and axes (n,).

    Sets the style for everything drawn from here on.
    """
    mpl.rcParams.update(_STYLE)
    shape = (n, 1) if stacked else (1, n)
    fig, axes = plt.subplots(*shape, figsize=(width, height), layout="constrained", squeeze=False, **subplots)
    return fig, axes.ravel()


def embedded(image: bytes, alt: str, *, width: int = 720) -> str:
    """An image file as an HTML element that holds all of it, `width` pixels wide or as wide as there is room.

    Both sides are given, so that nothing jumps while it loads, and it is decoded before it is shown, so that nothing
    flickers where one picture takes the place of another. Raises PIL.UnidentifiedImageError for what is no image.
    """
    with Image.open(io.BytesIO(image)) as opened:
        kind, height = opened.get_format_mimetype(), round(width * opened.height / opened.width)
    size = f'width="{width}" height="{height}" style="max-width: 100%; height: auto"'
    data = base64.b64encode(image).decode()
    return f'<img alt="{html.escape(alt)}" src="data:{kind};base64,{data}" {size} decoding="sync">'


class Picture:
    """A saved figure as a notebook shows it: an HTML figure whose alternative text survives every conversion."""

    def __init__(self, png: bytes, alt: str):
        self.png, self.alt = png, alt

    def _repr_html_(self) -> str:
        return f"<figure>{embedded(self.png, self.alt)}</figure>"

    def __repr__(self) -> str:
        return self.alt


def save_figure(fig: Figure, name: str, *, alt: str, out: str | os.PathLike, quick: bool = False) -> Picture:
    """Write OUT/figures/NAME.pdf and .png, close the figure and return the picture to show.

    `alt` describes what there is to see for someone who cannot; it goes into both files too. `quick` adds a watermark.
    The files hold no dates and no version numbers, so that the same figure gives the same bytes.
    """
    if quick:
        fig.text(0.5, 0.5, "quick run", fontsize=36, color="0.5", alpha=0.4, ha="center", va="center", rotation=20)
    path = Path(out) / "figures" / name
    with store.atomic_path(path.with_suffix(".pdf")) as temporary:
        fig.savefig(
            temporary, metadata={"Title": name, "Subject": alt, "CreationDate": None, "Creator": None, "Producer": None}
        )
    with store.atomic_path(path.with_suffix(".png")) as temporary:
        fig.savefig(temporary, metadata={"Title": name, "Description": alt, "Software": None})
    plt.close(fig)
    return Picture(path.with_suffix(".png").read_bytes(), alt)


def letter(axes: np.ndarray, titles: list[str]) -> None:
    """Title the panels (a), (b), ..."""
    for ax, mark, title in zip(axes, "abcdefgh", titles):
        ax.set_title(f"({mark}) {title}", loc="left")


def cells(ax: Axes, x: np.ndarray, y: np.ndarray, index: np.ndarray, *, fill: bool = False, width: float = 0.6) -> Axes:
    """Borders of Voronoi cells, `width` points wide, from the cell of each grid point; `fill` colours the cells."""
    index = _on_grid("cells", x, y, index).astype(int)
    if fill:
        colours = np.array(sns.color_palette("pastel").as_hex())
        shades = mpl.colors.to_rgba_array(colours)[index % len(colours)]
        ax.imshow(shades, origin="lower", extent=extent(x, y), aspect="auto", interpolation="nearest", zorder=0)
    for i in np.unique(index):
        inside = (index == i).astype(float)
        if inside.min() < 1:
            ax.contour(x, y, inside, levels=[0.5], colors=BORDER, linewidths=width)
    return ax


def codewords(ax: Axes, points: np.ndarray, *, label: str | None = "codeword", numbers: bool = False) -> Axes:
    """Codewords (k, 2) as black dots with a white rim."""
    points = check_array("codewords", points, (-1, 2))
    ax.scatter(*points.T, s=14, color=CODEWORD, edgecolor="white", linewidth=0.6, zorder=5, label=label, clip_on=False)
    if numbers:
        for i, point in enumerate(points):
            ax.annotate(str(i), point, xytext=(3, 3), textcoords="offset points", fontsize=6, zorder=6)
    return ax


def square(ax: Axes) -> Axes:
    """The unit square of SimpleGoal with goal and pit."""
    goal, pit = envs.GOAL_EDGE, envs.PIT_HIGH - envs.PIT_LOW
    ax.add_patch(Rectangle((0, 0), goal, goal, color=GOAL, alpha=0.5, lw=0, zorder=1, label="goal"))
    corner = (envs.PIT_LOW, envs.PIT_LOW)
    ax.add_patch(Rectangle(corner, pit, pit, color=PIT, alpha=0.4, lw=0, zorder=1, label="pit"))
    ax.set(xlim=(0, 1), ylim=(0, 1), xlabel="x", ylabel="y", aspect="equal", xticks=[0, 0.5, 1], yticks=[0, 0.5, 1])
    return ax


def arrows(ax: Axes, states: np.ndarray, actions: np.ndarray, *, color: str = TEACHER) -> Axes:
    """The direction and size of each action (n, 2) at its state (n, 2); a full diagonal step spans one grid step."""
    states, actions = check_data(states, actions, 2, 2)
    step = np.diff(np.unique(states[:, 0]))[0]
    ax.quiver(
        *states.T, *actions.T, color=color, angles="xy", scale_units="xy", scale=1.4 / step, width=0.006, zorder=3
    )
    return ax


def force_map(ax: Axes, x: np.ndarray, y: np.ndarray, force: np.ndarray):
    """Force in [-1, 1] over position and velocity. Returns the image, for `force_bar`."""
    image = ax.imshow(
        _on_grid("force", x, y, force),
        origin="lower",
        extent=extent(x, y),
        aspect="auto",
        cmap=FORCE_MAP,
        vmin=-1,
        vmax=1,
    )
    ax.set(xlabel="position", ylabel="velocity (per step)")
    return image


def force_bar(fig: Figure, image, axes: np.ndarray) -> None:
    """One colour bar for all force maps of a figure."""
    bar = fig.colorbar(image, ax=list(axes), label="force", ticks=[-1, 0, 1], aspect=30)
    bar.ax.set_yticklabels(["−1 (left)", "0", "+1 (right)"])


def error_map(ax: Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray, *, label: str):
    """A non-negative quantity over a two-dimensional state, dark where it is large, with its own colour bar."""
    error = _on_grid("error", x, y, error)
    image = ax.imshow(error, origin="lower", extent=extent(x, y), aspect="auto", cmap="Greys", vmin=0)
    ax.figure.colorbar(image, ax=ax, label=label)
    return image


def box_plot(ax: Axes, returns: dict[str, np.ndarray], *, outliers: bool = False) -> Axes:
    """Box plots of the returns of the teacher and of the distilled policies, in this order."""
    returns = {name: check_finite(f"returns of {name}", values) for name, values in returns.items()}
    colours = dict(zip(returns, (TEACHER, DISTILLED)))
    sns.boxplot(data=returns, ax=ax, palette=colours, width=0.5, showfliers=outliers, linewidth=0.8)
    ax.set(ylabel="return per episode")
    ax.set_xticks(range(len(returns)), [f"{name}\n(n = {values.size:,})" for name, values in returns.items()])
    return ax


def trail(ax: Axes, episode: Episode, task: Task, *, color: str, label: str | None = None) -> Axes:
    """The way of one episode in a two-dimensional state, from a ring to where its last action led."""
    last, _, _ = task.step(episode.states[-1:], episode.actions[-1:])
    way = np.concatenate([episode.states, last])
    ax.plot(*way.T, color=color, marker=".", ms=3, lw=0.9, zorder=4, label=label)
    ax.plot(*way[0], color=color, marker="o", mfc="white", ms=5, zorder=5)
    return ax


def over_iterations(ax: Axes, values: np.ndarray, *, ylabel: str, log: bool = False) -> Axes:
    """One quantity over the iterations of a distillation."""
    values = check_array("values", values, (-1,))
    ax.plot(np.arange(len(values)), values, color=DISTILLED)
    ax.set(xlabel="iteration n", ylabel=ylabel, yscale="log" if log else "linear")
    if not log:
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


def legend_below(fig: Figure, ax: Axes, *, ncol: int = 3) -> None:
    """A legend of what is on `ax` under the whole figure."""
    fig.legend(*ax.get_legend_handles_labels(), frameon=False, loc="outside lower center", ncol=ncol)


def phase(ax: Axes, begin: int, name: str) -> Axes:
    """Shade the iterations from `begin` on and name them."""
    ax.axvspan(begin, ax.dataLim.x1, color="0.9", lw=0, zorder=0)
    ax.text(begin, 1.0, f" {name}", transform=ax.get_xaxis_transform(), va="bottom", fontsize=6)
    return ax


def run_means(ax: Axes, means: np.ndarray, teacher: float) -> Axes:
    """Mean return of each run, sorted, against the teacher's."""
    means = check_array("means", means, (-1,))
    ax.plot(np.arange(1, len(means) + 1), np.sort(means), ".", color=DISTILLED, ms=4, label="distilled, one dot a run")
    ax.axhline(teacher, color=TEACHER, label="teacher")
    ax.set(xlabel="run, by mean return", ylabel="mean return")
    ax.legend(frameon=False, loc="lower right")
    return ax


def histogram(ax: Axes, returns: np.ndarray, *, color: str = TEACHER) -> Axes:
    """How the returns (n,) of one policy spread, with their mean as a line."""
    returns = check_array("returns", returns, (-1,))
    sns.histplot(returns, ax=ax, color=color, bins=40, edgecolor="white", linewidth=0.3)
    ax.axvline(returns.mean(), color="black", lw=0.8, label=f"mean {returns.mean():.2f}")
    ax.set(xlabel="return per episode", ylabel="episodes")
    ax.legend(frameon=False, loc="upper left")
    return ax


def upper_bound(ax: Axes, value: float) -> Axes:
    """A dashed line where the mean return of every policy must stop."""
    ax.axvline(value, color="black", lw=0.8, ls="--", label=f"bound {value:.2f}")
    ax.legend(frameon=False, loc="upper left")
    return ax


def learning_curve(ax: Axes, steps: np.ndarray, means: np.ndarray, *, ylabel: str = "mean return") -> Axes:
    """Mean return of the teacher over its training steps."""
    steps = check_array("steps", steps, (-1,))
    means = check_array("means", means, steps.shape)
    ax.plot(steps / 1000, means, color=TEACHER)
    ax.set(xlabel="training steps (thousands)", ylabel=ylabel)
    return ax


def intervals(ax: Axes, frame: pd.DataFrame, *, color: str | list[str] = DISTILLED, label: str | None = None) -> Axes:
    """One row per entry of `frame` (index: names; columns here, low, high): a dot on its interval, the first on top."""
    rows = np.arange(len(frame))
    ax.hlines(rows, frame["low"], frame["high"], color=color, lw=1.2)
    ax.scatter(frame["here"], rows, color=color, s=10, zorder=3, label=label)
    ax.set_yticks(rows, frame.index)
    ax.set_ylim(len(frame) - 0.5, -0.5)
    ax.grid(axis="x", color="0.9", lw=0.5)
    ax.set_axisbelow(True)
    return ax


def again(ax: Axes, frame: pd.DataFrame) -> Axes:
    """A second measurement over `intervals`, as hollow dots; rows without one are NaN."""
    rows = np.arange(len(frame))
    ax.hlines(rows, frame["low"], frame["high"], color="black", lw=0.6, zorder=4)
    ax.scatter(frame["here"], rows, facecolor="white", edgecolor="black", s=10, lw=0.6, zorder=5)
    return ax


def margin(ax: Axes, texts: list[str], title: str) -> Axes:
    """A text beside each row of `intervals`, right of the axes, and what it is above."""
    for row, text in enumerate([title, *texts], start=-1):
        ax.text(1.03, row, text, transform=ax.get_yaxis_transform(), va="center", fontsize=7, color="0.3")
    return ax


def reference(ax: Axes, value: float, name: str, *, color: str = TEACHER, ls: str = "-") -> Axes:
    """A vertical line at a value that others are read against."""
    ax.axvline(value, color=color, lw=0.8, ls=ls, zorder=1, label=name)
    return ax


def ledger_gaps(ax: Axes, frame: pd.DataFrame, *, band: float) -> Axes:
    """How far the paper's values lie from ours, in half-widths of our intervals: a row per value.

    `frame` (index: names) has gap, verdict, wide (drawn hollow). Inside the shaded `band` a value counts as reproduced;
    the scale is linear in the band and logarithmic outside.
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
    """Lying boxes from Q1, median and Q3 alone; the whiskers end at the bounds beyond which a return is an outlier."""
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


def by_group(ax: Axes, frame: pd.DataFrame, *, x: str, y: str, color: str = DISTILLED) -> Axes:
    """One dot per row of `frame`, in columns by `x`, with a bar at the mean of each column."""
    sns.swarmplot(frame, x=x, y=y, ax=ax, color=color, size=3)
    for place, mean in enumerate(frame.groupby(x, sort=False)[y].mean()):
        ax.hlines(mean, place - 0.3, place + 0.3, color="black", lw=1.2, zorder=4, label="mean" if not place else None)
    return ax


def extent(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float, float]:
    """Edges of the outer pixels of a grid whose points are pixel centres, x and y (r, c) as of `geometry.grid`."""
    x, y = _grid(x, y)
    dx, dy = (x[0, 1] - x[0, 0]) / 2, (y[1, 0] - y[0, 0]) / 2
    return x[0, 0] - dx, x[0, -1] + dx, y[0, 0] - dy, y[-1, 0] + dy


def _grid(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x = check_array("x", x, (-1, -1))
    if min(x.shape) < 2:
        raise ValueError(f"the grid has shape {x.shape}, expected two points or more along each axis")
    return x, check_array("y", y, x.shape)


def _on_grid(what: str, x: np.ndarray, y: np.ndarray, values: np.ndarray) -> np.ndarray:
    """`values`, one for each point of the grid, in its shape. Raises ValueError for another number of them."""
    (x, _), values = _grid(x, y), check_finite(what, values)
    if values.size != x.size:
        raise ValueError(f"{what} have shape {values.shape}, expected one for each point of the grid {x.shape}")
    return values.reshape(x.shape)
