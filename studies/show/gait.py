"""Draw a robot's gait as a moving stick figure, in the colour of the active cell, from recorded data alone."""

from __future__ import annotations

import os

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from PIL import Image

from vsp.run import atomic
from vsp.show import style
from vsp.show.captions import Caption, caption_of, file_of

THICK = 3.0  # line width of the body, in points
ENDS = ("x0", "z0", "x1", "z1")


class MovingPicture(style.Picture):
    """A GIF as shown in a notebook: its last frame, and the GIF in a closed fold, so that nothing moves unasked."""

    def __init__(self, png: bytes, gif: bytes, about: Caption):
        super().__init__(png, about)
        self.gif = gif

    def _repr_html_(self) -> str:
        still = style.embedded(self.png, f"The last frame of the moving picture: {self.about.alt}")
        moving = style.embedded(self.gif, self.about.alt)
        folded = f"<details><summary>play the moving picture</summary>{moving}</details>"
        return f"<figure>{still}{folded}{self.about.to_html('figcaption')}</figure>"


def body_lines(gait: pd.DataFrame) -> np.ndarray:
    """Return the lines of the body in every step (n, lines, 2, 2): both ends of each, as x and z in metres."""
    names = [name.removesuffix(" x0") for name in gait.columns if name.endswith(" x0")]
    return gait[[f"{name} {end}" for name in names for end in ENDS]].to_numpy().reshape(len(gait), -1, 2, 2)


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
    gait: pd.DataFrame, name: str, *, step_seconds: float, out: str | os.PathLike, quick: bool = False
) -> MovingPicture:  # fmt: skip
    """Write OUT/figures/NAME.gif, and its last frame as NAME.png; return the picture to show.

    The GIF shows the body step by step, in the colours of its cells, above `footfall`. The ground has a mark every
    metre. `quick` adds a watermark. The same gait gives the same bytes.
    """
    about, path = caption_of("figures", name), file_of("figures", name, out)
    frames, moving, still = _frames(gait, step_seconds, quick), path.with_suffix(".gif"), path.with_suffix(".png")
    with atomic.atomic_path(moving) as temporary:
        frames[0].save(temporary, save_all=True, append_images=frames[1:], duration=round(1000 * step_seconds), loop=0)
    with atomic.atomic_path(still) as temporary:
        frames[-1].save(temporary, optimize=True)
    return MovingPicture(still.read_bytes(), moving.read_bytes(), about)


def _frames(gait: pd.DataFrame, step_seconds: float, quick: bool) -> list[Image.Image]:
    """Draw each step."""
    fig, (body, below) = style.panels(2, rows=2, width=6.0, height=2.8, dpi=120, height_ratios=(2, 1))
    plt.close(fig)  # only pyplot drops it, so that no notebook displays it by itself
    lines, colors = body_lines(gait), cell_colors(gait)
    x, z = lines[..., 0], lines[..., 1]
    body.set(xlim=(-2.5, 2.5), ylim=(min(z.min(), 0) - 0.15, z.max() + 0.1), aspect="equal", xticks=[], yticks=[])
    body.spines[["left", "bottom"]].set_visible(False)
    body.axhline(0.0, color="0.6", zorder=0)
    marks = [Line2D([], [], color=color, linewidth=THICK, label=f"cell {cell}") for cell, color in colors.items()]
    body.legend(handles=marks, ncol=len(marks), frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    footfall(below, gait, step_seconds=step_seconds)
    if quick:
        style.watermark(fig)

    pose = body.add_collection(LineCollection([], linewidths=THICK, capstyle="round"), autolim=False)
    (metres,) = body.plot([], [], "|", color="0.6", zorder=0)
    now = below.axvline(0.0, color="black", lw=1.5)
    canvas, images = FigureCanvasAgg(fig), []
    for step, cell in enumerate(gait.cell):
        middle = x[step].mean()
        pose.set(segments=lines[step] - [middle, 0.0], color=colors[int(cell)])
        places = np.arange(np.ceil(middle - 2.5), middle + 2.5) - middle
        metres.set_data(places, np.zeros(len(places)))
        now.set_xdata(2 * [step_seconds * (step + 0.5)])
        canvas.draw()
        fig.set_layout_engine("none")  # the layout of the first step stays
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    palette = images[0].quantize(256, Image.Quantize.MAXCOVERAGE)  # the first image has all colours, in its legend
    palette.putpalette([255 if value > 247 else value for value in palette.getpalette()])  # the background stays white
    return [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
