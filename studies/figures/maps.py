"""Figures of other people's agents: the actions of each as a map, with those of its policy below."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from vsp.show.state_space import cells, image
from vsp.show.style import FORCE_MAP
from vsp.tasks import get_task

from ..zoo import actions_of, plane, policy_of

COLUMNS = 4


def agent_maps(axes: np.ndarray, task: str, algorithms: list[str], labels: tuple[str, str]) -> Axes:
    """Draw a task's agents in every other row of `axes` (r * 4,), and below each its policy with the borders of cells.

    `labels` of the two variables stand in the last axes, which are free. Returns the axes of the first map.
    """
    x, y, states = plane(task)
    high, grid = get_task(task).action_high, axes.reshape(-1, COLUMNS)
    for ax in axes:
        ax.set_axis_off()
    for i, algorithm in enumerate(algorithms):
        row, column = 2 * (i // COLUMNS), i % COLUMNS
        policy, (above, below) = policy_of(algorithm, task), grid[row : row + 2, column]
        for ax, actions in ((above, actions_of(algorithm, task)), (below, policy.predict(states)[0])):
            image(ax, x, y, (actions / high).reshape(x.shape), cmap=FORCE_MAP, vmin=-1, vmax=1)
            ax.set(xticks=[], yticks=[], aspect="auto")
            ax.set_axis_on()
        cells(below, x, y, policy.cells(states), width=1.0)
        above.set_title(algorithm.upper())
        below.set_xlabel(f"{len(policy)} cell{'s' * (len(policy) > 1)}")
    grid[-1, -1].text(0.5, 0.5, "across: {}\nup: {}".format(*labels), ha="center", va="center")
    return axes[0]
