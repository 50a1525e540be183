"""Pictures and tables fit for a page: small files of known size; tables that scroll and name their headers; MathML."""

import base64
import hashlib
import html
import io
import json
import re
from itertools import zip_longest
from pathlib import Path

from bs4 import BeautifulSoup
from docutils import nodes
from mathematics import mathml
from PIL import Image

from vsp.show.captions import caption_of

_IMAGE = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)")
_MATH = re.compile(r"\$([^$]+)\$")
_LINES = """teacher_returns distillation_history simplegoal_returns run_means mountaincar_returns ledger whisker_bounds
    hidden_reached hidden_questions beyond/what_cells_buy beyond/map beyond/likeness beyond/limit_cells beyond/rivals
    beyond/ablation beyond/limit_robots""".split()  # charts of lines and points, which a dark page inverts
_NUMBER = re.compile(r"[-−+±]?[\d.,]+(e[-+]\d+)?( ?%)?(\sto\s[-−]?[\d.,]+)?|nan|NaN|inf|True|False|[–—]|")


def _outputs(app, doctree, docname):
    """Rewrite the HTML of every output of `docname`, and the pictures and tables of its text."""
    top = "../" * docname.count("/")
    for node in doctree.findall(nodes.raw):
        if node.get("format") == "html" and re.search(r"<(table|figure|picture|pre)\b", node.astext()):
            text = _improve(node.astext(), app.outdir, top)
            node.replace_self(nodes.raw("", text, format="html", classes=node["classes"]))
    for node in list(doctree.findall(nodes.image)):
        if Path(node["uri"]).suffix == ".svg":  # drawn in the page's colours
            node.replace_self(nodes.raw("", (app.srcdir / node["uri"]).read_text("utf-8"), format="html"))
        else:
            soup = BeautifulSoup(f'<img alt="{html.escape(node["alt"])}">', "html.parser")
            _picture(soup.img, (app.srcdir / node["uri"]).read_bytes(), app.outdir, top)
            node.replace_self(nodes.raw("", str(soup), format="html"))
    for table in doctree.findall(nodes.table):
        _align_text(table)


def _improve(text: str, folder: Path = None, top: str = "") -> str:
    """HTML of an output for a page that is `top` below `folder`, which takes the pictures."""
    soup = BeautifulSoup(text, "html.parser")
    for style in soup.find_all("style"):  # pandas' and Pygments' own; the site has one style
        style.decompose()
    for tag in soup.find_all(["img", "source"]):
        if match := _IMAGE.fullmatch(tag.get("src") or tag.get("srcset") or ""):
            _picture(tag, base64.b64decode(match[1]), folder, top)
    for script in soup.select(".vsp-explorer > script[type='application/json']"):  # loads when it comes into view
        scene = top + _write(folder, script.get_text().encode(), "json")
        script.parent["data-scenes"] = json.dumps({"": scene})
        script.decompose()
    for table in soup.find_all("table"):
        _table(soup, table)
    for label in soup.select("figure > figcaption > b:first-child"):
        label.find_parent("figure")["id"] = anchor(label.get_text())
    return str(soup)


def anchor(label: str) -> str:
    """Where on its page the figure with this label is: figure-6-2 of "Figure 6.2."."""
    return "-".join(re.findall(r"\w+", label.lower()))


def _picture(tag, image: bytes, folder: Path, top: str) -> None:
    """Let `tag` show a file that loads when it comes into view, has its room before, and is a link to its full size."""
    name = top + _save(folder, image)
    if tag.name == "source":  # another picture in the same room
        tag["srcset"] = name
        return
    width, height = Image.open(io.BytesIO(image)).size
    shown = int(tag.get("width", width))
    if tag.get("alt") in {caption_of("figures", each).alt for each in _LINES}:
        tag["class"] = [*tag.get("class", []), "lines"]
    tag.attrs |= {"src": name, "width": shown, "height": round(shown * height / width), "loading": "lazy"}
    link = BeautifulSoup("", "html.parser").new_tag("a", href=name, attrs={"class": "full-size"})
    (tag.find_parent("picture") or tag).wrap(link)


def _save(folder: Path, image: bytes) -> str:
    """Write a picture to a file named by its content, once, as WebP: the same pixels in less."""
    file = io.BytesIO()
    Image.open(io.BytesIO(image)).save(file, "WEBP", lossless=True)
    return _write(folder, file.getvalue(), "webp")


def _write(folder: Path, content: bytes, kind: str) -> str:
    """Write a file named by its content; returns where it is."""
    name = f"_images/{hashlib.sha256(content).hexdigest()[:16]}.{kind}"
    (folder / "_images").mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)
    return name


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
        markup = _MATH.sub(lambda match: mathml(match[1]), html.escape(string, quote=False))
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
        kind = _kind(values)
        for cell in filter(None, column) if kind else ():
            cell["class"] = kind


def _align_text(table: nodes.table) -> None:
    """The same for a table of the text."""
    for column in zip(*(row.findall(nodes.entry) for row in table.findall(nodes.row))):
        if kind := _kind([entry.astext() for entry in column[1:]]):
            for entry in column:
                entry["classes"].append(kind)


def _kind(values: list[str]) -> str | None:
    """What a column of `values` holds, if it is to be told from others: numbers, or words, which need some room."""
    if values and all(map(_NUMBER.fullmatch, values)):
        return "number"
    return "words" if max(map(len, values), default=0) > 20 else None


def setup(app):
    app.connect("doctree-resolved", _outputs)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
