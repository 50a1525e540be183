"""Run many jobs in parallel, in processes of this machine or on a Dask cluster. Results come as jobs end.

Workers write no files, so a cluster needs no shared folder, and one process writes all files.
"""

import contextlib
import hashlib
import platform
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from threadpoolctl import threadpool_limits

from . import kernels
from .atomic import ROOT
from .command import CommandError
from .listed import MANIFEST
from .progress import progress

ANSWER = 10  # seconds to wait for the answer of a scheduler
IDLE = 20  # seconds after which an idle worker ends, even if the process that started it is gone
# Their versions may affect a result
PACKAGES = ("numpy", "scipy", "scikit-learn", "gymnasium", "cma", "torch", "stable-baselines3", "mujoco", "box2d")


def results(
    work: Callable, arguments: Sequence[tuple], label: str, *, jobs: int | str, total: int, unit: str
) -> Iterator[tuple[int, Any]]:
    """Yield (i, work(*arguments[i])) for every i, as jobs end, and show how many are done.

    `total` includes jobs that were done before. `jobs` is the number of worker processes (-1: one per core) or the
    address of a Dask scheduler, such as `tcp://127.0.0.1:8786`; its owner can run code here and on the workers. Every
    job runs with one thread. Raises what `work` raises, and CommandError if a worker was killed (on a cluster, after
    one job killed four workers), if a worker's code or libraries differ from those here, or if no scheduler answers."""
    if not arguments:
        return
    done = total - len(arguments)
    try:
        for result in progress(_as_they_end(work, arguments, jobs), label, total=total, unit=unit, done=done):
            yield result
            done += 1
    except Exception as error:
        if type(error).__name__ not in ("TerminatedWorkerError", "KilledWorker"):  # loky's and Dask's
            raise
        how = re.search(r"\{(.*)\}", str(error))
        raise CommandError(
            f"{label}: a worker process was killed{f' ({how[1]})' if how else ''} with {done} of {total} {unit} done. "
            "Finished files stay on disk: run the same command to resume. If memory ran out, use fewer workers: JOBS=1"
        ) from error


def _as_they_end(work: Callable, arguments: Sequence[tuple], jobs: int | str) -> Iterator[tuple[int, object]]:
    from joblib import Parallel, delayed, parallel_config

    calls = [delayed(_call)(identity(), work, i, *given) for i, given in enumerate(arguments)]
    with contextlib.ExitStack() as stack:
        if isinstance(jobs, str):
            client = stack.enter_context(_client(jobs))
            stack.enter_context(parallel_config("dask", client=client, n_jobs=-1))
        else:
            # No memory maps, so no folders in /dev/shm remain after a kill: the arguments of a job take about 1 MB
            options = {"max_nbytes": None, "temp_folder": tempfile.gettempdir(), "idle_worker_timeout": IDLE}
            stack.enter_context(parallel_config("loky", inner_max_num_threads=1, n_jobs=jobs, **options))
        yield from Parallel(return_as="generator_unordered")(calls)


def _call(expected: dict[str, str], work: Callable, i: int, *given) -> tuple[int, object]:
    if (here := identity()) != expected:
        raise CommandError(
            f"the worker on {platform.node()} has {here}, expected {expected}: give it the same checkout and .venv"
        )
    with threadpool_limits(1):  # the same sums in the same order on any machine
        return i, work(*given)


@cache
def identity() -> dict[str, str]:
    """Return what determines a result besides its arguments: code, teachers, kernels, and package versions."""
    parts = [ROOT / part for part in ("vsp", "vsp_beyond", "studies")]
    code = [path for part in parts for kind in ("*.py", "*.c") for path in sorted(part.rglob(kind))]
    code += sorted((ROOT / "data" / "teachers").rglob(MANIFEST))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in code)).hexdigest()[:10]
    known = {"code": digest, "kernels": kernels.name(), "python": platform.python_version()}
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            known[name] = version(name)
    return known


def _client(address: str):
    try:
        from distributed import Client

        client = Client(address, timeout=ANSWER, set_as_default=False)
        client.wait_for_workers(1, timeout=ANSWER)
    except ImportError as error:
        raise CommandError(f"{address!r} asks for a Dask cluster, which needs the package `distributed`") from error
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        raise CommandError(
            f"no Dask scheduler with workers answers at {address!r}, expected one as in tcp://host:8786: {error}"
        ) from error
    return client
