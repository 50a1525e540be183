"""Figures of proofs: which starts reach the goal, and in how many steps."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from vsp.show.style import FAILING, PIT
from vsp.tasks.simplegoal import GOAL_EDGE, PIT_HIGH, PIT_LOW

KEPT = "0.6"
STEPS = "viridis_r"  # few steps are light


def basins(ax: Axes, polygons: list[np.ndarray], steps: np.ndarray, reached: np.ndarray, most: int) -> ScalarMappable:
    """Draw the pieces of SimpleGoal's starts.

    Each of the n `polygons` (k, 2) has the `steps` (n,) of its episodes and whether these `reached` (n,) the goal.
    Colours run to `most` steps. Failing pieces are vermilion, with an outline that keeps narrow ones visible."""
    colours = ScalarMappable(Normalize(0, most), STEPS)
    faces = colours.to_rgba(np.asarray(steps, dtype=float))
    faces[~reached] = mpl.colors.to_rgba(FAILING)
    for chosen, width, order in ((reached, 0.1, 1), (~reached, 0.3, 2)):
        shown = [polygon for polygon, kept in zip(polygons, chosen) if kept]
        ax.add_collection(
            PolyCollection(shown, facecolors=faces[chosen], edgecolors=faces[chosen], linewidths=width, zorder=order,
                           antialiaseds=False, rasterized=True)
        )  # fmt: skip
    for low, high, style in ((0.0, GOAL_EDGE, "-"), (PIT_LOW, PIT_HIGH, "--")):
        ax.add_patch(Rectangle((low, low), high - low, high - low, fill=False, ec=PIT, lw=0.8, ls=style, zorder=3))
    ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="x", ylabel="y")
    return colours


def upright(ax: Axes, numbers: np.ndarray, most: int) -> ScalarMappable:
    """Draw what is proved for boxes of Pendulum's states: angle by angular velocity.

    `numbers` (n, n) are the steps to a set around upright that is never left. They are -1 in the set (grey) and 0 where
    nothing is proved (white). Colours run to `most` steps."""
    colours = ScalarMappable(Normalize(0, most), STEPS)
    pixels = colours.to_rgba(np.maximum(numbers.T, 0).astype(float))
    pixels[numbers.T == 0] = 1.0
    pixels[numbers.T == -1] = mpl.colors.to_rgba(KEPT)
    ax.imshow(pixels, origin="lower", extent=(-np.pi, np.pi, -8, 8), aspect="auto", interpolation="nearest")
    ax.set(xlabel="angle (rad)", ylabel="angular velocity (rad/s)")
    ax.set_xticks([-np.pi, 0, np.pi], ["−π", "0", "π"])
    return colours
