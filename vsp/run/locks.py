"""Locks between processes, and what SIGTERM does."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

from .atomic import open_regular

SEMAPHORES = Path("/dev/shm")  # where Linux keeps them, joblib's under the number of the process


@contextlib.contextmanager
def file_lock(lock: str | os.PathLike, what: str) -> Iterator[None]:
    """Hold `lock`, or wait and say that another process does `what`; the system frees it however this process ends."""
    import fcntl  # here, since Windows, where students read files, has none

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
    """Remove what the workers of an earlier holder of a lock left, if it was killed together with them."""
    if holder.isdigit() and not Path("/proc", holder.decode()).exists():
        for left in SEMAPHORES.glob(f"sem.loky-{holder.decode()}-*"):
            with contextlib.suppress(OSError):
                left.unlink()


def terminate_peers(locks: str | os.PathLike) -> None:
    """SIGTERM to the processes that hold locks in the folder `locks`, if they are of our process group.

    Those are mostly the processes of the same make. One that has no lock yet goes on.
    """
    import fcntl

    for lock in Path(locks).iterdir():
        with contextlib.suppress(OSError, ValueError), open_regular(lock) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # its holder has ended, whatever is written there
            except BlockingIOError:
                holder = int(file.read())
                if holder != os.getpid() and os.getpgid(holder) == os.getpgrp():
                    os.kill(holder, signal.SIGTERM)


def sigterm_as_interrupt() -> None:
    """Let SIGTERM raise KeyboardInterrupt, which unwinds through whatever has kernels or workers to end."""
    signal.signal(signal.SIGTERM, _interrupt)


def _interrupt(signum: int, frame: object) -> None:
    raise KeyboardInterrupt
