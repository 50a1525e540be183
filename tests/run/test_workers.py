"""Jobs on this machine: every result once, whoever dies on the way. tests/long has them on a Dask cluster."""

import os
import signal
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from vsp.run import workers
from vsp.run.command import CommandError
from vsp.run.listed import MANIFEST


def power(base, exponent):
    return base**exponent


def die(n):
    if n == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return n


def threads():
    return {library["num_threads"] for library in threadpool_info()}


def ask(work, arguments, jobs, *, done=0):
    return dict(workers.results(work, arguments, "a study", jobs=jobs, total=done + len(arguments), unit="rows"))


@pytest.mark.parametrize("jobs", [1, 2, -1])
def test_every_result_comes_with_its_number(jobs):
    asked = [(2, n) for n in range(7)]
    assert ask(power, asked, jobs) == {n: 2**n for n in range(7)}
    assert ask(power, [], jobs) == {}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_job_has_one_thread(jobs):
    np.ones((2, 2)) @ np.ones((2, 2))  # BLAS is there
    assert ask(threads, [(), ()], jobs) == {0: {1}, 1: {1}}
    assert ask(type, [(np.zeros(10**6),)], jobs) == {0: np.ndarray}  # no memory map, which a kill would leave


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_of_a_job_is_that_of_the_call(jobs):
    with pytest.raises(ZeroDivisionError):
        ask(power, [(0, -1)], jobs)


def test_a_killed_worker_is_named():
    """Nothing waits for it in vain; the message says how much was done and that the same command resumes."""
    told = r"a study: a worker process was killed \(.*SIGKILL.*\) with [345] of 6 rows done.*same command to resume"
    with pytest.raises(CommandError, match=told):
        ask(die, [(n,) for n in range(3)], 2, done=3)
    assert ask(die, [(3,), (4,)], 2) == {0: 3, 1: 4}  # and the pool is as good as new


def test_a_worker_with_other_code_is_refused(monkeypatch):
    call = workers._call
    monkeypatch.setattr(workers, "_call", lambda expected, *rest: call({**expected, "numpy": "1.0"}, *rest))
    with pytest.raises(CommandError, match="expected .*'numpy': '1.0'.*same checkout"):
        ask(power, [(1, 1)], 1)


def test_what_a_result_depends_on_is_looked_for_in_folders_too(tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "ROOT", tmp_path)
    monkeypatch.setattr(workers, "PACKAGES", ("numpy", "no-such-package"))
    known = [workers.identity.__wrapped__()]
    for name in ("vsp/deep/er/x.py", "data/teachers/short/" + MANIFEST):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("1")
        known.append(workers.identity.__wrapped__())
    assert len({one["code"] for one in known}) == 3 and known[0].keys() == {"code", "kernels", "python", "numpy"}


def test_an_address_without_a_scheduler_is_one_clear_error(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(workers, "ANSWER", 0.5)
    with pytest.raises(CommandError, match="no Dask scheduler with workers answers at 'tcp://127.0.0.1:9'"):
        ask(power, [(1, 1)], "tcp://127.0.0.1:9")


def test_a_cluster_without_its_package_is_one_clear_error(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(CommandError, match="Dask cluster, which needs the package `distributed`"):
        ask(power, [(1, 1)], "tcp://127.0.0.1:9")
