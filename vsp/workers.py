"""Many jobs at once: in processes of this machine, or by the workers of a Dask cluster. Results come back as they end.

Workers write nothing: a cluster needs no common folder, and what is on disk was written by one process.
"""

from __future__ import annotations

import hashlib
import platform
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path

from threadpoolctl import threadpool_limits

JOBS = "worker processes, -1 for one per core, or the address of a Dask scheduler"  # words for --jobs


def jobs(text: str) -> int | str:
    """The value of --jobs: a number, or an address as it is."""
    return text if "://" in text else int(text)


ANSWER = 10  # seconds within which a scheduler answers


class UnlikeWorker(RuntimeError):
    """A worker of a cluster whose code or libraries are not those of the one who asks."""


def results(work: Callable, arguments: Sequence[tuple], *, jobs: int | str) -> Iterator[tuple[int, object]]:
    """Yield (i, work(*arguments[i])) for every i, in the order in which they end.

    `jobs` is the number of worker processes (-1: one per core) or the address of a Dask scheduler, such as
    "tcp://127.0.0.1:8786"; whoever it belongs to can run code here and on the workers. Every job runs with one thread.
    Raises what `work` raises, UnlikeWorker, and OSError for an address where no scheduler answers.
    """
    from joblib import Parallel, delayed, parallel_config

    calls = [delayed(_call)(identity(), work, i, *one) for i, one in enumerate(arguments)]
    if isinstance(jobs, str):
        where = {"backend": "dask", "client": _client(jobs), "scatter": _shared(arguments)}
        n_jobs = -1  # all that the cluster has
    else:
        where, n_jobs = {"backend": "loky", "inner_max_num_threads": 1}, jobs
    try:
        with parallel_config(**where):
            yield from Parallel(n_jobs=n_jobs, return_as="generator_unordered")(calls)
    finally:
        if isinstance(jobs, str):
            where["client"].close()


def _call(expected: dict[str, str], work: Callable, i: int, *one) -> tuple[int, object]:
    if (found := identity()) != expected:
        raise UnlikeWorker(
            f"the worker on {platform.node()} has {found}, expected {expected}: give it the same checkout and .venv"
        )
    with threadpool_limits(1):  # the same sums in the same order on any machine
        return i, work(*one)


@cache
def identity() -> dict[str, str]:
    """What decides a result beside its arguments: the code of vsp, and the versions that round and draw."""
    code = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py"))))
    versions = {name: version(name) for name in ("numpy", "scipy", "scikit-learn", "torch")}
    return {"vsp": code.hexdigest()[:10], "python": platform.python_version(), **versions}


def _client(address: str):
    from distributed import Client

    try:
        return Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError) as error:
        raise OSError(
            f"no Dask scheduler answers at {address!r}, expected one as in tcp://host:8786: {error}"
        ) from error


def _shared(arguments: Sequence[tuple]) -> list:
    """What several jobs are given, a teacher for one: every worker gets it once."""
    objects = {id(part): part for one in arguments for part in one if not isinstance(part, int | str)}
    counts = Counter(id(part) for one in arguments for part in one)
    return [part for key, part in objects.items() if counts[key] > 1]
