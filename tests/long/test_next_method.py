"""The table of docs/next_method.md, made again."""

import re

import pytest

import vsp
from vsp.run.atomic import ROOT

PAGE = (ROOT / "docs" / "next_method.md").read_text("utf-8")


@pytest.mark.parametrize(("task", "cells"), [("SimpleGoal-v0", 8), ("MountainCarContinuous-v0", 4)])
def test_the_table_is_what_the_comparison_gives(task, cells, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tests" / "outside")
    from next_method import methods

    frame = vsp.compare(methods(cells), [task], runs=tmp_path, jobs=2).frame
    told = re.split(r"\| (?=SimpleGoal|MountainCar)", PAGE)[1 + ("Car" in task)]
    assert len(frame) == 3
    for row in frame.itertuples():
        numbers = f"{row.mean:.2f} ({row.low:.2f} to {row.high:.2f}) | {100 * row.failing:.1f} %".replace(
            "| 0.0", "| 0"
        )
        size = "" if row.method == "agent" else f"{row.cells:.1f} ".replace(".0 ", " ")
        assert f"| {row.method} | {size}| {numbers} |" in told
