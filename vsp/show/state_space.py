"""Figures over a two-dimensional state: cells, codewords, arrows, force maps, episodes."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from ..history import History
from ..policy import VoronoiPolicy
from ..rollouts import Episode, Policy
from ..tasks import Task, simplegoal
from .style import BORDER, CELLS, CODEWORD, FORCE_MAP, GOAL, PIT, TEACHER, label

PALE = 0.42  # how much of its colour is in a cell; the rest is white


def birth_colours(
    policy: VoronoiPolicy, history: History | None = None, n: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of each codeword and the place of its colour in `CELLS`, which it has for life: (k,) and (k,).

    The number counts the births before. A newborn takes the colour whose nearest living bearer is farthest away; one
    that nobody has comes first. Codewords are born in their order. With the `history` of a run, `policy` is that after
    iteration `n`, each split gives birth, and each merge ends a life."""
    living: dict[tuple, tuple[int, int]] = {}
    born = 0
    changes = [("split", word) for word in (history.policy_at(0) if history else policy).codewords]
    changes += [(kind, word) for when, kind, word, _ in (history.events if history else ()) if when <= n]
    for kind, word in changes:
        if kind == "merge":
            del living[tuple(word)]
            continue
        near = np.full(len(CELLS), np.inf)
        for other, (_, tint) in living.items():
            near[tint] = min(near[tint], np.linalg.norm((word - other) / policy.scale))
        living[tuple(word)], born = (born, int(near.argmax())), born + 1
    numbers, tints = np.array([living[tuple(word)] for word in policy.codewords]).T
    return numbers, tints


def cells(
    ax: Axes, x: np.ndarray, y: np.ndarray, index: np.ndarray, *, fill: np.ndarray | None = None,
    width: float = 0.6, color: str = BORDER,
) -> None:  # fmt: skip
    """Draw the borders of Voronoi cells, `width` points wide. `index`: the cell of each grid point; `fill`: the place
    of each cell's colour in `CELLS` (k,)."""
    index = index.reshape(x.shape)
    if fill is not None:
        shades = 1 - PALE * (1 - mpl.colors.to_rgba_array(CELLS)[fill[index]])
        image(ax, x, y, shades, interpolation="nearest", zorder=0)
    for i in np.unique(index):
        inside = (index == i).astype(float)
        if inside.min() < 1:
            ax.contour(x, y, inside, levels=[0.5], colors=color, linewidths=width)


def codewords(ax: Axes, points: np.ndarray, *, numbers: bool | np.ndarray = False, size: float = 14) -> None:
    """Draw codewords (k, 2) as black dots with a white rim, and inside the axes `numbers` (k,), or their places."""
    look = {"color": CODEWORD, "edgecolor": "white", "linewidth": 0.04 * size, "zorder": 5, "clip_on": False}
    ax.scatter(*points.T, s=size, **look)
    names = np.arange(len(points)) if numbers is True else () if numbers is False else numbers
    for i, point in zip(names, points):
        right, up = point < [np.mean(ax.get_xlim()), np.mean(ax.get_ylim())]
        place = {"ha": "left" if right else "right", "va": "bottom" if up else "top"}
        offset = (3 if right else -3, 2 if up else -2)
        ax.annotate(str(i), point, xytext=offset, textcoords="offset points", fontsize=7, zorder=6, **place)


def square(ax: Axes) -> Axes:
    """Draw the unit square of SimpleGoal with goal and pit."""
    goal, pit = simplegoal.GOAL_EDGE, simplegoal.PIT_HIGH - simplegoal.PIT_LOW
    ax.add_patch(Rectangle((0, 0), goal, goal, color=GOAL, alpha=0.5, lw=0, zorder=1, label="goal"))
    ax.add_patch(Rectangle((simplegoal.PIT_LOW,) * 2, pit, pit, color=PIT, alpha=0.4, lw=0, zorder=1, label="pit"))
    ax.set(xlim=(0, 1), ylim=(0, 1), xlabel="x", ylabel="y", aspect="equal", xticks=[0, 0.5, 1], yticks=[0, 0.5, 1])
    return ax


