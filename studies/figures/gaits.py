"""Draw a robot's gait from recorded data: poses in the colour of the active cell, and the feet below."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from vsp.show import style
from vsp.show.state_space import PALE

ENDS = ("x0", "z0", "x1", "z1")
APART = 1.6  # metres from one pose to the next


def poses(ax: Axes, gait: pd.DataFrame, *, every: int) -> None:
    """Draw the body in every `every`-th step, side by side, in the colour of its cell."""
    names, colors = [name for name in gait.columns if name.endswith(" x0")], cell_colors(gait)
    columns = [name.replace("x0", end) for name in names for end in ENDS]
    shown = gait.iloc[every // 2 :: every]
    for i, (cell, numbers) in enumerate(zip(shown["cell"], shown[columns].to_numpy())):
        lines = numbers.reshape(-1, 2, 2)  # both ends of each, as x and z in metres
        moved = lines + [(i + 0.5) * APART - lines[..., 0].mean(), 0]
        ax.add_collection(LineCollection(moved, color=colors[cell], lw=2, capstyle="round"))
    ax.axhline(0, color="0.6", lw=0.8, zorder=0)
    ax.set(xlim=(0, len(shown) * APART), ylim=(-0.1, 1.2), aspect="equal")
    ax.set_axis_off()


def cell_colors(gait: pd.DataFrame) -> dict[int, str]:
    """Return the colour of each cell that acts, in order of number; a number has the same colour in each figure."""
    return {int(cell): style.CELLS[int(cell) % len(style.CELLS)] for cell in np.unique(gait.cell)}


def footfall(ax: Axes, gait: pd.DataFrame, *, step_seconds: float) -> None:
    """Draw over time the active cell, as a band in its colour, pale, and which foot is on the ground, as black bars."""
    colors, times = cell_colors(gait), step_seconds * np.arange(len(gait))
    ax.bar(times, 0.8, step_seconds, 1.6, align="edge", color=[colors[int(cell)] for cell in gait.cell], alpha=PALE)
    for time, cell in zip(times, gait.cell):
        ax.text(time + step_seconds / 2, 2.0, str(cell), ha="center", va="center", size="small")
    for i, foot in enumerate(("front", "back")):
        ax.bar(times, 0.6 * gait[foot], step_seconds, 0.8 * i, align="edge", color="black")
    ax.set(yticks=[0.3, 1.1, 2.0], yticklabels=["front foot", "back foot", "cell"], ylim=(-0.1, 2.5))
    ax.set(xlabel="time (s)", xlim=(0, times[-1] + step_seconds))
