"""The lessons with their solutions, cell by cell to the end."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "course"))
from test_course import LESSONS, build, by_kind, run


@pytest.mark.parametrize("name", LESSONS)
def test_solutions_run_and_pass_every_check(name, monkeypatch, capsys):
    lesson = LESSONS[name]
    _, failed = run(build.solution(lesson), monkeypatch)
    assert not failed
    assert capsys.readouterr().out.count("✓ ") == len(by_kind(lesson, build.is_check))
