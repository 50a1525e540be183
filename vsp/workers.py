"""Work in several processes: none dies unnoticed, and what went wrong is said in one line."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Callable, Iterator, Sequence

from .progress import progress
from .store import reason


class WorkerDied(RuntimeError):
    """A worker process was killed; the message says how far the work had come."""


def each(function: Callable, work: Sequence[tuple], label: str, *, jobs: int, total: int, unit: str) -> None:
    """Call `function` with each of `work`, in `jobs` processes, and show how many of `total` are done.

    What `work` lacks to `total` was done before. Raises `WorkerDied`, and whatever `function` raises.
    """
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    done = total - len(work)
    with parallel_config("loky", inner_max_num_threads=1):
        finished = Parallel(n_jobs=jobs, return_as="generator_unordered")(delayed(function)(*one) for one in work)
        try:
            for _ in progress(finished, label, total=total, unit=unit, done=done):
                done += 1
        except TerminatedWorkerError as error:
            how = re.search(r"\{(.*)\}", str(error))
            raise WorkerDied(
                f"{label}: a worker process was killed{f' ({how[1]})' if how else ''} with {done} of {total} {unit} "
                "done. They are kept: the same command goes on from there. Where memory ran out, use fewer workers: "
                "make JOBS=1"
            ) from error


@contextlib.contextmanager
def in_one_line() -> Iterator[None]:
    """A killed worker, a full disk and the like end a command with one line and status 1, without a traceback."""
    try:
        yield
    except WorkerDied as error:
        sys.exit(f"error: {error}")
    except OSError as error:
        sys.exit(f"error: {reason(error)}")
