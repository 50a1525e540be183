"""Show the progress of long work: a bar in a notebook and on a terminal, the same bar every ten seconds in a log."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator


def progress(items: Iterable, name: str, *, total: int, unit: str, done: int = 0) -> Iterator:
    """Yield `items` and show on standard error how many of `total` are done, and the time left.

    `done` of them were done before this call.
    """
    from tqdm import auto, notebook

    widget = issubclass(auto.tqdm, notebook.tqdm)  # it disappears when the work is done
    every = 0.1 if widget or sys.stderr.isatty() else 10.0  # seconds
    return iter(auto.tqdm(items, name, total=total, initial=done, unit=f" {unit}", leave=not widget, mininterval=every))
