"""Slides of the lessons: the cells tagged `slide`, as one HTML file that opens from disk.

reveal.js 5.2.1 (MIT license) shows them; `reveal/` holds it as published by its authors.
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
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>{css}
.reveal {{ font: 34px/1.35 system-ui, sans-serif; color: #222 }}
.reveal .slides {{ text-align: left }}
.reveal h1 {{ font-size: 1.9em; line-height: 1.15; margin: 0 0 .4em }}
.reveal h2 {{ font-size: 1.35em; line-height: 1.2; margin: 0 0 .5em; color: #01558a }}
.reveal p, .reveal ul, .reveal ol {{ margin: 0 0 .55em }} .reveal ul, .reveal ol {{ padding-left: 1.1em }}
.reveal img {{ display: block; max-width: 100%; max-height: 400px; margin: .2em auto; background: #fff }}
.reveal code {{ font-size: .85em; background: #eef2f5; padding: 0 .2em }}
.reveal pre {{ font-size: .95em; line-height: 1.3; background: #eef2f5; padding: .5em .7em }}
.reveal table {{ border-collapse: collapse; margin: 0 auto }}
.reveal :is(th, td) {{ padding: .1em .7em; text-align: left }}
</style></head>
<body><div class="reveal"><div class="slides">
{slides}
</div></div>
<script>{script}</script>
<script>
Reveal.initialize({{hash: true, slideNumber: "c/t", width: {wide}, height: 720, margin: .06, transition: "none"}})
</script>
</body></html>
"""


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
    css, script = ((REVEAL / name).read_text("utf-8") for name in ("reveal.css", "reveal.js"))
    return _PAGE.format(title=html.escape(title), css=css, script=script, slides=pages, wide=WIDE)


def _inline(found: re.Match) -> str:
    """Embed a figure of this repository in the page, no wider than a slide."""
    file = io.BytesIO()
    with Image.open(ROOT / found[1]) as picture:
        small = picture.convert("RGB")
        small.thumbnail((WIDE, WIDE))
        small.save(file, "webp", lossless=True)
    return f'<img src="data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}" alt="{found[2]}"'
