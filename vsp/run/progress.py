"""Show the progress of long work: a bar in a notebook and on a terminal, a plain line every few seconds in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator

EVERY = 10.0  # seconds between two lines


def progress(items: Iterable, name: str, *, total: int, unit: str, done: int = 0) -> Iterator:
    """Yield `items` and show on standard error how many of `total` are done, and the time left.

    `done` of them were done before this call.
    """
    from tqdm import auto, notebook

    if sys.stderr.isatty() or issubclass(auto.tqdm, notebook.tqdm):
        stays = sys.stderr.isatty()  # a bar in a notebook disappears when the work is done
        yield from auto.tqdm(items, name, total=total, initial=done, unit=unit, leave=stays)
    else:
        yield from _in_lines(items, name, total, unit, done)


def _in_lines(items: Iterable, name: str, total: int, unit: str, done: int) -> Iterator:
    began = last = time.monotonic()
    for n, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= EVERY or done + n == total:
            left = (now - began) / n * (total - done - n)
            print(f"{name}: {done + n} of {total} {unit}, {_words(left)} left", file=sys.stderr, flush=True)
            last = now


def _words(seconds: float) -> str:
    """Format a time in hours and minutes, in minutes, or in seconds."""
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min" if minutes > 1 else f"{seconds:.0f} s"
