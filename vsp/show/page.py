"""Base of the widgets: a page beside controls; and what a notebook shows where no kernel runs."""

from __future__ import annotations

import html
from typing import NamedTuple

import ipywidgets as widgets
import numpy as np
import pandas as pd
from IPython.display import display

from . import style
from .stage import png

DPI = 180

_LABELS = {"style": {"description_width": "145px"}, "layout": {"width": "455px"}}
# A notebook opened later shows an error in place of the controls. So pictures are always in the output: hidden while
# the controls are alive, and hiding that error afterwards.
_STYLE = """<style>
.jp-OutputArea-child:has(.vsp-controls) + .jp-OutputArea-child:has(.vsp-strip),
.jp-OutputArea-child:has(+ .jp-OutputArea-child .vsp-strip):not(:has(.vsp-controls)) { display: none }
</style>"""


class Page(NamedTuple):
    """An image (height, width, 3), its alternative text, and the HTML to show beside it."""

    image: np.ndarray
    alt: str
    text: str

    def still(self) -> str:
        """The page as static HTML: a small image with the text below it."""
        picture = style.embedded(png(self.image, small=True), self.alt)
        return f"<figure>{picture}<figcaption>{self.text}</figcaption></figure>"


class Controls:
    """Controls and a page where a kernel runs; three static pages elsewhere.

    A subclass has `turn`, which returns the name and the page for the current values of the controls, and `strip`,
    which returns the static pages.
    """

    ready, busy = "", ""  # texts of the status line
    height = "300px"  # reserved for the text, so that the picture below does not move

    def __init__(self, *controls: widgets.Widget):
        self.status, self.picture = widgets.HTML(self.ready), widgets.HTML()
        self.text = widgets.HTML(layout={"flex": "1 1 440px", "min_width": "0", "min_height": self.height})
        beside = widgets.VBox([*controls, self.status], layout={"width": "470px", "max_width": "100%"})
        above = widgets.HBox([beside, self.text], layout={"flex_flow": "row wrap"})
        self.view = widgets.VBox([above, self.picture])
        self.view.add_class("vsp-controls")

    def _answer(self, _=None) -> None:
        """Show the page for the current controls. Errors appear in the status too: Jupyter hides those of callbacks."""
        self.status.value = self.busy
        try:
            name, page = self.turn()
        except BaseException as error:  # also KeyboardInterrupt
            said = html.escape(f"{type(error).__name__}: {error}")
            self.status.value = f"<b>failed</b>: {said}. The picture below is {self._shown}."
            raise
        self._put(name, page)
        self.status.value = self.ready

    def _put(self, name: str, page: Page) -> None:
        self._shown, self.text.value = name, f'<div class="jp-RenderedHTMLCommon">{page.text}</div>'
        self.picture.value = style.embedded(png(page.image), page.alt)

    def _ipython_display_(self) -> None:
        strip = "\n".join(page.still() for page in self.strip())
        show(self.view._repr_mimebundle_(), strip, type(self).__doc__.split("\n")[0])


def show(view: dict, still: str, words: str) -> None:
    """Display two outputs: of a single one JupyterLab would show only the widget, even where it cannot be drawn.

    `view`: the widget's bundle of MIME types; `still`: HTML to show where no kernel runs; `words`: in a text.
    """
    display({**view, "text/plain": words}, raw=True)
    display({"text/html": f'{_STYLE}<div class="vsp-strip">{still}</div>', "text/plain": words}, raw=True)


def _button(description: str) -> widgets.Button:
    return widgets.Button(description=description, layout={"width": "auto", "align_self": "flex-start"})


def _table(frame: pd.DataFrame, number: str) -> str:
    return frame.to_html(float_format=number.format, border=0, index=False)
