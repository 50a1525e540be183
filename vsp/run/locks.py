"""Locks between processes, and the handling of SIGTERM."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

from .atomic import open_regular

SEMAPHORES = Path("/dev/shm")  # Linux keeps semaphores here; names of joblib's hold the process number


@contextlib.contextmanager
def file_lock(lock: str | os.PathLike, what: str) -> Iterator[None]:
    """Hold `lock`. If another process holds it, print that another run does `what`, and wait.

    The system frees the lock however this process ends.
    """
    import fcntl  # imported here: Windows, where students read files, has no fcntl

    Path(lock).parent.mkdir(parents=True, exist_ok=True)
    with open_regular(lock, "a+b", buffering=0) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"another run {what}: waiting for it to end", file=sys.stderr, flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        _remove_semaphores(file.read())
        with contextlib.suppress(OSError):  # a full disk is reported by the work itself
            file.truncate(0)
            file.write(b"%d" % os.getpid())  # for `terminate_peers`
        yield


def _remove_semaphores(holder: bytes) -> None:
    """Remove semaphores that the workers of an earlier holder of a lock left, if all of them were killed."""
    if holder.isdigit() and not Path("/proc", holder.decode()).exists():
        for left in SEMAPHORES.glob(f"sem.loky-{holder.decode()}-*"):
            with contextlib.suppress(OSError):
                left.unlink()


def terminate_peers(locks: str | os.PathLike) -> None:
    """Send SIGTERM to the processes of our process group that hold locks in the folder `locks`.

    These are mostly the processes of the same make. A process that holds no lock yet continues.
    """
    import fcntl

    for lock in Path(locks).iterdir():
        with contextlib.suppress(OSError, ValueError), open_regular(lock) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # on success, the holder has ended: nothing to do
            except BlockingIOError:
                holder = int(file.read())
                if holder != os.getpid() and os.getpgid(holder) == os.getpgrp():
                    os.kill(holder, signal.SIGTERM)


def sigterm_as_interrupt() -> None:
    """Let SIGTERM raise KeyboardInterrupt, so that all code that started kernels or workers ends them."""
    signal.signal(signal.SIGTERM, _interrupt)


def _interrupt(signum: int, frame: object) -> None:
    raise KeyboardInterrupt
