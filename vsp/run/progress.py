"""Show the progress of long work: a bar in a notebook and on a terminal, the same bar every ten seconds in a log."""

import contextlib
import multiprocessing
import os
import sys
from collections.abc import Iterable, Iterator
from contextvars import ContextVar

_shown = ContextVar("shown", default=False)
DELAY = 2.0  # seconds of work without a bar


def progress(items: Iterable, name: str, *, total: int, unit: str, done: int = 0, delay: float = 0.0) -> Iterator:
    """Yield `items` and show how many of `total` are done, and the time left: on standard error, or below the cell of a
    notebook. `done` of them were done before this call; the bar appears after `delay` seconds."""
    from tqdm import auto, notebook, std

    # There it is no widget, because in the place of one that has ended JupyterLab would later show an error
    in_notebook = issubclass(auto.tqdm, notebook.tqdm)
    every = 0.1 if in_notebook or sys.stderr.isatty() else 10.0  # seconds
    options = {"mininterval": every, "delay": delay} | ({"leave": False, "file": sys.stdout} if in_notebook else {})
    return iter(std.tqdm(items, name, total=total, initial=done, unit=f" {unit}", **options))


@contextlib.contextmanager
def shown(wanted: bool = True) -> Iterator[None]:
    """Let `steps` inside show its progress if `wanted`, but not in a worker process or under make."""
    token = _shown.set(wanted and "MAKELEVEL" not in os.environ and multiprocessing.parent_process() is None)
    try:
        yield
    finally:
        _shown.reset(token)


def is_shown() -> bool:
    """Return whether the caller of a search wants to read about it."""
    return _shown.get()


def steps(items: Iterable, name: str, *, total: int, unit: str) -> Iterable:
    """Yield `items`, with a bar where `shown` allows it and the work takes longer than `DELAY`."""
    return progress(items, name, total=total, unit=unit, delay=DELAY) if is_shown() else items
