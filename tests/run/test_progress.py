import sys

import pytest
from tqdm import auto, notebook, std

from vsp.run import progress as module
from vsp.run.progress import progress, shown, steps


def test_a_log_says_how_many_are_done_and_what_was_done_before_counts(capsys):
    assert "".join(progress("abcd", "rows", total=104, unit="rows", done=100)) == "abcd"
    assert "104/104" in capsys.readouterr().err


@pytest.mark.parametrize("where", ["log", "terminal", "notebook"])
def test_a_bar_stays_except_in_a_notebook_and_is_rare_in_a_log(monkeypatch, where):
    shown = []

    def bar(items, name, **options):
        stays = options.get("leave", True), options.get("file", sys.stderr) is sys.stderr
        shown.append((name, options["total"], options["initial"], *stays, options["mininterval"]))
        return items

    monkeypatch.setattr(auto, "tqdm", notebook.tqdm if where == "notebook" else std.tqdm)
    monkeypatch.setattr(std, "tqdm", bar)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: where == "terminal", raising=False)
    assert list(progress([1, 2], "work", total=5, unit="steps", done=3)) == [1, 2]
    assert shown == [("work", 5, 3, *[where != "notebook"] * 2, 10.0 if where == "log" else 0.1)]


def test_a_search_shows_its_steps_where_somebody_reads_them(monkeypatch, capsys):
    monkeypatch.setattr(module, "DELAY", 0.0)
    monkeypatch.delenv("MAKELEVEL", raising=False)
    for wanted, parent in ((True, None), (False, None), (True, "a parent")):
        monkeypatch.setattr(module.multiprocessing, "parent_process", lambda parent=parent: parent)
        with shown(wanted):
            assert list(steps("ab", "fits", total=2, unit="starts")) == ["a", "b"]
        assert ("2/2" in capsys.readouterr().err) == (wanted and not parent)
