"""The sources of the notebooks: prose first, short cells, no output; and what they import."""

import ast
import html
import json
import re
import tomllib
from pathlib import Path

import pytest
from support import python

from vsp.run.notebook import nbformat
from vsp.show import captions

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
LESSONS = sorted((ROOT / "notebooks" / "course").glob("*.ipynb"))
each_source = pytest.mark.parametrize("path", [*NOTEBOOKS, *LESSONS], ids=lambda path: path.stem)


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def path(request):
    return request.param


@pytest.fixture
def notebook(path):
    return nbformat.read(path, as_version=4)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@each_source
def test_sources_hold_no_output_and_no_two_cells_one_id(path, notebook):
    nbformat.validate(notebook)
    ids = [cell["id"] for cell in json.loads(path.read_text("utf-8"))["cells"]]  # nbformat gives a second one another
    assert len(ids) == len(set(ids))
    assert all(not cell.outputs and cell.execution_count is None for cell in code_cells(notebook))


def test_every_notebook_has_the_metadata_that_jupyterlab_writes():
    kinds = {json.dumps(nbformat.read(path, as_version=4).metadata, sort_keys=True)
             for path in (ROOT / "notebooks").rglob("*.ipynb")}  # fmt: skip
    (kind,) = map(json.loads, kinds)
    assert kind["kernelspec"]["display_name"] == "Python 3 (ipykernel)" and kind["language_info"]["version"]


@each_source
def test_cells_are_short_and_define_no_helpers(notebook):
    for cell in code_cells(notebook):
        answer = cell.metadata.get("nbgrader", {}).get("solution", False)
        assert len(cell.source.splitlines()) < (25 if answer else 15), cell.id
        tree = ast.parse(cell.source)
        defined = any(isinstance(node, ast.FunctionDef | ast.ClassDef) for node in ast.walk(tree))
        assert not defined or answer or cell.id.startswith("by-hand"), cell.id  # what a reader learns is no helper


KINDS = {"save_figure": "figures", "save_table": "tables"}


def saved(notebook):
    """What a notebook saves, in its order: kind and name."""
    for cell in code_cells(notebook):
        calls = [node for node in ast.walk(ast.parse(cell.source)) if isinstance(node, ast.Call)]
        for call in sorted(calls, key=lambda call: call.lineno):
            if (name := getattr(call.func, "attr", getattr(call.func, "id", None))) in KINDS:
                yield KINDS[name], next(a.value for a in call.args if isinstance(a, ast.Constant))


def test_every_saved_figure_and_table_has_its_caption_in_the_notebooks_order(path):
    book = tomllib.loads((ROOT / "notebooks" / "captions.toml").read_text("utf-8")).get(path.stem, {})
    source = nbformat.read(path, as_version=4)
    listed = list(saved(source))
    for cell in code_cells(source):  # a figure is shown where it is the cell's value
        assert "save_figure" not in cell.source.rpartition("\n")[0], cell.id
    for kind in ("figures", "tables"):
        assert list(book.get(kind, {})) == [name for saved_kind, name in listed if saved_kind == kind]
        for about in book.get(kind, {}).values():
            assert about["caption"].endswith((".", "?")) and len(about["caption"].split()) > 2
            assert kind == "tables" or (about["alt"].endswith(".") and len(about["alt"]) > 60)


def test_figures_and_tables_that_the_text_names_exist(notebook):
    text = "".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    labels = {caption.label for caption in captions._book().values()}
    assert set(re.findall(r"\b(?:Figure|Table) \d\.\d+", text)) <= labels


def test_what_notebook_02_says_of_refitted_maps_stands_in_its_table():
    book = nbformat.read(ROOT / "figures" / "executed" / "02_distillation.ipynb", as_version=4)
    table, text = (json.dumps([c for c in book.cells if c.id == name]) for name in ("failure-why", "failure-see"))
    assert all(f">{n}<" in table and f" {n[:5]}" in text for n in ("19", "47", "7", "15.031", "16.134"))


@pytest.mark.parametrize(
    "executed", sorted((ROOT / "figures" / "executed").glob("*.ipynb")), ids=lambda path: path.stem
)
def test_alternative_texts_are_sentences(executed):
    """They say what is to be seen, and nothing that only Python would say."""
    pages = [output.data.get("text/html", "") for cell in code_cells(nbformat.read(executed, as_version=4))
             for output in cell.outputs if "data" in output]  # fmt: skip
    texts = [html.unescape(text) for page in pages for text in re.findall(r'<img alt="([^"]*)"', page)]
    assert texts or executed.stem.startswith("04")
    for text in texts:
        assert len(text) > 60 and text.endswith(".") and not re.search(r"[{}]|\('|nan\b|\bTrue\b", text), text


# What they import, and where they run

BLOCKED = """
import importlib.abc, sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("torch", "stable_baselines3"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())
"""


def imports(paths):
    """The statements by which notebooks import."""
    return {
        ast.unparse(node)
        for path in paths
        for cell in code_cells(nbformat.read(path, as_version=4))
        for node in ast.walk(ast.parse(cell.source)) if isinstance(node, ast.Import | ast.ImportFrom)
    }  # fmt: skip


def test_the_papers_five_import_no_part_but_vsp():
    """Which imports no other part itself: `test_imports.py`."""
    statements = imports(NOTEBOOKS[:5])
    assert "import vsp" in statements
    assert not [one for one in statements if re.match(r"(from|import) (vsp_beyond|vsp_course|studies)\b", one)]


def test_they_draw_without_torch():
    """Everything that they import, and a teacher."""
    statements = imports(NOTEBOOKS)
    python("\n".join([BLOCKED, *sorted(statements), "vsp.load_teacher('SimpleGoal-v0')"]))


def test_defaults_lie_in_the_checkout(notebook):
    """Wherever it runs: in the root, as by plain papermill, or in notebooks/, as in JupyterLab."""
    cells, names = {cell.id: ast.parse(cell.source).body for cell in code_cells(notebook)}, {"ROOT": ROOT}
    for line in [*cells["parameters"], *(line for line in cells["imports"] if "ROOT / " in ast.unparse(line))]:
        exec(ast.unparse(line), names)
    assert names["out"] == ROOT / "build" / "lab"
    assert names.get("runs", ROOT / "data" / "runs") == ROOT / "data" / "runs"
