"""What notebooks put out, made fit for a page: pictures as files, tables that scroll and name their headers, MathML."""

import base64
import hashlib
import html
import re
from itertools import zip_longest

from bs4 import BeautifulSoup
from docutils import nodes
from mathematics import mathml

_IMAGE = re.compile(r"data:image/(png|gif);base64,([A-Za-z0-9+/=\s]+)")
_MATH = re.compile(r"\$([^$]+)\$")
_NUMBER = re.compile(r"[-−+±]?[\d.,]+(e[-+]\d+)?( ?%)?|nan|NaN|inf|True|False|[–—]|")


def _outputs(app, doctree, docname):
    """Rewrite the HTML of every output of `docname`."""
    top = "../" * docname.count("/")
    for node in doctree.findall(nodes.raw):
        if node.get("format") == "html" and re.search(r"<(table|figure|picture|pre)\b", node.astext()):
            text = _IMAGE.sub(lambda found: top + _save(app, *found.groups()), node.astext())
            node.replace_self(nodes.raw("", _improve(text), format="html", classes=node["classes"]))


def _save(app, kind: str, data: str) -> str:
    """Write a picture that was part of the page to a file, which a browser loads when it comes into view."""
    image = base64.b64decode(data)
    name = f"_images/{hashlib.sha256(image).hexdigest()[:16]}.{kind}"
    (app.outdir / "_images").mkdir(parents=True, exist_ok=True)
    (app.outdir / name).write_bytes(image)
    return name


def _improve(text: str) -> str:
    soup = BeautifulSoup(text, "html.parser")
    for style in soup.find_all("style"):  # pandas' and Pygments' own; the site has one style
        style.decompose()
    for image in soup.find_all("img"):
        image["loading"] = "lazy"
    for table in soup.find_all("table"):
        _table(soup, table)
    return str(soup)


def _table(soup: BeautifulSoup, table) -> None:
    """Headers that say what they head, numbers to the right, MathML; in a box that scrolls where it is too wide."""
    del table["border"]
    _join_headers(table)
    for cell in table.find_all(["tr", "th", "td"]):
        del cell["style"]
        if cell.name == "th" and not cell.get_text(strip=True):
            cell.name = "td"  # the empty corner heads nothing
        elif cell.name == "th":
            cell["scope"] = "col" if cell.find_parent("thead") else "row"
    _align(table)
    for string in table.find_all(string=_MATH):
        markup = _MATH.sub(lambda found: mathml(found[1]), html.escape(string, quote=False))
        string.replace_with(BeautifulSoup(markup, "html.parser"))
    table.wrap(soup.new_tag("div", attrs={"class": "pst-scrollable-table-container"}))


def _join_headers(table) -> None:
    """pandas puts the names of an index into a header row of their own, with nothing else in it: one row will do."""
    rows = [row.find_all("th") for row in table.select("thead > tr")]
    if len(rows) == 2 and len(rows[0]) == len(rows[1]) and not any(a.text and b.text for a, b in zip(*rows)):
        for above, below in zip(*rows):
            above.string = above.text or below.text
        rows[1][0].parent.decompose()


def _align(table) -> None:
    """Mark columns of numbers and of words; counted from the right, for cells that span rows are on the left."""
    columns = list(zip_longest(*(row.find_all(["th", "td"])[::-1] for row in table.find_all("tr"))))
    if len(columns) > 9:
        table["class"] = [*table.get("class", []), "wide"]  # printed smaller
    for column in columns:
        values = [cell.get_text(strip=True) for cell in column if cell is not None and cell.find_parent("tbody")]
        kind = "number" if values and all(map(_NUMBER.fullmatch, values)) else None
        if not kind and max(map(len, values), default=0) > 20:
            kind = "words"  # which need some room
        for cell in filter(None, column) if kind else ():
            cell["class"] = kind


def setup(app):
    app.connect("doctree-resolved", _outputs)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
