"""Maps: the actions of other people's agents, each with those of its policy below; and the polygons of an atlas."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from vsp.show.state_space import cells, image
from vsp.show.style import BORDER, FORCE_MAP
from vsp.tasks import get_task

from ..zoo import actions_of, plane, policy_of

COLUMNS = 4


def agent_maps(axes: np.ndarray, task: str, algorithms: list[str], labels: tuple[str, str, str]) -> Axes:
    """Draw a task's agents in every other row of `axes` (r * 4,), and below each its policy with the borders of cells.
    The two free axes show the colours and the `labels` of action and variables. Returns the first axes."""
    x, y, _ = plane(task)
    (fine_x, fine_y, states), high, grid = plane(task, 301), get_task(task).action_high, axes.reshape(-1, COLUMNS)
    look = {"cmap": FORCE_MAP, "vmin": -1, "vmax": 1, "interpolation": "bilinear"}
    for ax in axes:
        ax.set(xticks=[], yticks=[], aspect="auto")
        ax.spines[:].set_visible(ax is axes[-1])
    for i, algorithm in enumerate(algorithms):
        row, column = 2 * (i // COLUMNS), i % COLUMNS
        policy, (above, below) = policy_of(algorithm, task), grid[row : row + 2, column]
        image(above, x, y, (actions_of(algorithm, task) / high).reshape(x.shape), **look)
        image(below, fine_x, fine_y, (policy.predict(states)[0] / high).reshape(fine_x.shape), **look)
        for color, width in ((BORDER, 1.9), ("white", 0.8)):  # white in the dark, with a dark rim in the light
            cells(below, fine_x, fine_y, policy.cells(states), width=width, color=color)
        above.set(title=algorithm.upper(), ylabel="" if column else "agent")
        below.set(xlabel=f"{len(policy)} cell{'s' * (len(policy) > 1)}", ylabel="" if column else "ours")
    key = grid[-2, -1].inset_axes([0.1, 0.4, 0.8, 0.14], title=labels[0])
    bar = axes[0].figure.colorbar(axes[0].images[0], cax=key, orientation="horizontal", ticks=[-1, 0, 1])
    bar.set_ticklabels([f"{high[0] * end:g}".replace("-", "−") for end in (-1, 0, 1)])
    axes[-1].set_xlabel(f"{labels[1]} →")
    axes[-1].text(0.06, 0.5, f"{labels[2]} →", rotation=90, va="center")
    return axes[0]


def action_tones(actions: np.ndarray) -> np.ndarray:
    """Return colours (n, 3) of two actions (n, 2) in [-1, 1]: left is purple, right is orange, up is lighter."""
    right, up = ((actions + 1) / 2).T[..., None]
    left = (1 - up) * to_rgb("#5b2a86") + up * to_rgb("#b7a6dd")
    return (1 - right) * left + right * ((1 - up) * to_rgb("#c4560d") + up * to_rgb("#fbd08f"))


def polygons(ax: Axes, corners: np.ndarray, color: np.ndarray | str, *, edge: str = "face") -> None:
    """Draw polygons (n, k, 2) of `vsp_beyond.atlas`, with thin edges that keep narrow ones visible."""
    look = {"facecolors": color, "edgecolors": edge, "linewidths": 0.2 if edge == "face" else 0.1}
    ax.add_collection(PolyCollection(corners, **look, rasterized=True, zorder=3))
