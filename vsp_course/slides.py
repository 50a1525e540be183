"""Slides of the lessons, as one HTML file that opens from disk.

Cells tagged `slide` make them. A Markdown cell begins a slide: a title, at most ten words, and under the line `Note:`
what the lecturer says. A code cell draws its picture or shows an explorer; it needs the cell `imports` of the lesson,
and the slides before. reveal.js 5.2.1 (MIT license) turns the slides; `reveal/` holds it as published by its authors,
and the page around it.
"""

import ast
import html
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsp import show
from vsp.run.notebook import NotebookNode
from vsp.show.explorer import Explorer, standalone

from . import drawing

REVEAL = Path(__file__).with_name("reveal")
PARTS = ("page.html", "reveal.css", "reveal.js", "notes.js")
WIDE = 1280  # pixels of a slide
PROJECTED = 1920  # pixels of a picture as wide as a slide, for a projector
NOTE = "\n\nNote:\n\n"


def room(n: int = 1, *, height: float = 1.9, **subplots) -> tuple[Figure, np.ndarray]:
    """Make a figure with n panels for a room: 4.5 inches wide, `height` inches high, and drawn as wide as a slide. So
    its type of 8 points is 32 pixels high. Returns the figure and its axes (n,)."""
    return show.panels(n, width=4.5, height=height, dpi=PROJECTED / 4.5, **subplots)


def bare_square(ax: Axes, title: str = "") -> Axes:
    """Draw the unit square of SimpleGoal with its walls, without axes, under a title."""
    drawing.walls(ax).set(xticks=[], yticks=[], xlabel="", ylabel="", title=title)
    return ax


def is_slide(cell: NotebookNode) -> bool:
    """Whether this cell is a slide or its picture, and nothing else."""
    return "slide" in cell.metadata.get("tags", [])


def slides(lesson: NotebookNode, tag: str = "slide") -> str:
    """Return a lesson's slides as one HTML page with pictures, style and script: those that have the `tag`, too. Raises
    ValueError if it has none."""
    import mistune  # nbconvert's own

    cells, pages, names = [cell for cell in lesson.cells if is_slide(cell)], [], {}
    if not cells:
        raise ValueError("the lesson has no cell tagged 'slide', expected some")
    exec(next(cell.source for cell in lesson.cells if cell.id == "imports"), names)
    for cell in cells:
        if cell.cell_type == "markdown":
            shown, _, said = cell.source.partition(NOTE)
            begun = f'{mistune.html(shown)}<aside class="notes">{mistune.html(said)}</aside>'
        else:
            picture = _shown(cell, names)  # also of those left out: later ones may need its names
            pages += [begun + picture] if tag in cell.metadata.tags else []
    page, css, *scripts = ((REVEAL / name).read_text("utf-8") for name in PARTS)
    script = "\n".join(scripts).replace("</script", "<\\/script")
    body = "\n".join(f"<section>\n{slide}</section>" for slide in pages)
    return page.format(title=html.escape(_title(cells[0])), css=css, script=script, slides=body, wide=WIDE)


def spoken(lesson: NotebookNode) -> str:
    """Return what the lecturer says to each slide, as a list in Markdown with the slides' titles."""
    cells = [cell for cell in lesson.cells if is_slide(cell) and cell.cell_type == "markdown"]
    return "".join(f"1. **{_title(cell)}**  \n{cell.source.partition(NOTE)[2]}\n" for cell in cells)


def _title(slide: NotebookNode) -> str:
    return slide.source.partition("\n")[0].lstrip("# ")


def _shown(cell: NotebookNode, names: dict[str, object]) -> str:
    """Run a code cell among `names` and return the picture or the explorer of its last line as HTML."""
    *before, last = ast.parse(cell.source).body
    exec(compile(ast.Module(before, []), cell.id, "exec"), names)
    made = eval(compile(ast.Expression(last.value), cell.id, "eval"), names)
    if not isinstance(made, Explorer):
        return made._repr_html_()
    # A page of its own, as light as the slides: their keys and style stay outside
    style = REVEAL.with_name("slides.css").read_text("utf-8")
    page = standalone("", made.element(), style).replace("<html", '<html data-theme="light"', 1)
    return f'<div><iframe title="An explorer" loading="lazy" srcdoc="{html.escape(page)}"></iframe></div>'
