"""A Dask cluster on this machine makes the same runs, also when a worker dies."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor

import pytest
from support import SIMPLEGOAL, CurvedTeacher, tiny, until

from vsp.paper.runs import Experiment, make_runs

SMALL = Experiment(SIMPLEGOAL, tiny(n_epochs=500, n_freeze=5), CurvedTeacher(), n_episodes=20)


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")  # an extra
    how = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": "CRITICAL"}
    with distributed.LocalCluster(n_workers=2, **how) as cluster:
        yield cluster


def files(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*.run")}


def kill_one_of(cluster, folder):
    """SIGKILL to a worker process as soon as a run is there; how many were there by then."""
    victim = next(iter(cluster.workers.values()))
    until(lambda: files(folder))
    os.kill(victim.pid, signal.SIGKILL)
    return len(files(folder))


def test_a_cluster_makes_the_same_runs_and_the_death_of_a_worker_changes_nothing(cluster, tmp_path):
    make_runs(SMALL, range(8), runs=tmp_path / "here")
    with ThreadPoolExecutor() as beside:
        killed = beside.submit(kill_one_of, cluster, tmp_path / "there")
        make_runs(SMALL, range(8), runs=tmp_path / "there", jobs=cluster.scheduler_address)
        assert killed.result(timeout=30) < 6
    assert files(tmp_path / "here") == files(tmp_path / "there") and len(files(tmp_path / "there")) == 8
