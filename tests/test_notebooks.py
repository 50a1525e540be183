"""The sources of the notebooks: prose first, short cells, no output; and what they import."""

import ast
import html
import re
import subprocess
import sys
from pathlib import Path

import pytest

from vsp.notebook import nbformat

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return nbformat.read(request.param, as_version=4)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_there_are_notebooks():
    assert [path.stem[:2] for path in NOTEBOOKS] == [f"{n:02d}" for n in range(1, len(NOTEBOOKS) + 1)]


def test_sources_hold_no_output(notebook):
    assert all(not cell.outputs and cell.execution_count is None for cell in code_cells(notebook))


def test_cells_are_short_and_define_no_helpers(notebook):
    for cell in code_cells(notebook):
        assert len(cell.source.splitlines()) < 15, cell.id
        tree = ast.parse(cell.source)
        assert not any(isinstance(node, ast.FunctionDef | ast.ClassDef) for node in ast.walk(tree)), cell.id


def test_more_words_than_code(notebook):
    words = sum(len(cell.source.split()) for cell in notebook.cells if cell.cell_type == "markdown")
    code = sum(len(cell.source.split()) for cell in code_cells(notebook))
    assert words > code


def test_every_saved_figure_has_alternative_text(notebook):
    for cell in code_cells(notebook):
        for call in (node for node in ast.walk(ast.parse(cell.source)) if isinstance(node, ast.Call)):
            name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", None)
            if name in ("save_figure", "save_growth"):
                assert {"alt", "out", "quick"} <= {keyword.arg for keyword in call.keywords}, cell.id


@pytest.mark.parametrize("path", sorted((ROOT / "figures" / "executed").glob("*.ipynb")), ids=lambda path: path.stem)
def test_alternative_texts_are_sentences(path):
    """They say what is to be seen, and nothing that only Python would say."""
    pages = [output.data.get("text/html", "") for cell in code_cells(nbformat.read(path, as_version=4))
             for output in cell.outputs if "data" in output]  # fmt: skip
    texts = [html.unescape(text) for page in pages for text in re.findall(r'<img alt="([^"]*)"', page)]
    assert texts or path.stem.startswith("04")
    for text in texts:
        assert len(text) > 60 and text.endswith(".") and not re.search(r"[{}]|\('|nan\b|\bTrue\b", text), text


def test_first_code_cell_holds_the_parameters(notebook):
    first = code_cells(notebook)[0]
    assert first.metadata["tags"] == ["parameters"]
    assert {node.targets[0].id for node in ast.parse(first.source).body} in (
        {"out", "quick"},
        {"out", "runs", "quick"},
    )


def test_only_the_cell_that_trains_imports_a_training_library(notebook):
    """It comes in notebook 6 alone, where a reader's own agent is distilled."""
    for cell in code_cells(notebook):
        if cell.id != "own":
            assert "import torch" not in cell.source and "stable_baselines3" not in cell.source, cell.id


def test_drawing_loads_no_training_library():
    code = "import vsp, vsp.experiments, vsp.figures, vsp.tables, sys; vsp.load_teacher(vsp.tasks()[0]); "
    code += "sys.exit(bool({'torch', 'stable_baselines3'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0
