"""`Stage`, a figure that is redrawn quickly many times, and what the animations draw on it."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from PIL import Image

from .returns import over_iterations
from .state_space import arrows, force_map, image, square
from .style import BORDER

_HALO = [withStroke(linewidth=2.5, foreground="white")]


class Stage:
    """A figure that is drawn in full once. Each shot draws only its own artists over that image, then removes them.

    This skips axes, texts and legends, which take most of the time. The artists of a shot must lie above the figure.
    """

    def __init__(self, fig: Figure):
        plt.close(fig)  # only pyplot drops it, so that no notebook displays it by itself
        self.fig, self._canvas = fig, FigureCanvasAgg(fig)
        self.stand()

    def stand(self) -> None:
        """Draw the figure as it is now, as the background of all later shots."""
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self.fig.bbox)
        self._standing = {ax: set(ax.get_children()) for ax in self.fig.axes}

    def watermark(self) -> None:
        """Mark all shots as those of a quick run, as `save_figure` does."""
        about = {"fontsize": 36, "color": "0.5", "alpha": 0.4, "ha": "center", "va": "center", "rotation": 20}
        self.fig.text(0.5, 0.5, "quick run", animated=True, **about)  # drawn last, by each shot

    def shoot(self, paint: Callable[[], object]) -> np.ndarray:
        """Return the figure with what `paint` draws into its axes, as uint8 (height, width, 3)."""
        self._canvas.restore_region(self._still)
        try:
            paint()
            for ax in self._standing:
                for artist in sorted([*self._added(ax), *ax.spines.values()], key=lambda artist: artist.zorder):
                    ax.draw_artist(artist)  # redraw the spines: a map would cover half their width
        finally:  # also after an error: the next shot must not contain these artists
            for ax in self._standing:
                for artist in self._added(ax):
                    artist.remove()
        for mark in self.fig.texts:
            self.fig.draw_artist(mark)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _added(self, ax: Axes) -> list[Artist]:
        return [artist for artist in ax.get_children() if artist not in self._standing[ax]]


def png(pixels: np.ndarray, *, small: bool = False) -> bytes:
    """Encode an image (height, width, 3) as PNG without dates; `small`: 256 colours, a third the size, but slower."""
    picture, file = Image.fromarray(pixels), io.BytesIO()
    if small:
        picture.quantize(256, dither=Image.Dither.NONE).save(file, "png", optimize=True)
    else:
        picture.save(file, "png", compress_level=1)
    return file.getvalue()


def ground(ax: Axes, task: str) -> Axes:
    """Set up the axes of a task's policy maps: the unit square with goal and pit, or position and velocity."""
    if task == "SimpleGoal-v0":
        return square(ax)
    ax.set(xlabel="position", ylabel="velocity (per step)", xlim=(-1.2, 0.6), ylim=(-0.07, 0.07))
    return ax


def policy_map(ax: Axes, x: np.ndarray, y: np.ndarray, actions: np.ndarray, *, color: str):
    """Draw actions (n, m) on a grid: arrows of one colour if m is 2, else a force map. Return the artist."""
    if actions.shape[1] == 2:
        return arrows(ax, np.column_stack([x.ravel(), y.ravel()]), actions, color=color)
    return force_map(ax, x, y, actions[:, 0])


def borders(ax: Axes, x: np.ndarray, y: np.ndarray, index: np.ndarray) -> Axes:
    """Draw the borders of Voronoi cells; `index` is the cell of each grid point.

    The borders are one image. For many cells this is much faster than the contours of `state_space.cells`.
    """
    index = index.reshape(x.shape)
    outer = np.pad(index, 1, mode="edge")  # each point has four neighbours
    neighbours = outer[:-2, 1:-1], outer[2:, 1:-1], outer[1:-1, :-2], outer[1:-1, 2:]
    edge = np.any([index != other for other in neighbours], axis=0)
    picture = edge[..., None] * np.array(mpl.colors.to_rgba(BORDER))
    image(ax, x, y, picture, aspect=ax.get_aspect(), interpolation="bilinear", zorder=4)
    return ax


def changes(ax: Axes, came: np.ndarray, went: np.ndarray) -> Axes:
    """Draw codewords (k, 2) added by a split as rings, and codewords (j, 2) removed by a merge as crosses."""
    look = {"zorder": 6, "path_effects": _HALO, "clip_on": False}
    ax.scatter(*came.T, s=70, facecolor="none", edgecolor="black", lw=1.2, label="came by a split", **look)
    ax.scatter(*went.T, s=36, color="black", marker="x", lw=1.4, label="went by a merge", **look)
    return ax


def cells_and_changes(ax: Axes, cells: np.ndarray, splits: Iterable[int], merges: Iterable[int]) -> Axes:
    """Plot the number of cells over the iterations, and below it a mark for each iteration that split or merged."""
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
    """Mark iteration n on `cells_and_changes`."""
    ax.axvline(n, color="black", lw=0.8, ls=":")
    ax.plot(n, cells, "o", color="black", ms=4.5, zorder=5)
    ax.annotate(f"n = {n}", (1, 1), (0, 6), xycoords="axes fraction", textcoords="offset points", ha="right")
    return ax
