"""Pictures of the course: shown in the notebook, written nowhere."""

from __future__ import annotations

import io

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from .. import figures, geometry
from ..policy import VoronoiPolicy
from ..rollouts import Policy


def show(fig: Figure, alt: str) -> figures.Picture:
    """Close the figure and return it as a picture; `alt` describes what there is to see for someone who cannot."""
    png = io.BytesIO()
    fig.savefig(png, dpi=150, metadata={"Software": None})
    plt.close(fig)
    return figures.Picture(png.getvalue(), alt)


def squared_error(policy: Policy, teacher: Policy, states: np.ndarray) -> np.ndarray:
    """Of the actions in each of the states (n, d), the mean over their components. (n,)"""
    return np.square(policy.predict(states)[0] - teacher.predict(states)[0]).mean(axis=1)


def pair() -> tuple[Figure, np.ndarray]:
    """A figure with two squares of one size side by side, and room for the scale of each."""
    return figures.panels(2, width=6.0, height=2.3)


def walls(ax: Axes) -> Axes:
    """The unit square of SimpleGoal with its walls, and room around it for arrows that lead beyond them."""
    figures.square(ax).add_patch(Rectangle((0, 0), 1, 1, fill=False, lw=0.6, zorder=2))
    ax.spines[:].set_visible(False)
    ax.set(xlim=(-0.05, 1.05), ylim=(-0.05, 1.05))
    return ax


def copy_and_error(
    policy: VoronoiPolicy, teacher: Policy, states: np.ndarray | None = None
) -> tuple[Figure, np.ndarray]:
    """The arrows of a policy on SimpleGoal beside its squared error, both with cells and codewords. The error is that
    over the square, or in `states` (n, 2)."""
    x, y, grid = geometry.grid(policy.task.low, policy.task.high, 101)
    _, _, sparse = geometry.grid(policy.task.low, policy.task.high, 21)
    fig, axes = pair()
    figures.arrows(axes[0], sparse, policy.predict(sparse)[0], color=figures.DISTILLED)
    if states is None:
        figures.error_map(axes[1], x, y, squared_error(policy, teacher, grid), label="squared error")
    else:
        on_the_way(axes[1], states, squared_error(policy, teacher, states))
    for ax in axes:
        figures.cells(walls(ax), x, y, policy.cells(grid))
        figures.codewords(ax, policy.codewords, numbers=True)
    figures.letter(axes, ["the copy", "its error" if states is None else "its error where the teacher goes"])
    return fig, axes


def on_the_way(ax: Axes, states: np.ndarray, error: np.ndarray) -> Axes:
    """The error (n,) of a copy in the states (n, 2) that were visited: a dot each, the larger the worse."""
    style = {"color": figures.DISTILLED, "alpha": 0.4, "lw": 0, "zorder": 3, "clip_on": False}
    ax.scatter(*states.T, s=1 + 12 * error, **style)
    for value in (0, 1, 2, 4):
        ax.scatter([], [], s=1 + 12 * value, label=str(value), **style)
    ax.legend(title="squared error", title_fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.02, 0.5))
    return ax
