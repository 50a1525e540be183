"""Shared parts of commands: the value of --jobs, and errors in one line."""

import argparse
import contextlib
import errno
import re
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from .atomic import DamagedFile, MissingFile

# Errors of a disk: no space, no access, name in use
_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM}
_DISK |= {errno.EEXIST, errno.EISDIR, errno.ENOTDIR, errno.ENAMETOOLONG}


class CommandError(RuntimeError):
    """An error whose message is enough for the user of a command or of a notebook, without a traceback."""

    def _render_traceback_(self) -> list[str]:  # what IPython shows
        return [f"error: {self}"]


def check_parameter(name: str, value: object, possible: Sequence) -> None:
    """Raise CommandError unless the parameter of a notebook is among the possible values, such as a range."""
    if isinstance(value, bool | float) or value not in possible:
        whole = f"a whole number from {possible[0]} to {possible[-1]}" if isinstance(possible, range) else ""
        raise CommandError(f"{name} is {value!r}, expected {whole or ', '.join(map(repr, possible))}")


def jobs(text: str) -> int | str:
    """Parse the value of --jobs: a number of processes, or an address, which is returned as it is."""
    if re.fullmatch(r"-1|0*[1-9][0-9]{0,5}", text):
        return int(text)
    if re.fullmatch(r"[a-z]+://.+:[0-9]+", text):
        return text
    raise argparse.ArgumentTypeError(
        f"{text!r}: expected a whole number from 1 on, -1 for one per core, or an address as in tcp://host:8786"
    )


def parser(about: str | None, out: str) -> argparse.ArgumentParser:
    """Return the parser of a command that makes results with the options --out, where `out` says what goes, and
    --jobs."""
    made = argparse.ArgumentParser(description=about)
    made.add_argument("--out", type=Path, default=Path(), help=out)
    how_many = "worker processes, -1 for one per core, or the address of a Dask scheduler"
    made.add_argument("--jobs", type=jobs, default=-1, help=how_many)
    return made


@contextlib.contextmanager
def in_one_line(what: str = "") -> Iterator[None]:
    """End a command and its workers with a one-line message, without traceback, for errors that its user can fix. These
    are a damaged or missing file, a full or read-only disk, an interrupt or SIGTERM, and every `CommandError`. `what`
    names the work, and precedes messages that do not name it."""
    begin = f"error: {what}: " if what else "error: "
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # all code that started kernels or workers then ends them
    try:
        yield
    except KeyboardInterrupt:
        sys.exit(f"{begin}interrupted. Finished files stay on disk: run the same command to resume.")
    except (CommandError, DamagedFile, MissingFile) as error:
        sys.exit(f"error: {error}")
    except OSError as error:
        if error.errno not in _DISK:
            raise
        sys.exit(f"{begin}{error}: free some space, make it writable, or name another folder: OUT=folder")
