"""Links of pages, their descriptions for search engines, and what the theme brings along that no page asks for."""

import html
import re
import textwrap

from docutils import nodes
from fontTools import subset

_UNUSED = ("*.js.map", "*.css.map", "scripts/fontawesome.js")
_ICON = re.compile(r'((?:\.fa-[\w-]+,?)+)\{--fa:"\\([0-9a-f]+)"\}')
_UNFOLDS = '<summary><span class="toctree-toggle"'
_NAMED = _UNFOLDS.replace(">", ' aria-label="unfold">', 1)
_DATA = re.compile(r"(\]\((?:\.\./)*)data/README\.md")
_MAP = re.compile(rb"\n?(//# |/\*# )sourceMappingURL=[^\n*]*( \*/|\*/)?")


def _move_links(app, docname, source):
    """The pages of docs/ lie in the root of the site, so links lose a folder; data/README.md is part of a page."""
    source[0] = _DATA.sub(r"\1reference.md", source[0].replace("](../docs/", "](../"))
    if "/" not in docname:
        source[0] = source[0].replace("](../", "](").replace("](docs/", "](")


def _move_links_of_included(app, path, docname, source):
    _move_links(app, docname, source)


def _describe(app, pagename, templatename, context, doctree):
    """The first paragraph with something in it, as the page's description."""
    paragraphs = doctree.findall(nodes.paragraph) if doctree else ()
    texts = (node.astext() for node in paragraphs if isinstance(node.parent, nodes.section))
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
    for path in app.outdir.rglob("*.html"):  # the theme's button that unfolds a group has no name
        path.write_text(path.read_text("utf-8").replace(_UNFOLDS, _NAMED), "utf-8")
    _thin_icons(app.outdir, static)


def _thin_icons(pages, static):
    """Keep the icons that some page has: a dozen of two thousand."""
    texts = [path.read_text("utf-8") for path in [*pages.rglob("*.html"), *static.rglob("scripts/*.js")]]
    used, points = {name for text in texts for name in re.findall(r"\bfa-[\w-]+", text)}, set()

    def kept(rule):
        if not used & set(re.findall(r"fa-[\w-]+", rule[1])):
            return ""
        points.add(int(rule[2], 16))
        return rule[0]

    for path in static.rglob("*.css"):
        path.write_text(_ICON.sub(kept, path.read_text("utf-8")), "utf-8")
    options = subset.Options(flavor="woff2", layout_features=[])
    for path in static.rglob("fa-*.woff2"):
        font, subsetter = subset.load_font(path, options), subset.Subsetter(options)
        subsetter.populate(unicodes=points)
        subsetter.subset(font)
        subset.save_font(font, path, options)


def setup(app):
    app.connect("source-read", _move_links)
    app.connect("include-read", _move_links_of_included)
    app.connect("html-page-context", _describe)
    app.connect("build-finished", _thin)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
