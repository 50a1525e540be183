"""`make paper-figures DASK=...` on a cluster of two worker processes, one of which is killed on the way."""

import os
import signal

from makes import difference, figures, processes, tree, until


def test_a_cluster_makes_the_same_figures_and_tables_although_a_worker_dies(tmp_path, record):
    from distributed import LocalCluster

    here, there = tmp_path / "here", tmp_path / "there"
    alone = figures(here)
    assert alone.wait() == 0, alone.said
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs="CRITICAL") as cluster:
        make = figures(there, env={"DASK": cluster.scheduler_address})
        victim = next(iter(cluster.workers.values())).pid
        done = len(until(lambda: list(there.rglob("[0-9]*.run")), 300))
        assert done and not [one for one in processes(there).values() if "popen_loky" in one], "the cluster has no work"
        os.kill(victim, signal.SIGKILL)
        assert make.wait() == 0, make.said
    total = len(list(there.rglob("[0-9]*.run")))
    assert done < total, "no run was left when the worker died"
    wrong = difference(tree(here), tree(there))
    note = f"{wrong or 'the same files'}, a worker killed after {done} of {total} runs"
    what = "figures and tables from a Dask cluster of two workers, one killed"
    record("faults", what, int(not wrong), "of 1", at_least=1, note=note)
