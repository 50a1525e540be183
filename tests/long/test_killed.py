"""Commands that are killed or told to end, with their kernels and workers: nothing of theirs is left."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from support import alive, until
from support import write_story as write

from vsp.run.atomic import ROOT

WORKERS = """\
import joblib, os, pathlib, tempfile, time
import numpy as np
tempfile.mkstemp()
def wait(array, n):
    (pathlib.Path(runs) / "ready").touch()
    time.sleep(60 if os.environ.get("WAIT") else 0)
(pathlib.Path(runs) / "kernel").write_text(str(os.getpid()))
_ = joblib.Parallel(2)(joblib.delayed(wait)(np.zeros(10**6), n) for n in range(2))"""


def test_a_killed_run_leaves_nothing_in_the_folders_of_others_and_the_next_removes_the_rest(tmp_path):
    """Neither its connection file, nor what the kernel and its workers make for a while, lies in TMPDIR or /dev/shm."""
    shared, runs, memory = tmp_path / "tmp", tmp_path / "data" / "runs", Path("/dev/shm")
    shared.mkdir(), runs.mkdir(parents=True)
    command = [sys.executable, "-m", "vsp.run.run_notebook", write(tmp_path, WORKERS), "--out", tmp_path]
    environ = os.environ | {"TMPDIR": str(shared)}
    process = subprocess.Popen(command, cwd=ROOT, start_new_session=True, env=environ | {"WAIT": "1"})
    until((runs / "ready").exists)
    kernel = int((runs / "kernel").read_text())
    for group in (process.pid, kernel):
        os.killpg(group, signal.SIGKILL)
    process.wait()
    for semaphore in memory.glob(f"sem.loky-{kernel}-*"):  # a kernel that ends when its runner does removes them
        semaphore.unlink()
    assert not list(shared.iterdir()) and not list(memory.glob(f"joblib*_{kernel}_*"))
    (work,) = (tmp_path / "build" / "running" / "story").iterdir()
    assert list((work / "tmp").glob("*.json")) and len(list((work / "tmp").iterdir())) > 1
    subprocess.run(command, cwd=ROOT, env=environ, check=True)
    assert not list((tmp_path / "build" / "running" / "story").iterdir()) and not list(shared.iterdir())


def test_end_by_signal_ends_kernel(tmp_path):
    """SIGTERM to the runner: no kernel and no output is left, and its lock is free."""
    pid, draw = tmp_path / "pid", "from pathlib import Path\n(Path(out) / 'figures').mkdir(parents=True)"
    wait = "import os, time\n(Path(out).parents[4] / 'pid').write_text(str(os.getpid()))\ntime.sleep(120)"
    command = [sys.executable, "-m", "vsp.run.run_notebook", write(tmp_path, draw, wait), "--out", tmp_path]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    until(lambda: pid.exists() and pid.read_text())
    process.send_signal(signal.SIGTERM)
    assert "story.ipynb: interrupted" in process.communicate(timeout=30)[1]
    assert process.returncode == 1
    until(lambda: not alive(int(pid.read_text())))
    assert not (tmp_path / "figures").exists() and not list((tmp_path / "build" / "running" / "story").iterdir())


def test_an_end_by_signal_ends_the_workers_too(tmp_path):
    """Else they would wait for ever, with open pipes, to hand over their next run.

    As `make` calls it: a module run as a script has another name than the one workers know it by.
    """
    command = [sys.executable, "-m", "vsp.paper.make_runs", "--quick", "--jobs", "2", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    until(lambda: list(tmp_path.rglob("[0-9]*.run")))
    children = subprocess.check_output(["pgrep", "-P", str(process.pid)], text=True).split()
    process.terminate()
    assert "error: interrupted." in process.communicate(timeout=30)[1] and process.returncode == 1
    until(lambda: not any(alive(int(pid)) for pid in children))
    assert len(children) >= 2
