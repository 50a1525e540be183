"""Pictures for the explorer and the animations: drawn again and again, so each is quick to draw.

Arrays in, `Axes` out, as in `figures.py`, whose colours these share; and `Stage`, a figure that is drawn many times.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from PIL import Image
from scipy.ndimage import binary_erosion

from .figures import BORDER, COLOURS, DISTILLED, TEACHER, arrows, extent, force_map, over_iterations, square

CHOSEN = COLOURS[8]  # yellow
THICK = 3  # half the width, in grid steps, of the border of a chosen cell
_HALO = [withStroke(linewidth=2.5, foreground="white")]


class Stage:
    """A figure that is drawn once, in full; what a shot adds is drawn over a copy of it, and taken away after it.

    That leaves out axes, texts and legends, most of the work. What is added must lie above what stands there.
    """

    def __init__(self, fig: Figure):
        plt.close(fig)  # it lives on, but no notebook shows it of its own accord
        self.fig, self._canvas = fig, FigureCanvasAgg(fig)
        self.stand()

    def stand(self) -> None:
        """Take the figure as it is now for what stands there."""
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self.fig.bbox)
        self._standing = {ax: set(ax.get_children()) for ax in self.fig.axes}

    def watermark(self) -> None:
        """Mark all shots as those of a quick run, as `figures.save_figure` does."""
        about = {"fontsize": 36, "color": "0.5", "alpha": 0.4, "ha": "center", "va": "center", "rotation": 20}
        self.fig.text(0.5, 0.5, "quick run", animated=True, **about)  # drawn last, by each shot

    def shoot(self, paint: Callable[[], object]) -> np.ndarray:
        """The figure with what `paint` draws into its axes. (height, width, 3) bytes"""
        self._canvas.restore_region(self._still)
        try:
            paint()
            for ax in self._standing:
                for artist in sorted([*self._added(ax), *ax.spines.values()], key=lambda artist: artist.zorder):
                    ax.draw_artist(artist)  # the spines once more, for a map would cover half of them
        finally:  # what was painted until an error is not in the next shot
            for ax in self._standing:
                for artist in self._added(ax):
                    artist.remove()
        for mark in self.fig.texts:
            self.fig.draw_artist(mark)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _added(self, ax: Axes) -> list[Artist]:
        return [artist for artist in ax.get_children() if artist not in self._standing[ax]]


def png(image: np.ndarray, *, small: bool = False) -> bytes:
    """An image (height, width, 3) as a PNG file without dates; `small`: in 256 colours, slower and a third as large."""
    picture, file = Image.fromarray(image), io.BytesIO()
    if small:
        picture.quantize(256, dither=Image.Dither.NONE).save(file, "png", optimize=True)
    else:
        picture.save(file, "png", compress_level=1)
    return file.getvalue()


def ground(ax: Axes, task: str) -> Axes:
    """The axes of a task's policy maps: the unit square with goal and pit, or position and velocity."""
    if task == "SimpleGoal-v0":
        return square(ax)
    ax.set(xlabel="position", ylabel="velocity (per step)", xlim=(-1.2, 0.6), ylim=(-0.07, 0.07))
    return ax


def policy_map(ax: Axes, x: np.ndarray, y: np.ndarray, actions: np.ndarray, *, color: str):
    """Actions (n, m) on a grid: arrows of one colour where m is 2, else a force map. Returns what is drawn."""
    if actions.shape[1] == 2:
        return arrows(ax, np.column_stack([x.ravel(), y.ravel()]), actions, color=color)
    return force_map(ax, x, y, actions[:, 0])


