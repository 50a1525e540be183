"""Locks between processes."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from .command import CommandError


@contextlib.contextmanager
def file_lock(path: str | os.PathLike, what: str) -> Iterator[None]:
    """Hold the lock `path` while the block runs. Raises CommandError, "another run `what`", if a process holds it.

    The system frees the lock however the process ends.
    """
    import fcntl  # imported here: Windows, where students read files, has no fcntl

    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with open(path, "ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise CommandError(f"another run {what}: wait for it to end, then run the same command") from error
        yield
