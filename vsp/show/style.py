"""Style of all figures: one colour for each thing, used everywhere, and one `save_figure`.

The force map runs from purple (push left) to orange (push right).
"""

import base64
import html
import io
import os

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from PIL import Image

from ..run import atomic
from .captions import Caption, caption_of, file_of

TEXT_WIDTH = 12.2 / 2.54  # inches; the text width of LNCS
# One colour, one meaning, after seaborn's palette "colorblind". What is none of these has no
# colour of its own: a shade of grey, a marker, a line style.
#   TEACHER    blue        the teacher, and what it returns
#   DISTILLED  light blue  policies distilled by the paper's method, and one linear map fitted to the teacher
#   OURS       purple      policies of our own method, fitted to the teacher or tuned for the return
#   GOAL       green       the goal, the flag
#   PIT        dark grey   the pit
#   FAILING    vermilion   a start or an episode that fails
#   OTHER      grey        everything else: trees, small networks, limits
TEACHER, DISTILLED, GOAL, FAILING, OURS = "#0173b2", "#3a9fd8", "#029e73", "#d55e00", "#cc78bc"
PIT, BORDER, CODEWORD, OTHER = "0.35", "0.25", "black", "0.4"
CELLS = ("#56b4e9", "#ece133", "#73502e", "#581799", "#95e6bd", "#732e62", "#86bf4d", "#2222e6")  # of cells, pale
FORCE_MAP = "PuOr_r"

_STYLE = {
    "font.size": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "figure.dpi": 150,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,  # TrueType fonts, embedded
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def panels(
    n: int = 1, *, height: float = 2.3, width: float = TEXT_WIDTH, rows: int = 1, **subplots
) -> tuple[Figure, np.ndarray]:
    """Make a figure with n panels in `rows` rows, by default as wide as the text of an LNCS page; sizes in inches.
    Returns the figure and its axes (n,). Sets the style of all later figures."""
    mpl.rcParams.update(_STYLE)
    fig, axes = plt.subplots(rows, n // rows, figsize=(width, height), layout="constrained", squeeze=False, **subplots)
    return fig, axes.ravel()


def embedded(image: bytes, alt: str, *, width: int = 720) -> str:
    """Return the bytes of an image file as an HTML element, `width` pixels wide, or less if there is less room. Width
    and height are stated so that the page does not jump while it loads; decoding is synchronous so that replacing a
    picture does not flicker. Raises PIL.UnidentifiedImageError if `image` is no image."""
    with Image.open(io.BytesIO(image)) as opened:
        kind, height = opened.get_format_mimetype(), round(width * opened.height / opened.width)
    size = f'width="{width}" height="{height}" style="max-width: 100%; height: auto"'
    data = base64.b64encode(image).decode()
    return f'<img alt="{html.escape(alt)}" src="data:{kind};base64,{data}" {size} decoding="sync">'


class Picture:
    """A saved figure as shown in a notebook: HTML, because nbconvert drops the alternative text of a plain image."""

    def __init__(self, png: bytes, about: Caption):
        self.png, self.about = png, about

    def _repr_html_(self) -> str:
        return f"<figure>{embedded(self.png, self.about.alt)}{self.about.to_html('figcaption')}</figure>"

    def __repr__(self) -> str:
        return self.about.alt


def save_figure(fig: Figure, name: str, *, out: str | os.PathLike, quick: bool = False, alt: str = "") -> Picture:
    """Write OUT/figures/NAME.pdf and .png, close the figure and return the picture to show; NAME may be "beyond/x".

    `alt` describes the figure for readers who cannot see it; both files contain it. By default it comes, as the caption
    does, from notebooks/captions.toml. `quick` adds a watermark. The files contain no dates or version
    numbers, so the same figure gives the same bytes. Raises ValueError for a figure without an alternative text."""
    about = caption_of("figures", name, alt=alt)
    if quick:
        fig.text(0.5, 0.5, "quick run", fontsize=36, color="0.5", alpha=0.4, ha="center", va="center", rotation=20)
    path = file_of("figures", name, out)
    undated = {"CreationDate": None, "Creator": None, "Producer": None}
    said = (("pdf", {"Subject": about.alt, **undated}), ("png", {"Description": about.alt, "Software": None}))
    for form, metadata in said:
        drawn = io.BytesIO()  # on a full disk, matplotlib's PDF writer would replace the disk's error by one of zlib's
        fig.savefig(drawn, format=form, metadata={"Title": path.name, **metadata})
        atomic.write_bytes(path.with_suffix(f".{form}"), drawn.getvalue())
    plt.close(fig)
    return Picture(drawn.getvalue(), about)


def label(ax: Axes, x: float, y: float, text: object, **look) -> None:
    """Write a small text into a picture, on a white halo, so that it can be read on anything."""
    halo = [withStroke(linewidth=2.4, foreground="white")]
    ax.text(x, y, str(text), **{"fontsize": 7, "path_effects": halo, "zorder": 7} | look)


def letter(axes: np.ndarray, titles: list[str]) -> None:
    """Title the panels (a), (b), ..."""
    for ax, mark, title in zip(axes, "abcdefgh", titles):
        ax.set_title(f"({mark}) {title}", loc="left")
