"""Jobs on this machine and on a Dask cluster: the same results, whoever dies on the way."""

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


def threads():
    return {library["num_threads"] for library in threadpool_info()}


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs="CRITICAL") as cluster:
        yield cluster


def files(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*.run")}


@pytest.mark.parametrize("jobs", [1, 2, -1])
def test_every_result_comes_with_its_number(jobs):
    asked = [(2, n) for n in range(7)]
    assert dict(workers.results(power, asked, jobs=jobs)) == {n: 2**n for n in range(7)}
    assert dict(workers.results(power, [], jobs=jobs)) == {}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_job_has_one_thread(jobs):
    np.ones((2, 2)) @ np.ones((2, 2))  # BLAS is there
    assert dict(workers.results(threads, [(), ()], jobs=jobs)) == {0: {1}, 1: {1}}


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_of_a_job_is_that_of_the_call(jobs):
    with pytest.raises(ZeroDivisionError):
        dict(workers.results(power, [(0, -1)], jobs=jobs))


def test_a_worker_with_other_code_is_refused(monkeypatch):
    call = workers._call
    monkeypatch.setattr(workers, "_call", lambda expected, *rest: call({**expected, "numpy": "1.0"}, *rest))
    with pytest.raises(workers.UnlikeWorker, match="expected .*'numpy': '1.0'.*same checkout"):
        dict(workers.results(power, [(1, 1)], jobs=1))


def test_an_address_without_a_scheduler_is_one_clear_error(monkeypatch):
    monkeypatch.setattr(workers, "ANSWER", 0.5)
    with pytest.raises(OSError, match="no Dask scheduler answers at 'tcp://127.0.0.1:9'"):
        dict(workers.results(power, [(1, 1)], jobs="tcp://127.0.0.1:9"))


@pytest.mark.parametrize(("text", "value"), [("3", 3), ("-1", -1), ("tcp://10.0.0.1:8786", "tcp://10.0.0.1:8786")])
def test_jobs_are_a_number_or_an_address(text, value):
    assert workers.jobs(text) == value


def test_what_jobs_share_is_sent_once_and_numbers_are_not():
    teacher, other = CurvedTeacher(), CurvedTeacher()
    assert workers._shared([(teacher, 0), (other, 0), (teacher, 0)]) == [teacher]


def kill_one_of(cluster, folder):
    """SIGKILL to a worker process as soon as a run is there; how many were there by then."""
    victim = next(iter(cluster.workers.values()))
    while not (done := len(files(folder))):
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