def name_places(ax: Axes) -> None:
    """Name goal and pit, if the axes are the `square`."""
    for place in ax.patches:
        label(ax, place.get_bbox().x1 + 0.02, place.get_bbox().y0 + 0.01, place.get_label())


def plane(ax: Axes, task: Task) -> Axes:
    """Prepare axes for the two state variables of `task`: the `square` of SimpleGoal, or the box of the states."""
    if task.name == simplegoal.TASK.name:
        return square(ax)
    x, y = zip(task.low, task.high)
    ax.set(xlim=x, ylim=y, xlabel=task.input_labels[0], ylabel=task.input_labels[1])
    return ax


def actions(ax: Axes, task: Task, policy: Policy, states: np.ndarray, *, color: str = TEACHER) -> None:
    """Draw two actions as arrows at the `states` of a grid; a single one, a force, as a map of the whole plane."""
    if len(task.outputs) == 2:
        return arrows(plane(ax, task), states, policy.predict(states)[0], color=color)
    x, y, states = grid(task.low, task.high, 201)
    force_map(plane(ax, task), x, y, policy.predict(states)[0])


def arrows(ax: Axes, states: np.ndarray, actions: np.ndarray, *, color: str = TEACHER) -> None:
    """Draw an arrow per action (n, 2) at its state (n, 2) on a grid; a full diagonal action spans one grid step."""
    step = np.diff(np.unique(states[:, 0]))[0]
    scale = {"angles": "xy", "scale_units": "xy", "scale": 1.4 / step}
    ax.quiver(*states.T, *actions.T, color=color, width=0.006, zorder=3, **scale)


def image(ax: Axes, x: np.ndarray, y: np.ndarray, pixels: np.ndarray, **look) -> AxesImage:
    """Draw an image whose pixel centres are the points of a `grid`. The axes keep their aspect."""
    dx, dy = (x[0, 1] - x[0, 0]) / 2, (y[1, 0] - y[0, 0]) / 2
    edges = (x[0, 0] - dx, x[0, -1] + dx, y[0, 0] - dy, y[-1, 0] + dy)
    return ax.imshow(pixels, origin="lower", extent=edges, aspect=ax.get_aspect(), **look)


def force_map(ax: Axes, x: np.ndarray, y: np.ndarray, force: np.ndarray) -> AxesImage:
    """Draw force in [-1, 1] over position and velocity. Return the image, for `force_bar`."""
    ax.set(xlabel="position", ylabel="velocity (per step)")
    return image(ax, x, y, force.reshape(x.shape), cmap=FORCE_MAP, vmin=-1, vmax=1)


def force_bar(fig: Figure, drawn: AxesImage, axes: np.ndarray) -> None:
    """Add one colour bar for all force maps of a figure."""
    bar = fig.colorbar(drawn, ax=list(axes), ticks=[-1, 0, 1], aspect=30)
    bar.ax.set_title("force", fontsize=7, loc="left")
    bar.ax.set_yticklabels(["−1 (left)", "0", "+1 (right)"])


def error_map(
    ax: Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray, *, label: str, beside: np.ndarray | None = None
) -> None:
    """Draw a non-negative quantity over a two-dimensional state, darker where larger, with a colour bar. All axes in
    `beside` (None: only `ax`) make room for the colour bar, so that they stay equal in size."""
    drawn = image(ax, x, y, error.reshape(x.shape), cmap="Reds", vmin=0)
    ax.figure.colorbar(drawn, ax=ax if beside is None else list(beside), label=label)


def trail(ax: Axes, episode: Episode, task: Task, *, color: str) -> None:
    """Draw the states of one episode as a line, from a ring to the state after the last action."""
    last, _, _ = task.step(episode.states[-1:], episode.actions[-1:])
    way = np.concatenate([episode.states, last])
    ax.plot(*way.T, color=color, marker=".", ms=3, lw=0.9, zorder=4)
    ax.plot(*way[0], ls="", color=color, marker="o", mfc="white", ms=5, zorder=5)


def grid(low: np.ndarray, high: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make a grid over a two-dimensional box, to draw on: x (r, r), y (r, r), and its points as states (r * r, 2)."""
    x, y = np.meshgrid(*np.linspace(low, high, resolution).T)
    return x, y, np.column_stack([x.ravel(), y.ravel()])
