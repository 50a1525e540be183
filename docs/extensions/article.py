"""The directive `article`: docs/article.html, which `make article` wrote, as a part of a page.

Its data and its script become files, so that a page loads what its reader asks for.
"""

import re
from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

_FILE = Path(__file__).resolve().parents[1] / "article.html"
_DATA = re.compile(r'(<script type="application/json" id="article-(\w+)")>(.*?)</script>', re.DOTALL)
_DOOR = re.compile(r'<a data-site="([^"]+)">')


class Article(SphinxDirective):
    """Shows the article. Its content is for readers of the source, on GitHub."""

    has_content = True

    def run(self):
        self.env.note_dependency(str(_FILE))
        page = _FILE.read_text("utf-8")
        text = re.search(r'<div class="vsp-article">.*</div>(?=\n</main>)', page, re.DOTALL)[0]
        data = (f'{match[1]} data-source="_static/article-{match[2]}.json"></script>' for match in _DATA.finditer(page))
        script = '<script type="module" id="vsp-script" src="_static/article.js"></script>'
        return [nodes.raw("", _DOOR.sub(r'<a href="\1">', text) + "".join(data) + script, format="html")]


def _write(app, error):
    if error is None:
        page, static = _FILE.read_text("utf-8"), app.outdir / "_static"
        for match in _DATA.finditer(page):
            (static / f"article-{match[2]}.json").write_text(match[3], "utf-8")
        script = re.search(r'<script type="module" id="vsp-script">(.*?)</script>', page, re.DOTALL)[1]
        (static / "article.js").write_text(script, "utf-8")


def setup(app):
    app.add_directive("article", Article)
    app.connect("build-finished", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
