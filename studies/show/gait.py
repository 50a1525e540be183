"""Draw a robot's gait as a moving stick figure, in the colour of the active cell, from recorded data alone."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from vsp.show import style
from vsp.show.animation import DPI, WIDTH, Animation, Stage, save_frames

THICK = 3.0  # line width of the body, in points
ENDS = ("x0", "z0", "x1", "z1")


def body_lines(gait: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return the lines of the body, each as its ends in every step (n, 2, 2): end, then x and z in metres."""
    names = [name.removesuffix(" x0") for name in gait.columns if name.endswith(" x0")]
    return {name: gait[[f"{name} {end}" for end in ENDS]].to_numpy().reshape(-1, 2, 2) for name in names}


def draw_pose(ax: Axes, lines: dict[str, np.ndarray], step: int, *, color: str) -> None:
    """Draw the body in one step, centred at x = 0."""
    parts = np.stack([ends[step] for ends in lines.values()])
    parts[:, :, 0] -= parts[:, :, 0].mean()
    ax.add_collection(LineCollection(list(parts), colors=[color], linewidths=THICK, capstyle="round"))


def cell_colors(gait: pd.DataFrame) -> dict[int, str]:
    """Return the colour of each cell that acts, in order of number; a number has the same colour in each figure."""
    return {int(cell): style.COLOURS[int(cell) % len(style.COLOURS)] for cell in np.unique(gait.cell)}


def footfall(ax: Axes, gait: pd.DataFrame, *, step_seconds: float) -> None:
    """Draw over time the active cell, as a band in its colour, and which foot is on the ground, as black bars."""
    colors, times = cell_colors(gait), step_seconds * np.arange(len(gait))
    ax.bar(times, 0.8, step_seconds, 1.6, align="edge", color=[colors[int(cell)] for cell in gait.cell])
    for i, foot in enumerate(("front", "back")):
        ax.bar(times, 0.6 * gait[foot], step_seconds, 0.8 * i, align="edge", color="black")
    ax.set(yticks=[0.3, 1.1, 2.0], yticklabels=["front foot", "back foot", "cell"], ylim=(-0.1, 2.5))
    ax.set(xlabel="time (s)", xlim=(0, times[-1] + step_seconds))


def save_gait(
    gait: pd.DataFrame, name: str, *, step_seconds: float, out: str | os.PathLike, quick: bool = False,
    alt: str | None = None,
) -> Animation:  # fmt: skip
    """Write OUT/figures/NAME.gif, and its last frame as NAME.png; return the animation to show.

    The GIF shows the body step by step, in the colours of its cells, above `footfall`. The ground has a mark every
    metre. `alt` describes the animation for readers who cannot see it; `quick` adds a watermark. The same gait gives
    the same bytes.
    """
    fig, (body, below) = style.panels(2, rows=2, width=WIDTH, height=2.8, dpi=DPI, height_ratios=(2, 1))
    lines, colors = body_lines(gait), cell_colors(gait)
    heights = np.concatenate([ends[:, :, 1].ravel() for ends in lines.values()])
    body.set(xlim=(-2.5, 2.5), ylim=(min(heights.min(), 0) - 0.15, heights.max() + 0.1), aspect="equal")
    body.set(xticks=[], yticks=[])
    body.spines[["left", "bottom"]].set_visible(False)
    body.axhline(0.0, color="0.6", zorder=0)
    marks = [Line2D([], [], color=color, linewidth=THICK, label=f"cell {cell + 1}") for cell, color in colors.items()]
    beside = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "handlelength": 1.0, "columnspacing": 1.0}
    body.legend(handles=marks, ncol=len(marks), frameon=False, **beside)
    footfall(below, gait, step_seconds=step_seconds)
    stage = Stage(fig)
    if quick:
        stage.watermark()

    def paint(step: int) -> None:
        draw_pose(body, lines, step, color=colors[int(gait.cell[step])])
        middle = np.mean([ends[step, :, 0] for ends in lines.values()])
        metres = np.arange(np.ceil(middle - 2.5), middle + 2.5) - middle
        body.plot(metres, np.zeros(len(metres)), "|", color="0.6", zorder=0)
        below.axvline(step_seconds * (step + 0.5), color="black", lw=1.5)

    images = [stage.shoot(lambda step=step: paint(step)) for step in range(len(gait))]
    return save_frames(images, name, out=out, alt=alt, step=round(1000 * step_seconds), hold=round(1000 * step_seconds))
