"""Commands end in one line for what their user can mend."""

import argparse
import errno
import os

import pytest
from support import called

from studies import make_rows
from vsp.paper import make_runs
from vsp.run.atomic import DamagedFile, MissingFile, write_text
from vsp.run.command import CommandError, in_one_line, jobs


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (CommandError("a fault"), "error: a fault"),
        (DamagedFile("x.run: damaged"), "error: x.run: damaged"),
        (MissingFile("x.run: no such file"), "error: x.run: no such file"),
        (OSError(errno.ENOSPC, "No space", "a.run"), "error: work: [Errno 28] No space: 'a.run': free some space, "),
        (KeyboardInterrupt(), "error: work: interrupted. Finished files stay on disk"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_what_a_user_can_mend_is_told_in_one_line(error, line):
    with pytest.raises(SystemExit) as end, in_one_line("work"):
        raise error
    assert str(end.value).startswith(line) and "\n" not in str(end.value)


def test_a_bug_keeps_its_traceback():
    for bug in (FileNotFoundError(errno.ENOENT, "No such file", "x"), ValueError("x"), TimeoutError("x")):
        with pytest.raises(type(bug)), in_one_line():
            raise bug


def full(handle):
    raise OSError(errno.ENOSPC, "No space left on device")  # without a name, as the system raises it


def test_a_full_or_occupied_place_is_named(tmp_path, monkeypatch):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("before")
    full_disk = f"error: work: .*{tmp_path}.*: free some space, make it writable, or name another folder: OUT=folder"
    for path, said in ((tmp_path / "folder", "folder: is a folder, a FIFO"), (tmp_path / "file" / "x", full_disk)):
        with pytest.raises(SystemExit, match=said), in_one_line("work"):
            write_text(path, "new")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SystemExit, match=f"No space left on device: '{tmp_path / 'file'}': free some space, "):
        with in_one_line("work"):
            write_text(tmp_path / "file", "half")
    assert (tmp_path / "file").read_text() == "before" and len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(("text", "value"), [("3", 3), ("-1", -1), ("tcp://10.0.0.1:8786", "tcp://10.0.0.1:8786")])
def test_jobs_are_a_number_or_an_address(text, value):
    assert jobs(text) == value


@pytest.mark.parametrize("text", ["0", "1.5", "", "9" * 7, "²", "tcp://host", "://host:1"])
def test_other_jobs_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="expected a whole number from 1 on, -1 for one per core, or"):
        jobs(text)


@pytest.mark.parametrize("command", [make_runs, make_rows], ids=lambda module: module.__name__)
def test_commands_refuse_such_jobs_before_they_begin(capsys, command):
    with pytest.raises(SystemExit) as end:
        called(command.main, "--jobs", 0)
    assert end.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("command: error: argument --jobs: '0': expected a whole")
