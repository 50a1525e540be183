"""Show a widget in a notebook: the widget where a kernel runs, a picture elsewhere."""

from IPython.display import display

# A notebook opened later shows an error in place of the widget. So the output always contains a picture, too. The style
# hides the picture while the widget is alive, and the error afterwards.
_STYLE = """<style>
.jp-OutputArea-child:has(.vsp-controls) + .jp-OutputArea-child:has(.vsp-strip),
.jp-OutputArea-child:has(+ .jp-OutputArea-child .vsp-strip):not(:has(.vsp-controls)) { display: none }
</style>"""


def show(view: dict, still: str, words: str) -> None:
    """Display widget and picture as two outputs: of a single one JupyterLab shows only the widget, even if it fails.

    `view`: the widget's bundle of MIME types; `still`: HTML to show where no kernel runs; `words`: plain text for both.
    """
    display({**view, "text/plain": words}, raw=True)
    display({"text/html": f'{_STYLE}<div class="vsp-strip">{still}</div>', "text/plain": words}, raw=True)
