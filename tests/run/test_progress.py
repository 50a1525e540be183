import sys

import pytest
from tqdm import auto, notebook, std

from vsp.run import progress as module
from vsp.run.progress import _words, progress


@pytest.fixture
def clock(monkeypatch):
    """A clock that goes on by three seconds whenever it is read."""
    times = iter(range(0, 10_000, 3))
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(times)))


def test_a_log_gets_a_line_now_and_then_and_one_at_the_end(clock, capsys):
    assert list(progress(range(9), "runs", total=9, unit="runs")) == list(range(9))
    lines = capsys.readouterr().err.splitlines()
    # A run takes 3 s: the first line after 10 s or more is that of the fourth
    assert lines == ["runs: 4 of 9 runs, 15 s left", "runs: 8 of 9 runs, 3 s left", "runs: 9 of 9 runs, 0 s left"]


def test_what_was_done_before_counts_but_not_for_the_time(clock, capsys):
    list(progress("abcd", "rows", total=104, unit="rows", done=96))
    assert capsys.readouterr().err == "rows: 100 of 104 rows, 12 s left\n"


@pytest.mark.parametrize(("seconds", "words"), [(89, "89 s"), (91, "2 min"), (3599, "1 h 0 min")])
def test_times_are_words(seconds, words):
    assert _words(seconds) == words


@pytest.mark.parametrize("where", ["terminal", "notebook"])
def test_a_bar_is_shown_where_somebody_looks(monkeypatch, where):
    shown = []

    class Bar(notebook.tqdm if where == "notebook" else std.tqdm):
        def __new__(cls, items, name, **options):
            shown.append((name, options["total"], options["initial"], options["leave"]))
            return iter(items)

    monkeypatch.setattr(auto, "tqdm", Bar)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: where == "terminal", raising=False)
    assert list(progress([1, 2], "work", total=5, unit="steps", done=3)) == [1, 2]
    assert shown == [("work", 5, 3, where == "terminal")]
