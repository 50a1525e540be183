"""Locks between processes."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from .command import CommandError


@contextlib.contextmanager
def folder_lock(folder: str | os.PathLike, refusal: str | None = None) -> Iterator[None]:
    """Hold the lock of `folder` while the block runs, after waiting for it. With `refusal`, a reason, it does not wait:
    it raises CommandError if a process holds the lock. The system frees the lock however the process ends."""
    import fcntl  # imported here: Windows, where students read files, has no fcntl

    Path(folder).mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (fcntl.LOCK_NB if refusal else 0))
        except BlockingIOError as error:
            raise CommandError(f"{refusal}: wait for it to end, then run the same command") from error
        yield
    finally:
        os.close(handle)
