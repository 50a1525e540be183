import errno
import os
import signal

import pytest

from vsp.workers import WorkerDied, each, in_one_line


def write(path):
    path.write_text(str(os.getpid()))


def die(path):
    if path.name == "2":
        os.kill(os.getpid(), signal.SIGKILL)
    write(path)


@pytest.mark.parametrize("jobs", [1, 2])
def test_all_work_is_done_and_counted(tmp_path, capsys, jobs):
    each(write, [(tmp_path / str(n),) for n in range(4)], "a study", jobs=jobs, total=7, unit="rows")
    assert {path.name for path in tmp_path.iterdir()} == set("0123")
    assert "a study: 7 of 7 rows" in capsys.readouterr().err
    assert (len({path.read_text() for path in tmp_path.iterdir()} & {str(os.getpid())}) == 1) == (jobs == 1)


def test_a_killed_worker_is_named(tmp_path):
    """Nothing waits for it in vain; the message says how far the work came and that it goes on from there."""
    work = [(tmp_path / str(n),) for n in range(3)]
    with pytest.raises(
        WorkerDied, match=r"a study: a worker process was killed \(.*SIGKILL.*\) with [345] of 6 rows done.*kept"
    ):
        each(die, work, "a study", jobs=2, total=6, unit="rows")
    each(write, work, "a study", jobs=2, total=6, unit="rows")  # and the pool is as good as new


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (WorkerDied("a worker"), "error: a worker"),
        (OSError(errno.ENOSPC, "No space", "a.run"), "error: a.run: No space: free some space, or name another folder"),
    ],
)
def test_in_one_line(error, line):
    with pytest.raises(SystemExit) as end, in_one_line():
        raise error
    assert str(end.value).startswith(line) and end.value.__suppress_context__ is False


def test_a_bug_keeps_its_traceback():
    for bug in (FileNotFoundError(errno.ENOENT, "No such file", "x"), ValueError("x"), TimeoutError("x")):
        with pytest.raises(type(bug)), in_one_line():
            raise bug
