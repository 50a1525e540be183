"""What the extensions in docs/extensions make of outputs and docstrings, by hand."""

import base64
import importlib
import io
import re

import numpy as np
import pytest
from PIL import Image

from vsp.run.atomic import ROOT

TABLE = """<style scoped>td { color: red }</style><table border="1" class="dataframe"><thead>
<tr style="text-align: right;"><th></th><th>mean</th><th>$\\Delta x$</th></tr>
<tr><th>task</th><th></th><th></th></tr></thead>
<tbody><tr><th>A</th><td>-1.5</td><td>$0.1 x_1 &lt; 2$</td></tr></tbody></table>"""


@pytest.fixture(scope="module")
def outputs():
    return importlib.import_module("outputs")


def test_a_table_of_pandas_gets_one_row_of_headers_numbers_to_the_right_and_mathml(outputs):
    text = outputs._improve(TABLE)
    table = outputs.BeautifulSoup(text, "html.parser").table
    assert [cell.get_text() for cell in table.select("thead > tr > th")][:2] == ["task", "mean"]
    assert [header["scope"] for header in table.find_all("th")] == ["col", "col", "col", "row"]
    assert table.parent["class"] == ["pst-scrollable-table-container"]
    assert [cell.get_text() for cell in table.select(".number")] == ["mean", "-1.5"]
    assert text.count("<math") == 2 and "$" not in text and "<msub><mi>x</mi><mn>1</mn></msub>" in text
    assert "style" not in text and "border" not in text


@pytest.fixture
def picture():
    """A PNG of 40 by 20 pixels, no two alike."""
    file = io.BytesIO()
    pixels = np.arange(40 * 20 * 3, dtype=np.uint16).view(np.uint8)[: 40 * 20 * 3].reshape(20, 40, 3)
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def test_a_picture_becomes_a_file_with_the_same_pixels_named_by_its_content(outputs, tmp_path, picture):
    name = outputs._save(tmp_path, picture)
    with Image.open(tmp_path / name) as saved, Image.open(io.BytesIO(picture)) as drawn:
        assert saved.format == "WEBP"
        np.testing.assert_array_equal(np.asarray(saved.convert("RGB")), np.asarray(drawn))
    assert name == outputs._save(tmp_path, picture)
    assert [path.suffix for path in tmp_path.rglob("*.*")] == [".webp"]


def test_a_picture_keeps_its_width_and_gets_its_height_and_a_link(outputs, tmp_path, picture):
    data = f"data:image/png;base64,{base64.b64encode(picture).decode()}"
    text = f'<figure><picture><source srcset="{data}"><img width="100" alt="x" src="{data}"></picture></figure>'
    image = outputs.BeautifulSoup(outputs._improve(text, tmp_path, "../"), "html.parser").img
    assert (image["width"], image["height"], image["loading"]) == ("100", "50", "lazy")
    link = image.find_parent("a")
    assert link["href"] == image["src"] == link.picture.source["srcset"] and link["href"].startswith("../_images/")


def test_a_table_of_the_text_has_its_numbers_to_the_right(outputs):
    from docutils import nodes

    rows = [("task", "mean"), ("A", "-1.5"), ("B", "12 %")]
    table = nodes.table("", *(nodes.row("", *(nodes.entry("", nodes.paragraph("", c)) for c in row)) for row in rows))
    outputs._align_text(table)
    assert [entry.astext() for entry in table.findall(nodes.entry) if entry["classes"]] == ["mean", "-1.5", "12 %"]


def test_no_sign_of_a_docstring_is_taken_for_markup_but_a_backtick():
    text = importlib.import_module("docstrings").rest("|x| * y_ and `a_ * b`:\n\n    make site")
    assert text == "\\|x\\| \\* y\\_ and `a_ * b`:\n\n::\n\n    make site"


def test_code_that_only_draws_lists_or_sets_up_is_folded():
    folded = importlib.import_module("folding").is_folded
    assert all(map(folded, ["show.save_figure(fig, 'x')", "import vsp", "rows = comparison.all_rows(task)"]))
    assert not folded("policy, _ = vsp.distill(teacher, task)\nshow.save_figure(fig, 'x')")


def test_the_table_of_artefacts_names_files_that_are_there_the_gallery_its_figures_and_squares_the_facts():
    tables = importlib.import_module("tables")
    paths = re.findall(r"`(figures/[\w/]+)`", tables.artefacts())
    assert len(set(paths)) == len(paths) > 30 and all(list(ROOT.glob(f"{path}.*")) for path in paths)
    assert [file for file, *_ in tables.gallery()] == [f"{path}.png" for path in paths if "/tables/" not in path]
    squares = tables.facts()
    assert "<p>With our defaults: 2 of 25</p>" in squares and squares.count("<title>") == 3 + 4 * 25
