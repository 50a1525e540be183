"""Run many jobs in parallel, in processes of this machine or on a Dask cluster. Results come as jobs end.

Workers write no files, so a cluster needs no shared folder, and one process writes all files.
"""

from __future__ import annotations

import contextlib
import hashlib
import platform
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from threadpoolctl import threadpool_limits

from .atomic import ROOT
from .command import CommandError
from .listed import MANIFEST
from .machine import cpu_type
from .progress import progress

ANSWER = 10  # seconds to wait for the answer of a scheduler
IDLE = 20  # seconds after which an idle worker ends, even if the process that started it is gone
# Their versions may affect a result
PACKAGES = ("numpy", "scipy", "scikit-learn", "gymnasium", "cma", "torch", "stable-baselines3", "mujoco", "box2d")


class UnlikeWorker(CommandError):
    """A worker of a cluster whose code or libraries differ from those of the calling process."""


class WorkerDied(CommandError):
    """A worker process was killed; the message says how much work was done."""


class NoScheduler(CommandError):
    """An address where no Dask scheduler answers."""


def results(
    work: Callable, arguments: Sequence[tuple], label: str, *, jobs: int | str, total: int, unit: str
) -> Iterator[tuple[int, object]]:
    """Yield (i, work(*arguments[i])) for every i, as jobs end, and show how many are done.

    `total` includes jobs that were done before. `jobs` is the number of worker processes (-1: one per core) or the
    address of a Dask scheduler, such as `tcp://127.0.0.1:8786`; its owner can run code here and on the workers. Every
    job runs with one thread. Raises what `work` raises, WorkerDied (on a cluster, after one job killed four workers),
    UnlikeWorker and NoScheduler.
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
            "Finished files stay on disk: run the same command to resume. If memory ran out, use fewer workers: JOBS=1"
        ) from error


def _finished(work: Callable, arguments: Sequence[tuple], jobs: int | str) -> Iterator[tuple[int, object]]:
    from joblib import Parallel, delayed, parallel_config

    calls = [delayed(_call)(identity(), work, i, *one) for i, one in enumerate(arguments)]
    with contextlib.ExitStack() as stack:
        if isinstance(jobs, str):
            client = stack.enter_context(_client(jobs))
            stack.enter_context(parallel_config("dask", client=client, scatter=_shared(arguments), n_jobs=-1))
        else:
            # No memory maps, so no folders in /dev/shm remain after a kill: the arguments of a job take about 1 MB
            options = {"max_nbytes": None, "temp_folder": tempfile.gettempdir(), "idle_worker_timeout": IDLE}
            stack.enter_context(parallel_config("loky", inner_max_num_threads=1, n_jobs=jobs, **options))
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
    """Return what determines a result besides its arguments: code, teachers, processor type, and package versions."""
    code = hashlib.sha256(b"".join(path.read_bytes() for path in _deciding_files())).hexdigest()[:10]
    found = {"code": code, "processor": cpu_type(), "python": platform.python_version()}
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _deciding_files() -> list[Path]:
    """Return the paths of all code of the package and of the manifests of the teachers."""
    parts = [ROOT / part for part in ("vsp", "vsp_beyond", "studies")]
    code = [path for part in parts for kind in ("*.py", "*.c") for path in sorted(part.rglob(kind))]
    return [*code, *sorted((ROOT / "data" / "teachers").rglob(MANIFEST))]


def _client(address: str):
    try:
        from distributed import Client
    except ImportError as error:
        raise NoScheduler(f"{address!r} asks for a Dask cluster, which needs the package `distributed`") from error
    try:
        return Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError) as error:
        raise NoScheduler(
            f"no Dask scheduler answers at {address!r}, expected one as in tcp://host:8786: {error}"
        ) from error


def _shared(arguments: Sequence[tuple]) -> list:
    """Return the arguments that several jobs share, such as a teacher. Every worker gets them once."""
    objects = {id(part): part for one in arguments for part in one if not isinstance(part, int | str)}
    counts = Counter(id(part) for one in arguments for part in one)
    return [part for key, part in objects.items() if counts[key] > 1]
