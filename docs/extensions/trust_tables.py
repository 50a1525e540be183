"""The directive `measured`: one table of data/results/trust.csv, with the machines that it was measured on."""

from pathlib import Path

import pandas as pd
from sphinx.util.docutils import SphinxDirective

from vsp.run.listed import read_table

TRUST = Path(__file__).resolve().parents[2] / "data" / "results" / "trust.csv"


def markdown(frame: pd.DataFrame) -> str:
    """Rows of trust.csv as a Markdown table."""
    lines = ["| what | measured | target | met | note |", "|---|---|---|---|---|"]
    for row in frame.fillna("").itertuples():
        found = f"{row.measured:g} {row.unit}" + (f" ({row.low:g} to {row.high:g})" if row.low else "")
        lines.append(f"| {row.what} | {found} | {row.rule} {row.target:g} | {row.met} | {row.note} |")
    return "\n".join([*lines, "", f"Measured on {'; '.join(frame['machine'].unique())}."])


class Measured(SphinxDirective):
    """Shows the rows of the table that its argument names. The content is for readers of the source, on GitHub."""

    has_content = True
    required_arguments = 1

    def run(self):
        self.env.note_dependency(str(TRUST))
        frame = read_table(TRUST)
        return self.parse_text_to_nodes(markdown(frame[frame["table"] == self.arguments[0]]))


def setup(app):
    app.add_directive("measured", Measured)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
