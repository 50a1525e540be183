"""Slides of the lessons: the cells tagged `slide`, as one HTML file that opens from disk.

reveal.js 5.2.1 (MIT license) shows them; `reveal/` holds it as published by its authors, and the
page around it.
"""

from __future__ import annotations

import base64
import html
import io
import re
from pathlib import Path

from PIL import Image

from vsp.run.atomic import ROOT
from vsp.run.notebook import NotebookNode

REVEAL = Path(__file__).with_name("reveal")
WIDE = 1280  # pixels of a figure, and of a slide
_FIGURE = re.compile(r'<img src="([\w./]+)" alt="([^"]*)"')


def is_slide(cell: NotebookNode) -> bool:
    """Whether this cell is a slide, and nothing else."""
    return "slide" in cell.metadata.get("tags", [])


def slides(lesson: NotebookNode) -> str:
    """Return a lesson's slides as one HTML page with figures, style and script. Raises ValueError if it has none."""
    import mistune  # nbconvert's own

    sources = [cell.source for cell in lesson.cells if is_slide(cell)]
    if not sources:
        raise ValueError("the lesson has no cell tagged 'slide', expected one for each slide")
    markdown = mistune.create_markdown(plugins=["table"])
    pages = "\n".join(f"<section>\n{_FIGURE.sub(_inline, markdown(source))}</section>" for source in sources)
    title = re.sub(r"^#+ ", "", sources[0].splitlines()[0])
    page, css, script = ((REVEAL / name).read_text("utf-8") for name in ("page.html", "reveal.css", "reveal.js"))
    return page.format(title=html.escape(title), css=css, script=script, slides=pages, wide=WIDE)


def _inline(image: re.Match) -> str:
    """Embed a figure of this repository in the page, no wider than a slide."""
    file = io.BytesIO()
    with Image.open(ROOT / image[1]) as picture:
        small = picture.convert("RGB")
        small.thumbnail((WIDE, WIDE))
        small.save(file, "webp", lossless=True)
    return f'<img src="data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}" alt="{image[2]}"'
