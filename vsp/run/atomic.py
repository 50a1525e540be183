"""Whole files: written completely or not at all, and read only where they are regular files."""

import hashlib
import math
import os
import secrets
import shlex
from pathlib import Path

_NO_FILE = "is a folder, a FIFO or a device, expected a file: move it away"
ROOT = Path(__file__).resolve().parents[2]  # the checkout, or where vsp is installed


class DamagedFile(ValueError):
    """A file whose content does not match its checksum, or that is not of the expected kind."""


class MissingFile(FileNotFoundError):
    """A file of this project that does not exist; the message names it and says how to restore it."""


def data_folder(name: str) -> Path:
    """Return the folder data/`name` of the checkout, or its copy in an installed vsp, which has teachers and paper."""
    installed = ROOT / "vsp" / "data" / name
    return installed if installed.is_dir() else ROOT / "data" / name


def begin(path: Path) -> Path:
    """Begin to write to `path`: return a new, empty file beside it. Raises `DamagedFile` if `path` is there and no
    regular file, and OSError where nothing can be written."""
    if path.exists() and not path.is_file():
        raise DamagedFile(f"{path}: {_NO_FILE}")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}{path.suffix}")
    temporary.touch(exist_ok=False)
    return temporary


def write_bytes(path: str | os.PathLike, content: bytes) -> None:
    """Write `content` to `path` atomically, by way of a temporary file beside it. A reader (or a run after a crash)
    sees the old file or the complete new one, never a partial one."""
    path = Path(path)
    temporary = begin(path)
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())  # the rename must not reach the disk before the content
        os.replace(temporary, path)
    except OSError as error:
        error.filename = error.filename or str(path)  # the system does not name the file when a disk is full
        raise
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write `text` to `path` atomically, as UTF-8 with the line endings that it has."""
    write_bytes(path, text.encode())


def read_bytes(path: str | os.PathLike, most: float = math.inf) -> bytes:
    """Return all bytes of a regular file. Raises `MissingFile`, and `DamagedFile` for a folder, a FIFO or a device, and
    for a file of more than `most` bytes."""
    path = Path(path)
    if path.is_file():
        if (size := path.stat().st_size) > most:
            raise DamagedFile(f"{path}: it has {size} bytes, expected at most {most}")
        return path.read_bytes()
    if path.exists():
        raise DamagedFile(f"{path}: {_NO_FILE}")
    raise MissingFile(fault(path, "no such file"))


def sha256(path: str | os.PathLike) -> str:
    """Return the SHA-256 of the file at `path`, as 64 hexadecimal digits."""
    return hashlib.sha256(read_bytes(path)).hexdigest()


def fault(path: str | os.PathLike, what: str, *remedies: str) -> str:
    """Say in one line what is wrong with the file at `path` and the remedies; git restores a file of the checkout."""
    if Path(os.path.realpath(path)).is_relative_to(ROOT):
        restore = f"`git checkout {shlex.quote(str(path))}` restores a committed file"
        fetch = "it lies in the checkout only: `git clone ADDRESS vsp`"
        remedies += (restore if (ROOT / "environment.lock").exists() else fetch,)
    return f"{path}: {what}" + (f": {'; '.join(remedies)}" if remedies else "")
