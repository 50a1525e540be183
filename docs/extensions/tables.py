"""The directives `measured`, what missed its target in data/results/trust.csv, and `artefacts`, what notebooks make."""

import re
import tomllib
from pathlib import Path

import pandas as pd
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


class _Table(SphinxDirective):
    """A table made when the site is built. The content is for readers of the source, on GitHub."""

    has_content = True


class Measured(_Table):
    def run(self):
        return self.parse_text_to_nodes(measured(read_results("trust")))


class Artefacts(_Table):
    def run(self):
        return self.parse_text_to_nodes(artefacts())


def setup(app):
    app.add_directive("measured", Measured)
    app.add_directive("artefacts", Artefacts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
