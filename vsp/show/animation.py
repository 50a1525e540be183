"""Animations: a figure that is redrawn quickly many times, and GIFs with a still image for those who want no motion."""

from __future__ import annotations

import io
import os
from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from ..run import atomic
from . import style
from .captions import Caption, caption_of, file_of

WIDTH = 6.0  # inches
DPI, COLOURS = 120, 64  # dots per inch of a GIF, and the size of its palette


class Stage:
    """A figure that is drawn in full once. Each shot draws only its own artists over that image, then removes them.

    This skips axes, texts and legends, which take most of the time. The artists of a shot must lie above the figure.
    """

    def __init__(self, fig: Figure):
        plt.close(fig)  # only pyplot drops it, so that no notebook displays it by itself
        self.fig, self._canvas = fig, FigureCanvasAgg(fig)
        self.stand()

    def stand(self) -> None:
        """Draw the figure as it is now, as the background of all later shots."""
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self.fig.bbox)
        self._standing = {ax: set(ax.get_children()) for ax in self.fig.axes}

    def watermark(self) -> None:
        """Mark all shots as those of a quick run, as `save_figure` does."""
        style.watermark(self.fig, animated=True)  # drawn last, by each shot

    def shoot(self, paint: Callable[[], object]) -> np.ndarray:
        """Return the figure with what `paint` draws into its axes, as uint8 (height, width, 3)."""
        self._canvas.restore_region(self._still)
        try:
            paint()
            for ax in self._standing:
                for artist in sorted([*self._added(ax), *ax.spines.values()], key=lambda artist: artist.zorder):
                    ax.draw_artist(artist)  # redraw the spines: a map would cover half their width
        finally:  # also after an error: the next shot must not contain these artists
            for ax in self._standing:
                for artist in self._added(ax):
                    artist.remove()
        for mark in self.fig.texts:
            self.fig.draw_artist(mark)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _added(self, ax: Axes) -> list[Artist]:
        return [artist for artist in ax.get_children() if artist not in self._standing[ax]]


def png(pixels: np.ndarray) -> bytes:
    """Encode an image (height, width, 3) as PNG without dates, in 256 colours: a third the size."""
    file = io.BytesIO()
    Image.fromarray(pixels).quantize(256, dither=Image.Dither.NONE).save(file, "png", optimize=True)
    return file.getvalue()


class Animation:
    """A GIF as shown in a notebook: its last frame, and the GIF in a closed fold, so that nothing moves unasked."""

    def __init__(self, gif: bytes, still: bytes, about: Caption):
        self.gif, self.still, self.about = gif, still, about

    def _repr_html_(self) -> str:
        width = int(WIDTH * DPI)
        still = style.embedded(self.still, f"The last frame of the moving picture: {self.about.alt}", width=width)
        moving = style.embedded(self.gif, self.about.alt, width=width)
        folded = f"<details><summary>play the moving picture</summary>{moving}</details>"
        return f"<figure>{still}{folded}{self.about.to_html('figcaption')}</figure>"

    def __repr__(self) -> str:
        return self.about.alt


def save_frames(
    images: list[np.ndarray], name: str, *, out: str | os.PathLike, step: int, hold: int, alt: str | None = None
) -> Animation:  # fmt: skip
    """Write images (height, width, 3) as OUT/figures/NAME.gif, and the last one as NAME.png; return an animation.

    `step`: milliseconds per frame; `hold`: milliseconds of the last frame.
    """
    path, about = file_of("figures", name, out), caption_of("figures", name, alt=alt)
    animation = Animation(_gif(images, [step] * (len(images) - 1) + [hold]), png(images[-1]), about)
    for form, content in (("gif", animation.gif), ("png", animation.still)):
        with atomic.atomic_path(path.with_suffix(f".{form}")) as temporary:
            temporary.write_bytes(content)
    return animation


def _gif(images: list[np.ndarray], durations: list[int]) -> bytes:
    """Encode images with one common palette, so that each frame stores only the pixels that changed."""
    some = Image.fromarray(np.concatenate([images[i] for i in np.linspace(0, len(images) - 1, 6).astype(int)]))
    colours = np.reshape(some.quantize(COLOURS).getpalette(), (-1, 3))
    colours[(colours > 247).all(axis=1)] = 255  # the background stays white
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    frames = [Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    file = io.BytesIO()
    frames[0].save(file, "gif", save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=False)
    return file.getvalue()
