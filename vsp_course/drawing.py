"""Pictures of the course, shown in the notebook and not saved."""

import io

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from vsp import History, Policy, VoronoiPolicy, show


def picture(fig: Figure, alt: str) -> show.Picture:
    """Close the figure and return it as a picture. `alt` describes it for readers who cannot see it."""
    png = io.BytesIO()
    fig.savefig(png, dpi="figure", metadata={"Software": None})
    plt.close(fig)
    return show.Picture(png.getvalue(), show.Caption("", "", alt))


def squared_error(policy: Policy, teacher: Policy, states: np.ndarray) -> np.ndarray:
    """Return the squared difference of both actions in each state (n, d), averaged over their components. (n,)"""
    return np.square(policy.predict(states)[0] - teacher.predict(states)[0]).mean(axis=1)


def pair() -> tuple[Figure, np.ndarray]:
    """A figure for two squares of the same size side by side, with room for a colour bar beside each."""
    return show.panels(2, width=6.0, height=2.3)


def walls(ax: Axes) -> Axes:
    """Draw the unit square of SimpleGoal with its walls and a margin for arrows that point beyond them."""
    show.square(ax).add_patch(Rectangle((0, 0), 1, 1, fill=False, lw=0.6, zorder=2))
    ax.spines[:].set_visible(False)
    ax.set(xlim=(-0.05, 1.05), ylim=(-0.05, 1.05))
    return ax


def actions_and_error(
    policy: VoronoiPolicy, teacher: Policy, states: np.ndarray | None = None, history: History | None = None
) -> tuple[Figure, np.ndarray]:
    """Draw a policy's arrows on SimpleGoal beside its squared error, both with cells and codewords. The error is shown
    over the whole square, or in `states` (n, 2). Numbers are those of births in the `history`."""
    x, y, grid = show.grid(policy.task.low, policy.task.high, 101)
    _, _, sparse = show.grid(policy.task.low, policy.task.high, 21)
    fig, axes = pair()
    show.arrows(axes[0], sparse, policy.predict(sparse)[0], color=show.DISTILLED)
    if states is None:
        show.error_map(axes[1], x, y, squared_error(policy, teacher, grid), label="squared error")
    else:
        on_the_way(axes[1], states, squared_error(policy, teacher, states))
    for ax in axes:
        show.cells(walls(ax), x, y, policy.cells(grid))
        show.codewords(ax, policy.codewords, numbers=show.state_space.birth_colours(policy, history)[0])
    show.letter(axes, ["the policy", "its error" if states is None else "its error where the teacher goes"])
    return fig, axes


def on_the_way(ax: Axes, states: np.ndarray, error: np.ndarray) -> Axes:
    """Draw the error (n,) in visited states (n, 2): one dot per state, larger for a larger error."""
    style = {"color": show.DISTILLED, "alpha": 0.4, "lw": 0, "zorder": 3, "clip_on": False}
    ax.scatter(*states.T, s=1 + 12 * error, **style)
    for value in (0, 1, 2, 4):
        ax.scatter([], [], s=1 + 12 * value, label=str(value), **style)
    ax.legend(title="squared error", title_fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.02, 0.5))
    return ax
