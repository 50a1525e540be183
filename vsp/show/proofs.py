"""What is proved: from which starts episodes reach the goal, and in how many steps."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from ..tasks.simplegoal import GOAL_EDGE, PIT_HIGH, PIT_LOW
from .style import COLOURS, PIT

FAILING, KEPT = COLOURS[3], COLOURS[4]
STEPS = "viridis_r"  # few steps are light


def basins(ax: Axes, polygons: list[np.ndarray], steps: np.ndarray, reached: np.ndarray, most: int) -> ScalarMappable:
    """The pieces of SimpleGoal's starts: `polygons` (k, 2), the steps of their episodes (n,), and whether these reach
    the goal (n,). Colours run to `most` steps; failing pieces are orange, and at least a hair wide."""
    colours = ScalarMappable(Normalize(0, most), STEPS)
    faces = colours.to_rgba(np.asarray(steps, dtype=float))
    faces[~reached] = mpl.colors.to_rgba(FAILING)
    for chosen, width, order in ((reached, 0.1, 1), (~reached, 0.3, 2)):
        shown = [polygon for polygon, one in zip(polygons, chosen) if one]
        ax.add_collection(
            PolyCollection(shown, facecolors=faces[chosen], edgecolors=faces[chosen], linewidths=width, zorder=order,
                           antialiaseds=False, rasterized=True)
        )  # fmt: skip
    for low, high, style in ((0.0, GOAL_EDGE, "-"), (PIT_LOW, PIT_HIGH, "--")):
        ax.add_patch(Rectangle((low, low), high - low, high - low, fill=False, ec=PIT, lw=0.8, ls=style, zorder=3))
    ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="x", ylabel="y")
    return colours


def upright(ax: Axes, numbers: np.ndarray, most: int) -> ScalarMappable:
    """Pendulum's states, in boxes of angle by angular velocity `numbers` (n, n): steps to a set around upright that is
    never left, -1 in the set (pink), 0 where nothing is proved (white)."""
    colours = ScalarMappable(Normalize(0, most), STEPS)
    pixels = colours.to_rgba(np.maximum(numbers.T, 0).astype(float))
    pixels[numbers.T == 0] = 1.0
    pixels[numbers.T == -1] = mpl.colors.to_rgba(KEPT)
    ax.imshow(pixels, origin="lower", extent=(-np.pi, np.pi, -8, 8), aspect="auto", interpolation="nearest")
    ax.set(xlabel="angle (rad)", ylabel="angular velocity (rad/s)")
    ax.set_xticks([-np.pi, 0, np.pi], ["−π", "0", "π"])
    return colours
