import os
import signal
import subprocess
import sys
import threading

from vsp.run import atomic, locks

HOLD = """
import sys
from vsp.run.locks import file_lock
with file_lock(sys.argv[1], "x"):
    print(1, flush=True)
    input()
"""


def holds(lock, **options):
    """A process that holds `lock`."""
    command = [sys.executable, "-c", HOLD, lock]
    process = subprocess.Popen(command, cwd=atomic.ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **options)
    process.stdout.readline()
    return process


def test_one_after_the_other(tmp_path, capfd):
    """The second waits, says so, and comes in when the first is killed."""
    lock = tmp_path / "build" / "lock"
    first = holds(lock)
    threading.Timer(0.3, first.kill).start()
    with locks.file_lock(lock, "writes here"):
        assert first.wait() == -signal.SIGKILL
        assert lock.read_text() == str(os.getpid())
    assert capfd.readouterr().err == "another run writes here: waiting for it to end\n"
    with locks.file_lock(lock, "writes here"):
        assert capfd.readouterr().err == ""


def test_those_of_our_group_that_hold_a_lock_are_ended_and_nobody_else(tmp_path):
    ours, anothers = holds(tmp_path / "a"), holds(tmp_path / "b", start_new_session=True)
    ends = holds(tmp_path / "elsewhere" / "c")  # of our group, but it holds nothing in the folder
    (tmp_path / "d").write_text(str(ends.pid))  # any more
    with locks.file_lock(tmp_path / "e", "writes here"):
        locks.terminate_peers(tmp_path)
    assert ours.wait(10) == -signal.SIGTERM
    for spared in (anothers, ends):
        spared.communicate(b"\n", 10)
        assert spared.returncode == 0


def test_semaphores_of_a_killed_holder_are_removed_and_no_others(tmp_path, monkeypatch):
    """joblib names them by the process that has workers; `workers` cannot remove them when all are killed at once."""
    monkeypatch.setattr(locks, "SEMAPHORES", tmp_path / "shm")
    (tmp_path / "shm").mkdir()
    killed, alive = holds(tmp_path / "lock"), holds(tmp_path / "other")
    killed.kill(), killed.wait()
    for process in (killed, alive):
        (tmp_path / "shm" / f"sem.loky-{process.pid}-abc").touch()
    (tmp_path / "another").write_text(str(alive.pid))
    for lock in ("lock", "another", "new"):
        with locks.file_lock(tmp_path / lock, "writes here"):
            pass
    assert [path.name for path in (tmp_path / "shm").iterdir()] == [f"sem.loky-{alive.pid}-abc"]
    alive.communicate(b"\n", 10)
