"""The directives `measured`, what missed its target, `artefacts`, what notebooks make, and `gallery`, their figures."""

import html
import re
import tomllib
from pathlib import Path

import pandas as pd
from docutils import nodes
from outputs import anchor
from sphinx.util.docutils import SphinxDirective

from vsp.paper.results import read_results
from vsp.run.notebook import nbformat
from vsp.show.captions import BOOK, caption_of

ROOT = Path(__file__).resolve().parents[2]
_SAVES = {"figures": "save_figure", "tables": "save_table"}


def measured(frame: pd.DataFrame) -> str:
    """Rows of trust.csv that missed their target as a Markdown table, then how many did not and the machines."""
    lines = ["| what | measured | target |", "|---|---|---|"]
    missed = frame[frame["met"] == "no"].fillna("")
    for row in missed.itertuples():
        range_ = f" ({row.low:.3g} to {row.high:.3g})" if row.low else ""
        lines.append(f"| {row.what} | {row.measured:.3g} {row.unit}{range_} | {row.rule} {row.target:g} |")
    met = f"The other {len(frame) - len(missed)} of {len(frame)} measurements met their target."
    return "\n".join([*lines, "", f"{met} Measured on {'; '.join(frame['machine'].unique())}."])


def artefacts() -> str:
    """Every figure and table of notebooks/captions.toml as Markdown: label, file and cell."""
    lines = ["| label | file | notebook, cell |", "|---|---|---|"]
    for notebook, kinds in tomllib.loads(BOOK.read_text("utf-8")).items():
        cells = nbformat.read(ROOT / "notebooks" / f"{notebook}.ipynb", as_version=4).cells
        for kind, names in kinds.items():
            for name in names:
                cell = next(cell.id for cell in cells if re.search(rf'{_SAVES[kind]}\(.*"{name}"', cell.source))
                folder, _, file = name.rpartition("/")
                path = "/".join(filter(None, ("figures", folder, "tables" if kind == "tables" else "", file)))
                lines.append(f"| {caption_of(kind, name).label} | `{path}` | {notebook[:2]}, `{cell}` |")
    return "\n".join(lines)


def gallery() -> list[tuple[str, str, str]]:
    """Every figure of notebooks/captions.toml: its file, its alternative text, and its caption as HTML, in brief."""
    shown = []
    for notebook, kinds in tomllib.loads(BOOK.read_text("utf-8")).items():
        for name in kinds.get("figures", {}):
            caption = caption_of("figures", name)
            link = f'<a href="notebooks/{notebook}.html#{anchor(caption.label)}">{caption.label}</a>'
            brief = re.match(r".*?\.(?=\s|$)", caption.text)[0]
            shown.append((f"figures/{name}.png", caption.alt, f"{link}. {html.escape(brief, quote=False)}"))
    return shown


class _Table(SphinxDirective):
    """A table made when the site is built. The content is for readers of the source, on GitHub."""

    has_content = True


class Measured(_Table):
    def run(self):
        return self.parse_text_to_nodes(measured(read_results("trust")))


class Artefacts(_Table):
    def run(self):
        return self.parse_text_to_nodes(artefacts())


class Gallery(_Table):
    def run(self):
        box = nodes.container(classes=["gallery"])
        for file, alt, caption in gallery():
            text = nodes.caption("", "", nodes.raw("", caption, format="html"))
            box += nodes.figure("", nodes.image(uri=file, alt=alt), text)
        return [box]


def setup(app):
    app.add_directive("gallery", Gallery)
    app.add_directive("measured", Measured)
    app.add_directive("artefacts", Artefacts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
