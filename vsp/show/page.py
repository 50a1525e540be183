"""What a notebook shows of a widget: the widget where a kernel runs, a picture elsewhere."""

from __future__ import annotations

from IPython.display import display

# A notebook opened later shows an error in place of the widget. So a picture is always in the output: hidden while the
# widget is alive, and hiding that error afterwards.
_STYLE = """<style>
.jp-OutputArea-child:has(.vsp-controls) + .jp-OutputArea-child:has(.vsp-strip),
.jp-OutputArea-child:has(+ .jp-OutputArea-child .vsp-strip):not(:has(.vsp-controls)) { display: none }
</style>"""


def show(view: dict, still: str, words: str) -> None:
    """Display two outputs: of a single one JupyterLab would show only the widget, even where it cannot be drawn.

    `view`: the widget's bundle of MIME types; `still`: HTML to show where no kernel runs; `words`: in a text.
    """
    display({**view, "text/plain": words}, raw=True)
    display({"text/html": f'{_STYLE}<div class="vsp-strip">{still}</div>', "text/plain": words}, raw=True)
