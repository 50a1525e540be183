"""Links of pages, their descriptions for search engines, and what the theme brings along that no page asks for."""

import html
import re
import textwrap

from docutils import nodes

_UNUSED = ("*.js.map", "*.css.map", "scripts/fontawesome.js")
_MAP = re.compile(rb"\n?(//# |/\*# )sourceMappingURL=[^\n*]*( \*/|\*/)?")


def _move_links(app, docname, source):
    """The pages of docs/ lie in the root of the site, so links between them and other pages lose a folder."""
    source[0] = source[0].replace("](../docs/", "](../")
    if "/" not in docname:
        source[0] = source[0].replace("](../", "](")


def _describe(app, pagename, templatename, context, doctree):
    """The first paragraph with something in it, as the page's description."""
    found = doctree.findall(nodes.paragraph) if doctree else ()
    texts = (node.astext() for node in found if isinstance(node.parent, nodes.section))
    text = next((text for text in texts if len(text) > 60), f"{app.config.html_title}: {pagename}")
    text = html.escape(textwrap.shorten(text, 200, placeholder=" …"))
    context["metatags"] = context.get("metatags", "") + f'\n<meta name="description" content="{text}" />'


def _thin(app, error):
    """Remove maps of the theme's scripts, for its developers, and their names, which a browser would ask for."""
    static = app.outdir / "_static"
    for path in [path for pattern in _UNUSED for path in static.rglob(pattern)]:
        path.unlink()
    for path in [*static.rglob("*.js"), *static.rglob("*.css")]:
        path.write_bytes(_MAP.sub(b"", path.read_bytes()))


def setup(app):
    app.connect("source-read", _move_links)
    app.connect("html-page-context", _describe)
    app.connect("build-finished", _thin)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
