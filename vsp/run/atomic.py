"""Atomic writes, reads of regular files only, and one-line messages for disk errors."""

from __future__ import annotations

import contextlib
import errno
import glob
import hashlib
import os
import secrets
import shlex
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parents[2]  # the checkout, or where vsp is installed
TEMPORARY = ".?*-????????.*"  # names of the temporary files of `atomic_path`

_NO_ROOM = "free some space, make it writable or raise `ulimit -f`, or name another folder: OUT=folder"
_OCCUPIED = "something else has this name: move it away"
_HINTS = dict.fromkeys(
    (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM), _NO_ROOM
) | dict.fromkeys((errno.EEXIST, errno.EISDIR, errno.ENOTDIR), _OCCUPIED)


class DamagedFile(ValueError):
    """A file whose content does not match its checksum, or that is not of the expected kind."""


class MissingFile(FileNotFoundError):
    """A file of this project that does not exist; the message names it and says how to restore it."""


def data_folder(name: str) -> Path:
    """Return the folder data/`name` of the checkout, or its copy in an installed vsp, which has teachers and paper."""
    installed = ROOT / "vsp" / "data" / name
    return installed if installed.is_dir() else ROOT / "data" / name


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it replaces `path` only if the block succeeds.

    A reader (or a run after a crash) sees the old file or the complete new one, never a partial one.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}{path.suffix}")
    temporary.touch(exist_ok=False)  # with the permissions that the umask allows
    try:
        yield temporary
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())  # the rename must not reach the disk before the content
        os.replace(temporary, path)
    except OSError as error:
        if error.errno:
            error.filename = error.filename or str(path)  # the system does not name the file when a disk is full
        raise
    finally:
        temporary.unlink(missing_ok=True)


def remove_leftovers(path: str | os.PathLike) -> None:
    """Remove temporary files that killed writers of `path` left. Call only while no other process writes `path`."""
    path = Path(path)
    for left in path.parent.glob(f".{glob.escape(path.stem)}-????????{glob.escape(path.suffix)}"):
        left.unlink(missing_ok=True)


def disk_hint(number: int | None) -> str | None:
    """Return a hint for a system error of this number if a user can fix it: no space, no access, name in use."""
    return _HINTS.get(number)


def one_line(error: OSError) -> str:
    """Return the file, the system's message and a hint in one line. Raises an error without a hint again."""
    if not (hint := disk_hint(error.errno)):
        raise error
    return f"{error.filename2 or error.filename or 'a file'}: {error.strerror}: {hint}"


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write `text` to `path` atomically, as UTF-8 with Unix line endings on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def open_regular(path: str | os.PathLike, mode: str = "rb", **options) -> IO:
    """`open` for regular files. Raises `DamagedFile` for a folder, a FIFO or a device, and does not wait for it."""
    try:
        file = open(path, mode, opener=_open_at_once, **options)
    except OSError as error:
        if os.path.exists(path) and not os.path.isfile(path):
            raise DamagedFile(_not_regular(path)) from error
        raise
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise DamagedFile(_not_regular(path))
    return file


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)  # Windows has no FIFOs to wait for


def _not_regular(path: str | os.PathLike) -> str:
    return f"{path}: is a folder, a FIFO or a device, expected a file: move it away"


def sha256(path: str | os.PathLike) -> str:
    """Return the SHA-256 of the file at `path`, as 64 hexadecimal digits."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_bytes(path: str | os.PathLike) -> bytes:
    """Return all bytes of a regular file. Raises `MissingFile` and `DamagedFile`."""
    try:
        with open_regular(path) as file:
            return file.read()
    except FileNotFoundError as error:
        link = f", but a link to {os.readlink(path)}" if os.path.islink(path) else ""
        raise MissingFile(": ".join(filter(None, (f"{path}: no such file{link}", remedies(path))))) from error


def remedy(path: str | os.PathLike) -> str:
    """Say how to restore a missing or damaged file that is committed."""
    if not (ROOT / "environment.lock").exists():
        return "it lies in the checkout only: `git clone ADDRESS vsp`"
    return f"`git checkout {shlex.quote(str(path))}` restores a committed file"


def remedies(path: str | os.PathLike, *others: str) -> str:
    """Say how to restore a file that may be anybody's: by `others`, and by git if it lies in this checkout."""
    return "; ".join([*others, *([remedy(path)] if Path(path).resolve().is_relative_to(ROOT) else [])])
