"""Pictures of the course: shown in the notebook, written nowhere."""

from __future__ import annotations

import io

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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


def copy_and_error(policy: VoronoiPolicy, teacher: Policy) -> tuple[Figure, np.ndarray]:
    """The arrows of a policy on SimpleGoal beside its squared error, both with cells and codewords."""
    x, y, grid = geometry.grid(policy.task.low, policy.task.high, 101)
    _, _, sparse = geometry.grid(policy.task.low, policy.task.high, 21)
    fig, axes = figures.panels(2)
    figures.arrows(figures.square(axes[0]), sparse, policy.predict(sparse)[0], color=figures.DISTILLED)
    figures.error_map(figures.square(axes[1]), x, y, squared_error(policy, teacher, grid), label="squared error")
    for ax in axes:
        figures.cells(ax, x, y, policy.cells(grid))
        figures.codewords(ax, policy.codewords, numbers=True)
    figures.letter(axes, ["the copy", "its error"])
    return fig, axes


def on_the_way(ax: Axes, states: np.ndarray, error: np.ndarray) -> Axes:
    """The error (n,) of a copy in the states (n, 2) that were visited: a dot each, the larger the worse."""
    figures.square(ax).scatter(
        *states.T, s=1 + 12 * error, color=figures.DISTILLED, alpha=0.4, lw=0, zorder=6, clip_on=False
    )
    return ax
