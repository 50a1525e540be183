"""What the extensions in docs/extensions make of outputs and docstrings, by hand."""

import base64
import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs" / "extensions"))
TABLE = """<style scoped>td { color: red }</style><table border="1" class="dataframe"><thead>
<tr style="text-align: right;"><th></th><th>mean</th><th>$\\Delta x$</th></tr>
<tr><th>task</th><th></th><th></th></tr></thead>
<tbody><tr><th>A</th><td>-1.5</td><td>$0.1 x_1 &lt; 2$</td></tr></tbody></table>"""


@pytest.fixture(scope="module")
def outputs():
    return importlib.import_module("outputs")


@pytest.fixture(scope="module")
def docstrings():
    return importlib.import_module("docstrings")


def test_a_table_of_pandas_gets_one_row_of_headers_that_say_what_they_head(outputs):
    table = outputs.BeautifulSoup(outputs._improve(TABLE), "html.parser").table
    assert [[cell.get_text() for cell in row.find_all("th")][:2] for row in table.thead.find_all("tr")] == [
        ["task", "mean"]
    ]
    assert [header["scope"] for header in table.find_all("th")] == ["col", "col", "col", "row"]
    assert table.parent["class"] == ["pst-scrollable-table-container"]


def test_only_columns_of_numbers_stand_to_the_right(outputs):
    table = outputs.BeautifulSoup(outputs._improve(TABLE), "html.parser").table
    assert [cell.get_text() for cell in table.select(".number")] == ["mean", "-1.5"]


def test_dollars_in_a_table_become_mathml_and_styles_go(outputs):
    text = outputs._improve(TABLE)
    assert text.count("<math") == 2 and "$" not in text and "<msub><mi>x</mi><mn>1</mn></msub>" in text
    assert "style" not in text and "border" not in text


def test_a_picture_becomes_a_file_named_by_its_content(outputs, tmp_path):
    app = SimpleNamespace(outdir=tmp_path)
    name = outputs._save(app, "png", base64.b64encode(b"picture").decode())
    assert (tmp_path / name).read_bytes() == b"picture"
    assert name == outputs._save(app, "png", base64.b64encode(b"picture").decode())
    assert name != outputs._save(app, "png", base64.b64encode(b"another").decode())


def test_no_sign_of_a_docstring_is_taken_for_markup_but_a_backtick(docstrings):
    assert docstrings.rest("|x| * y_ and `a_ * b`:\n\n    make site\n\nThen `vsp.evaluate`.") == (
        "\\|x\\| \\* y\\_ and `a_ * b`:\n\n::\n\n    make site\n\nThen :py:obj:`vsp.evaluate <vsp.evaluate.evaluate>`."
    )


def test_comments_behind_fields_are_found(docstrings):
    from vsp.policy import Explanation

    assert ("raw", "(m,) output of the sub-policy") in docstrings._comments(Explanation)
    assert docstrings._comments(int) == []
