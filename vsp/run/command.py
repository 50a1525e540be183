"""What commands share: the value of --jobs, and errors that end them in one line."""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Iterator

from .atomic import DamagedFile, MissingFile, one_line
from .locks import sigterm_as_interrupt

JOBS = "worker processes, -1 for one per core, or the address of a Dask scheduler"  # words for --jobs


class CommandError(RuntimeError):
    """An error whose message is all that the user of a command needs."""


def jobs(text: str) -> int | str:
    """The value of --jobs: a number of processes, or an address as it is."""
    if re.fullmatch(r"-1|0*[1-9][0-9]{0,5}", text):
        return int(text)
    if re.fullmatch(r"[a-z]+://.+:[0-9]+", text):
        return text
    raise argparse.ArgumentTypeError(
        f"{text!r}: expected a whole number from 1 on, -1 for one per core, or an address as in tcp://host:8786"
    )


@contextlib.contextmanager
def in_one_line(what: str = "") -> Iterator[None]:
    """End a command, and its workers, with one line and no traceback for what its user can mend.

    That is a damaged or missing file, a full or closed disk, an interrupt or SIGTERM, and every `CommandError`. `what`
    names the work in front of messages that do not.
    """
    sigterm_as_interrupt()
    begin = f"error: {what}: " if what else "error: "
    try:
        yield
    except KeyboardInterrupt:
        sys.exit(f"{begin}interrupted. What is on disk stays: the same command goes on from there.")
    except CommandError as error:
        sys.exit(f"error: {error}")
    except (DamagedFile, MissingFile) as error:
        sys.exit(f"{begin}{error}")
    except OSError as error:
        sys.exit(f"{begin}{one_line(error)}")
