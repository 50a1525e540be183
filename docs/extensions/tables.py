"""Directives: `measured`, what missed its target, `facts`, what reproduces; `artefacts` and `gallery` of notebooks."""

import html
import re
import tomllib
from itertools import groupby
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
_FILLED = {"reproduced": 1, "cannot be told": 0.5, "differs": 0}  # how much of its square
_CHOICES = {
    "default": "With our defaults",
    "nearest, SimpleGoal": "Nearest on SimpleGoal",
    "nearest, MountainCar": "Nearest on MountainCar",
    "nearest, both": "Nearest on both",
}


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


def facts() -> str:
    """The verdicts on the paper's facts as HTML: for each choice of settings a line of squares, one a fact."""
    text = "".join(f"<span>{_squares([(name, name)])}{name}</span>" for name in _FILLED)
    text = f'<figure class="facts"><figcaption>{text}</figcaption>'
    table = pd.read_csv(ROOT / "figures/tables/hidden_facts.csv").query("verdict in @_FILLED")
    table = table.sort_values("verdict", key=lambda verdicts: verdicts.map(_FILLED), ascending=False, kind="stable")
    for choice, label in _CHOICES.items():
        chosen = table[table["choice"] == choice]
        text += f"<p>{label}: {_share(chosen)}</p>"
        for task in ("SimpleGoal", "MountainCar"):
            here = chosen[chosen["task"].str.startswith(task)]
            said = f"{task}: {_share(here)}"
            text += f"<div>{_squares([*zip(here['quantity'], here['verdict'])], said)}<span>{said}</span></div>"
    return f"{text}</figure>"


def _share(facts: pd.DataFrame) -> str:
    return f"{(facts['verdict'] == 'reproduced').sum()} of {len(facts)}"


def _squares(facts: list[tuple[str, str]], said: str = "") -> str:
    """Draw a square for each name and verdict, which a pointer over it tells."""
    drawn = "".join(
        f'<g transform="translate({12 * i} 0)"><title>{html.escape(f"{name}: {verdict}")}</title>'
        f'<rect class="is" x="1" y="{1 + 9 - 9 * _FILLED[verdict]}" width="9" height="{9 * _FILLED[verdict]}"/>'
        '<rect x="1" y="1" width="9" height="9"/></g>'
        for i, (name, verdict) in enumerate(facts)
    )
    told = f'role="img" aria-label="{said}"' if said else 'aria-hidden="true"'
    return f'<svg viewBox="0 0 {12 * len(facts)} 11" style="--n: {len(facts)}" {told}>{drawn}</svg>'


def gallery() -> list[tuple[str, str, str, str]]:
    """Every figure of notebooks/captions.toml: its file, alternative text, caption as HTML, in brief, and notebook."""
    shown = []
    for notebook, kinds in tomllib.loads(BOOK.read_text("utf-8")).items():
        for name in kinds.get("figures", {}):
            caption = caption_of("figures", name)
            link = f'<a href="notebooks/{notebook}.html#{anchor(caption.label)}">{caption.label}</a>'
            brief = re.match(r".*?\.(?=\s|$)", caption.text)[0]
            text = f"{link}. {html.escape(brief, quote=False)}"
            shown.append((f"figures/{name}.png", caption.alt, text, notebook))
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


class Facts(_Table):
    def run(self):
        return [nodes.raw("", facts(), format="html")]


class Gallery(_Table):
    def run(self):
        sections = []
        for notebook, figures in groupby(gallery(), key=lambda row: row[-1]):
            title = nbformat.read(ROOT / "notebooks" / f"{notebook}.ipynb", as_version=4).cells[0].source
            section, box = nodes.section(ids=[notebook.replace("_", "-")]), nodes.container(classes=["gallery"])
            for file, alt, caption, _ in figures:
                text = nodes.caption("", "", nodes.raw("", caption, format="html"))
                box += nodes.figure("", nodes.image(uri=file, alt=alt), text)
            section += [nodes.title("", title.splitlines()[0].removeprefix("# ")), box]
            sections.append(section)
        return sections


def setup(app):
    app.add_directive("facts", Facts)
    app.add_directive("gallery", Gallery)
    app.add_directive("measured", Measured)
    app.add_directive("artefacts", Artefacts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
