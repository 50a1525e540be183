"""Many jobs at once: in processes of this machine, or by the workers of a Dask cluster. Results come back as they end.

Workers write nothing: a cluster needs no common folder, and what is on disk was written by one process.
"""

from __future__ import annotations

import contextlib
import hashlib
import platform
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path

from threadpoolctl import threadpool_limits

from .machine import cpu_type
from .progress import progress
from .store import MANIFEST, ROOT, heed_sigterm, reason

JOBS = "worker processes, -1 for one per core, or the address of a Dask scheduler"  # words for --jobs
ANSWER = 10  # seconds within which a scheduler answers


def jobs(text: str) -> int | str:
    """The value of --jobs: a number, or an address as it is."""
    return text if "://" in text else int(text)


class UnlikeWorker(RuntimeError):
    """A worker of a cluster whose code or libraries are not those of the one who asks."""


class WorkerDied(RuntimeError):
    """A worker process was killed; the message says how far the work had come."""


class NoScheduler(RuntimeError):
    """An address where no Dask scheduler answers."""


def results(
    work: Callable, arguments: Sequence[tuple], label: str, *, jobs: int | str, total: int, unit: str
) -> Iterator[tuple[int, object]]:
    """Yield (i, work(*arguments[i])) for every i, in the order in which they end, and show how many are done.

    What `arguments` lack to `total` was done before. `jobs` is the number of worker processes (-1: one per core) or the
    address of a Dask scheduler, such as `tcp://127.0.0.1:8786`; whoever it belongs to can run code here and on the
    workers. Every job runs with one thread. Raises what `work` raises, WorkerDied (on a cluster others take over, until
    one job took four workers with it), UnlikeWorker and NoScheduler.
    """
    if not arguments:
        return
    done = total - len(arguments)
    try:
        for result in progress(_finished(work, arguments, jobs), label, total=total, unit=unit, done=done):
            yield result
            done += 1
    except Exception as error:
        if type(error).__name__ == "TimeoutError" and isinstance(jobs, str):
            raise NoScheduler(
                f"the Dask scheduler at {jobs!r} has no workers, expected one or more: start some"
            ) from error
        if type(error).__name__ not in ("TerminatedWorkerError", "KilledWorker"):  # loky's and Dask's
            raise
        how = re.search(r"\{(.*)\}", str(error))
        raise WorkerDied(
            f"{label}: a worker process was killed{f' ({how[1]})' if how else ''} with {done} of {total} {unit} done. "
            "What is on disk stays: the same command goes on from there. Where memory ran out, use fewer: make JOBS=1"
        ) from error


def _finished(work: Callable, arguments: Sequence[tuple], jobs: int | str) -> Iterator[tuple[int, object]]:
    from joblib import Parallel, delayed, parallel_config

    calls = [delayed(_call)(identity(), work, i, *one) for i, one in enumerate(arguments)]
    with contextlib.ExitStack() as stack:
        if isinstance(jobs, str):
            client = stack.enter_context(_client(jobs))
            stack.enter_context(parallel_config("dask", client=client, scatter=_shared(arguments), n_jobs=-1))
        else:
            stack.enter_context(parallel_config("loky", inner_max_num_threads=1, n_jobs=jobs))
        yield from Parallel(return_as="generator_unordered")(calls)


def _call(expected: dict[str, str], work: Callable, i: int, *one) -> tuple[int, object]:
    if (found := identity()) != expected:
        raise UnlikeWorker(
            f"the worker on {platform.node()} has {found}, expected {expected}: give it the same checkout and .venv"
        )
    with threadpool_limits(1):  # the same sums in the same order on any machine
        return i, work(*one)


@cache
def identity() -> dict[str, str]:
    """What decides a result beside its arguments: code, teachers, type of processor, and the versions of packages."""
    teachers = sorted((ROOT / "data" / "teachers").rglob(MANIFEST))
    files = [*sorted(Path(__file__).parent.glob("*.py")), *teachers]
    code = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:10]
    versions = {name: version(name) for name in ("numpy", "scipy", "scikit-learn", "torch", "gymnasium", "cma")}
    return {"code": code, "processor": cpu_type(), "python": platform.python_version(), **versions}


def _client(address: str):
    from distributed import Client

    try:
        return Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError) as error:
        raise NoScheduler(
            f"no Dask scheduler answers at {address!r}, expected one as in tcp://host:8786: {error}"
        ) from error


def _shared(arguments: Sequence[tuple]) -> list:
    """What several jobs are given, a teacher for one: every worker gets it once."""
    objects = {id(part): part for one in arguments for part in one if not isinstance(part, int | str)}
    counts = Counter(id(part) for one in arguments for part in one)
    return [part for key, part in objects.items() if counts[key] > 1]


@contextlib.contextmanager
def in_one_line() -> Iterator[None]:
    """A killed worker, a full disk, SIGTERM and the like end a command and its workers with one line, no traceback."""
    heed_sigterm()
    try:
        yield
    except KeyboardInterrupt:
        sys.exit("error: interrupted. What is on disk stays: the same command goes on from there.")
    except (WorkerDied, UnlikeWorker, NoScheduler) as error:
        sys.exit(f"error: {error}")
    except OSError as error:
        sys.exit(f"error: {reason(error)}")
