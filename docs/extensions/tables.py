"""The directives `measured`, a table of data/results/trust.csv, and `artefacts`, what the notebooks make."""

import re
import tomllib
from pathlib import Path

import pandas as pd
from sphinx.util.docutils import SphinxDirective

from vsp.run.listed import read_table
from vsp.run.notebook import nbformat
from vsp.show.captions import BOOK, caption_of

ROOT = Path(__file__).resolve().parents[2]
TRUST = ROOT / "data" / "results" / "trust.csv"
_SAVES = {"figures": "save_(?:figure|gait)", "tables": "save_table"}


def measured(frame: pd.DataFrame) -> str:
    """Rows of trust.csv as a Markdown table, with the machines that they were measured on."""
    lines = ["| what | measured | target | met | note |", "|---|---|---|---|---|"]
    for row in frame.fillna("").itertuples():
        value = f"{row.measured:g} {row.unit}" + (f" ({row.low:g} to {row.high:g})" if row.low else "")
        lines.append(f"| {row.what} | {value} | {row.rule} {row.target:g} | {row.met} | {row.note} |")
    return "\n".join([*lines, "", f"Measured on {'; '.join(frame['machine'].unique())}."])


def artefacts() -> str:
    """Every figure and table of notebooks/captions.toml as Markdown: label, file, cell and what it shows."""
    lines = ["| label | file | notebook, cell | what it shows |", "|---|---|---|---|"]
    for notebook, kinds in tomllib.loads(BOOK.read_text("utf-8")).items():
        cells = nbformat.read(ROOT / "notebooks" / f"{notebook}.ipynb", as_version=4).cells
        for kind, names in kinds.items():
            for name in names:
                cell = next(cell.id for cell in cells if re.search(rf'{_SAVES[kind]}\(.*"{name}"', cell.source))
                caption, (folder, _, file) = caption_of(kind, name), name.rpartition("/")
                path = "/".join(filter(None, ("figures", folder, "tables" if kind == "tables" else "", file)))
                shows = re.split(r"(?<=[a-z)]\.) ", caption.text)[0]
                lines.append(f"| {caption.label} | `{path}` | {notebook[:2]}, `{cell}` | {shows} |")
    return "\n".join(lines)


class Measured(SphinxDirective):
    """Shows the rows of the table that its argument names. The content is for readers of the source, on GitHub."""

    has_content = True
    required_arguments = 1

    def run(self):
        frame = read_table(TRUST)
        return self.parse_text_to_nodes(measured(frame[frame["table"] == self.arguments[0]]))


class Artefacts(SphinxDirective):
    """Shows the table of artefacts. The content is for readers of the source, on GitHub."""

    has_content = True

    def run(self):
        return self.parse_text_to_nodes(artefacts())


def setup(app):
    app.add_directive("measured", Measured)
    app.add_directive("artefacts", Artefacts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
