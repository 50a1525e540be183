"""The sample solution of the course's project: it runs, and what its page says holds."""

import runpy

from vsp_course.build import SOURCES


def test_the_sample_solution_compares_on_starts_that_decide_nothing(capsys):
    names = runpy.run_path(str(SOURCES / "project_solution.py"))
    names["main"]()
    page = capsys.readouterr().out
    assert "who returns most?" in page and "cannot be concluded" in page
    table = names["report"](range(2)).set_index("method")
    assert list(table["policies"]) == [2, 2, 2, 2, 1] and (table["low"] <= table["mean"]).all()
    assert table.loc["2 cells, faithful", "r2"] > 0.97 > table.loc["one linear map", "r2"]
    assert (table["failing"] == 0).all()
