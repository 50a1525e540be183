"""Jobs on this machine and on a Dask cluster: the same results, whoever dies on the way."""

import errno
import os
import signal
import time

import numpy as np
import pytest
from support import SIMPLEGOAL, CurvedTeacher, tiny
from threadpoolctl import threadpool_info

from vsp import workers
from vsp.experiments import Experiment, make_runs

SMALL = Experiment(SIMPLEGOAL, tiny(n_epochs=500, n_freeze=5), CurvedTeacher(), n_episodes=20)


def power(base, exponent):
    return base**exponent


def die(n):
    if n == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return n


def threads():
    return {library["num_threads"] for library in threadpool_info()}


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs="CRITICAL") as cluster:
        yield cluster


def files(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*.run")}


def ask(work, arguments, jobs, *, done=0):
    return dict(workers.results(work, arguments, "a study", jobs=jobs, total=done + len(arguments), unit="rows"))


@pytest.mark.parametrize("jobs", [1, 2, -1])
def test_every_result_comes_with_its_number(jobs):
    asked = [(2, n) for n in range(7)]
    assert ask(power, asked, jobs) == {n: 2**n for n in range(7)}
    assert ask(power, [], jobs) == {}


def test_the_way_is_told(capsys):
    ask(power, [(2, n) for n in range(4)], 1, done=3)
    assert "a study: 7 of 7 rows" in capsys.readouterr().err
    ask(power, [], 1, done=3)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_job_has_one_thread(jobs):
    np.ones((2, 2)) @ np.ones((2, 2))  # BLAS is there
    assert ask(threads, [(), ()], jobs) == {0: {1}, 1: {1}}


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_of_a_job_is_that_of_the_call(jobs):
    with pytest.raises(ZeroDivisionError):
        ask(power, [(0, -1)], jobs)


def test_a_killed_worker_is_named():
    """Nothing waits for it in vain; the message says how far the work came and that it goes on from there."""
    told = r"a study: a worker process was killed \(.*SIGKILL.*\) with [345] of 6 rows done.*goes on from there"
    with pytest.raises(workers.WorkerDied, match=told):
        ask(die, [(n,) for n in range(3)], 2, done=3)
    assert ask(die, [(3,), (4,)], 2) == {0: 3, 1: 4}  # and the pool is as good as new


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (workers.WorkerDied("a worker"), "error: a worker"),
        (workers.NoScheduler("no one"), "error: no one"),
        (OSError(errno.ENOSPC, "No space", "a.run"), "error: a.run: No space: free some space, or name another folder"),
    ],
)
def test_in_one_line(error, line):
    with pytest.raises(SystemExit) as end, workers.in_one_line():
        raise error
    assert str(end.value).startswith(line)


def test_a_bug_keeps_its_traceback():
    for bug in (FileNotFoundError(errno.ENOENT, "No such file", "x"), ValueError("x"), TimeoutError("x")):
        with pytest.raises(type(bug)), workers.in_one_line():
            raise bug


def test_a_worker_with_other_code_is_refused(monkeypatch):
    call = workers._call
    monkeypatch.setattr(workers, "_call", lambda expected, *rest: call({**expected, "numpy": "1.0"}, *rest))
    with pytest.raises(workers.UnlikeWorker, match="expected .*'numpy': '1.0'.*same checkout"):
        ask(power, [(1, 1)], 1)


def test_an_address_without_a_scheduler_is_one_clear_error(monkeypatch):
    monkeypatch.setattr(workers, "ANSWER", 0.5)
    with pytest.raises(workers.NoScheduler, match="no Dask scheduler answers at 'tcp://127.0.0.1:9'"):
        ask(power, [(1, 1)], "tcp://127.0.0.1:9")


@pytest.mark.parametrize(("text", "value"), [("3", 3), ("-1", -1), ("tcp://10.0.0.1:8786", "tcp://10.0.0.1:8786")])
def test_jobs_are_a_number_or_an_address(text, value):
    assert workers.jobs(text) == value


def test_what_jobs_share_is_sent_once_and_numbers_are_not():
    teacher, other = CurvedTeacher(), CurvedTeacher()
    assert workers._shared([(teacher, 0), (other, 0), (teacher, 0)]) == [teacher]


def kill_one_of(cluster, folder):
    """SIGKILL to a worker process as soon as a run is there; how many were there by then."""
    victim, end = next(iter(cluster.workers.values())), time.monotonic() + 60
    while not (done := len(files(folder))):
        assert time.monotonic() < end
        time.sleep(0.01)
    os.kill(victim.pid, signal.SIGKILL)
    return done


def test_a_cluster_makes_the_same_runs_and_the_death_of_a_worker_changes_nothing(cluster, tmp_path):
    from concurrent.futures import ThreadPoolExecutor

    make_runs(SMALL, range(8), runs=tmp_path / "here")
    with ThreadPoolExecutor() as beside:
        killed = beside.submit(kill_one_of, cluster, tmp_path / "there")
        make_runs(SMALL, range(8), runs=tmp_path / "there", jobs=cluster.scheduler_address)
        assert killed.result(timeout=30) < 6
    assert files(tmp_path / "here") == files(tmp_path / "there") and len(files(tmp_path / "there")) == 8
