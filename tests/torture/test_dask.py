"""`make paper-figures DASK=...` on a cluster of two worker processes, one of which is killed on the way."""

import os
import signal
import subprocess
import time

from vsp.store import ROOT


def make(out, **variables):
    given = [f"{name}={value}" for name, value in {"QUICK": 1, "OUT": out, **variables}.items()]
    command = ["make", "-C", str(ROOT), "paper-figures", *given]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def made(out):
    folders = (out / "figures", out / "data")
    return {path.relative_to(out): path.read_bytes() for f in folders for path in f.rglob("*") if path.is_file()}


def test_a_cluster_makes_the_same_figures_and_tables_although_a_worker_dies(tmp_path, record):
    from distributed import LocalCluster

    here = make(tmp_path / "here")
    assert here.wait() == 0, here.stdout.read()
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs="CRITICAL") as cluster:
        there = make(tmp_path / "there", DASK=cluster.scheduler_address)
        victim = next(iter(cluster.workers.values())).pid
        while not (done := len(list((tmp_path / "there").rglob("*.run")))):
            assert there.poll() is None, there.stdout.read()
            time.sleep(0.02)
        os.kill(victim, signal.SIGKILL)
        assert there.wait() == 0, there.stdout.read()
    first, second = made(tmp_path / "here"), made(tmp_path / "there")
    same = sum(first[name] == second.get(name) for name in first)
    runs = sum(name.suffix == ".run" for name in second)
    text = f"{same} of {len(first)} files, the worker killed after {done} of {runs} runs"
    record("faults", "a Dask cluster of two workers, one killed", "the same files", text, first == second)