def borders(ax: Axes, x: np.ndarray, y: np.ndarray, index: np.ndarray, *, chosen: int | None = None) -> Axes:
    """Borders of Voronoi cells from the cell of each grid point, as one picture: for many cells much quicker than
    `figures.cells`. The border of the cell `chosen` is thick."""
    index = index.reshape(x.shape)
    edge = np.zeros(index.shape, dtype=bool)
    beside, above = index[:, 1:] != index[:, :-1], index[1:] != index[:-1]
    edge[:, 1:] |= beside
    edge[:, :-1] |= beside
    edge[1:] |= above
    edge[:-1] |= above
    picture = edge[..., None] * np.array(mpl.colors.to_rgba(BORDER))
    if chosen is not None:
        inside = index == chosen
        picture[inside & ~binary_erosion(inside, iterations=THICK)] = mpl.colors.to_rgba("black")
    ax.imshow(picture, origin="lower", extent=extent(x, y), aspect=ax.get_aspect(), interpolation="bilinear", zorder=4)
    return ax


def changes(ax: Axes, came: np.ndarray, went: np.ndarray) -> Axes:
    """Codewords (k, 2) that came by a split, in rings, and places (j, 2) where one went by a merge, as crosses."""
    ax.scatter(*came.T, s=70, facecolor="none", edgecolor="black", lw=1.2, zorder=6, label="came by a split",
               path_effects=_HALO, clip_on=False)  # fmt: skip
    ax.scatter(*went.T, s=36, color="black", marker="x", lw=1.4, zorder=6, label="went by a merge",
               path_effects=_HALO, clip_on=False)  # fmt: skip
    return ax


def state(ax: Axes, point: np.ndarray) -> Axes:
    """The state (2,) that somebody chose, as a diamond."""
    ax.scatter(*point[:, None], s=55, color=CHOSEN, edgecolor="black", marker="D", lw=1.0, zorder=7,
               label="chosen state", clip_on=False)  # fmt: skip
    return ax


def cells_and_changes(ax: Axes, cells: np.ndarray, splits: Iterable[int], merges: Iterable[int]) -> Axes:
    """The number of cells over the iterations, and below it a tick for each iteration that split or merged."""
    over_iterations(ax, cells, ylabel="cells")
    top = max(cells)
    for row, (name, marker, iterations) in enumerate((("split", "^", splits), ("merge", "v", merges)), start=1):
        places = np.unique(list(iterations))
        ax.plot(places, np.full(len(places), -0.09 * row * top), marker, color="black", ms=2.5, lw=0)
        ax.text(1.01, -0.09 * row * top, name, transform=ax.get_yaxis_transform(), fontsize=6, va="center")
    ax.set(ylim=(-0.26 * top, 1.06 * top), xlim=(-0.02 * len(cells), 1.02 * len(cells)))
    ax.set_yticks([tick for tick in MaxNLocator(5, integer=True).tick_values(0, top) if 0 <= tick <= top])
    return ax


def moment(ax: Axes, n: int, cells: int) -> Axes:
    """A mark at iteration n on `cells_and_changes`."""
    ax.axvline(n, color="black", lw=0.8, ls=":")
    ax.plot(n, cells, "o", color="black", ms=4.5, zorder=5)
    ax.annotate(f"n = {n}", (1, 1), (0, 6), xycoords="axes fraction", textcoords="offset points", ha="right")
    return ax


def trials(ax: Axes, frame: pd.DataFrame, this: int) -> Axes:
    """Mean return over cells, a dot per row of `frame` (columns cells, mean return); the row `this` has a ring."""
    ax.scatter(frame["cells"], frame["mean return"], s=16, color=DISTILLED, zorder=3, label="a trial")
    chosen = frame.iloc[this]
    ax.scatter(chosen["cells"], chosen["mean return"], s=70, facecolor="none", edgecolor="black", lw=1.2, zorder=4,
               label="this trial")  # fmt: skip
    ax.set_xlim(0, 1.15 * max(10, frame["cells"].max()))
    return ax


def teacher_line(ax: Axes, mean: float) -> Axes:
    """The mean return that trials are measured by."""
    ax.axhline(mean, color=TEACHER, zorder=1, label="teacher")
    ax.set(xlabel="cells", ylabel="mean return")
    return ax
