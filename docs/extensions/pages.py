"""Links of pages, what search engines and previews of links say of them, and what no page uses of the theme."""

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
_PICTURE, _TAG = re.compile(r"_images/\w+\.webp"), re.compile("<[^>]*>")
_MAP = re.compile(rb"\n?(//# |/\*# )sourceMappingURL=[^\n*]*( \*/|\*/)?")


def _move_links(app, docname, source):
    """The pages of docs/ lie in the root of the site, so links lose a folder; data/README.md is part of a page."""
    source[0] = _DATA.sub(r"\1reference.md", source[0].replace("](../docs/", "](../"))
    if "/" not in docname:
        source[0] = source[0].replace("](../", "](").replace("](docs/", "](")


def _move_links_of_included(app, path, docname, source):
    _move_links(app, docname, source)


def _describe(app, pagename, templatename, context, doctree):
    """The page's description, for search engines, and what a link to it shows: title, description and picture."""
    text = next(filter(lambda text: len(text) > 60, _paragraphs(doctree)), f"{app.config.html_title}: {pagename}")
    picture = _PICTURE.search("" if pagename == "index" else context.get("body", ""))
    top = app.config.html_baseurl or "../" * pagename.count("/")
    about = {
        "og:title": _TAG.sub("", context.get("title", "")),
        "og:description": textwrap.shorten(text, 200, placeholder=" …"),
        "og:image": top + (picture[0] if picture else "article.png"),
    }
    tags = [("name", "description", about["og:description"]), *(("property", *item) for item in about.items())]
    lines = (f'\n<meta {kind}="{name}" content="{html.escape(html.unescape(value))}" />' for kind, name, value in tags)
    context["metatags"] = context.get("metatags", "") + "".join(lines)


def _paragraphs(doctree):
    """Yield the text of each paragraph of a section, and of the article's."""
    for node in doctree.findall(lambda node: isinstance(node, (nodes.paragraph, nodes.raw))) if doctree else ():
        if isinstance(node, nodes.raw):
            yield from (_TAG.sub("", text) for text in re.findall("<p>(.*?)</p>", node.astext(), re.DOTALL))
        elif isinstance(node.parent, nodes.section):
            yield node.astext()


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
