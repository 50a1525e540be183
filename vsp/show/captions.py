"""Numbers, captions and alternative texts of figures and tables, from notebooks/captions.toml, and headings.

That file lists them in the order of the notebooks, so that code cells contain only code.
"""

import html
import os
import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ..run import ROOT

BOOK, HEADINGS = ROOT / "notebooks" / "captions.toml", ROOT / "notebooks" / "headings.toml"
KINDS = {"figures": "Figure", "tables": "Table"}


class Caption(NamedTuple):
    """A `label` such as "Figure 6.2" (empty outside the notebooks), the caption, and the alternative text."""

    label: str
    text: str
    alt: str = ""

    def to_html(self, tag: str) -> str:
        """Return the caption as the element `tag`; empty if it has no text."""
        label = f"<b>{self.label}.</b> " if self.label else ""
        return f"<{tag}>{label}{html.escape(self.text, quote=False)}</{tag}>" if self.text else ""


def _parsed(path: Path) -> dict[str, dict]:
    return tomllib.loads(path.read_text("utf-8")) if path.exists() else {}


@cache
def headings() -> dict[str, dict[str, str]]:
    """Return notebooks/headings.toml: headings of columns ("words", of shares "percent"), and names of "rows"."""
    return {"words": {}, "percent": {}} | _parsed(HEADINGS)


@cache
def _book() -> dict[tuple[str, str], Caption]:
    """Return all captions by kind and name. Each notebook numbers its figures and its tables separately."""
    captions = {}
    for notebook, kinds in _parsed(BOOK).items():
        for kind, entries in kinds.items():
            for number, (name, about) in enumerate(entries.items(), 1):
                label = f"{KINDS[kind]} {int(notebook[:2])}.{number}"
                captions[kind, name] = Caption(label, about["caption"], about.get("alt", ""))
    return captions


def caption_of(kind: str, name: str, *, text: str | None = None, alt: str = "") -> Caption:
    """Return the caption of a figure or table; `kind` is "figures" or "tables". `text` and `alt` override the entry in
    notebooks/captions.toml. Raises ValueError for a figure without any `alt`."""
    known = _book().get((kind, name), Caption("", ""))
    caption = Caption(known.label, known.text if text is None else text, alt or known.alt)
    if kind == "figures" and not caption.alt:
        raise ValueError(f"figure {name!r} has no alternative text: pass alt= or add it to notebooks/{BOOK.name}")
    return caption


def file_of(kind: str, name: str, out: str | os.PathLike) -> Path:
    """Return the path, without suffix: figures/x or figures/tables/x; for "beyond/x" figures/beyond/(tables/)x."""
    place = Path(out) / "figures" / name
    return place if kind == "figures" else place.parent / kind / place.name
