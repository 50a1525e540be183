"""Files on disk: atomic writes, checksums. Nothing here ever unpickles."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]  # the checkout: data/ lies beside vsp/
TEMPORARY = ".?*-????????.*"  # what `atomic_path` leaves behind when it is killed
_ROOM, _LEAVE = "free some space", "make it writable"
_FIXES = {
    errno.ENOSPC: _ROOM,
    errno.EDQUOT: _ROOM,
    errno.EFBIG: "raise the limit on the size of files, `ulimit -f unlimited`",
    errno.EROFS: _LEAVE,
    errno.EACCES: _LEAVE,
    errno.EPERM: _LEAVE,
}


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it takes the place of `path` only if the block succeeds.

    A reader (or a run after a crash) sees the old file or the whole new one, never a torn one.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())  # the rename must not reach the disk before the content
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        error.filename = error.filename or str(path)  # a full disk is told of without a name
        raise
    finally:
        temporary.unlink(missing_ok=True)


def fix(number: int | None) -> str | None:
    """What to do about a system's error of this number, if it is one of disks that are full or closed."""
    return f"{_FIXES[number]}, or name another folder: `make OUT=folder`" if number in _FIXES else None


def reason(error: OSError) -> str:
    """The file, what the system said of it, and what to do, in one line. An error without a fix is raised again."""
    if not (remedy := fix(error.errno)):
        raise error
    return f"{error.filename2 or error.filename or 'a file'}: {error.strerror}: {remedy}"


@contextlib.contextmanager
def alone(lock: str | os.PathLike, what: str) -> Iterator[None]:
    """Hold `lock`, or wait and say that another process does `what`; the system frees it however this process ends."""
    Path(lock).parent.mkdir(parents=True, exist_ok=True)
    with open(lock, "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"another run {what}: waiting for it to end", file=sys.stderr, flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write `text` to `path` atomically, as UTF-8 with Unix line ends on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: str | os.PathLike, value: object) -> None:
    """Write `value` as indented JSON, atomically. NaN and infinity are refused: JSON has neither."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


def sha256(path: str | os.PathLike) -> str:
    """SHA-256 of the file at `path`, as 64 hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class DamagedFile(ValueError):
    """A file whose content does not match its checksum, or that is not of the expected kind."""


def save(path: str | os.PathLike, arrays: dict[str, np.ndarray], about: dict) -> None:
    """Write `arrays` and the JSON-able `about` to one sealed file, atomically.

    A sealed file is one line with the SHA-256 of the rest, then the rest: the arrays as safetensors.
    """
    from safetensors.numpy import save as to_bytes

    about_text = json.dumps(about, sort_keys=True, allow_nan=False)
    payload = to_bytes({name: np.ascontiguousarray(a) for name, a in arrays.items()}, metadata={"about": about_text})
    with atomic_path(path) as temporary:
        temporary.write_bytes(hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload)


def load(path: str | os.PathLike, *, kind: str) -> tuple[dict[str, np.ndarray], dict]:
    """Read a file that `save` wrote with `about["kind"] == kind`: its arrays and `about`.

    The checksum is compared before anything is parsed. Raises FileNotFoundError or `DamagedFile`.
    """
    from safetensors.numpy import load as from_bytes

    content = Path(path).read_bytes()
    seal, payload = content[:64], content[65:]
    found = hashlib.sha256(payload).hexdigest()
    if content[64:65] != b"\n" or seal != found.encode():
        raise DamagedFile(
            f"{path}: SHA-256 is {found}, expected {seal.decode(errors='replace')}: delete it and remake it"
        )
    header = json.loads(payload[8 : 8 + int.from_bytes(payload[:8], "little")])
    about = json.loads(header["__metadata__"]["about"])
    if about.get("kind") != kind:
        raise DamagedFile(f"{path}: holds a {about.get('kind')!r}, expected a {kind!r}")
    return from_bytes(payload), about


def write_carded(path: str | os.PathLike, content: bytes, card: dict) -> None:
    """Write `content` and, beside it as `.json`, its card with the SHA-256 added. The card comes last."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
    write_json(Path(path).with_suffix(".json"), {**card, "sha256": hashlib.sha256(content).hexdigest()})


def read_carded(path: str | os.PathLike) -> tuple[bytes, dict]:
    """A file that `write_carded` wrote and its card, the checksum compared. Raises as `load` does."""
    path = Path(path)
    for part in (path, path.with_suffix(".json")):
        if not part.exists():
            raise FileNotFoundError(f"{part}: no such file, expected the weights and their card (.json) side by side")
    content = path.read_bytes()
    try:
        card = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        expected = card["sha256"]
    except (ValueError, KeyError, TypeError) as error:
        raise DamagedFile(f"{path.with_suffix('.json')}: not a card with a sha256: {error}") from error
    found = hashlib.sha256(content).hexdigest()
    if found != expected:
        raise DamagedFile(f"{path}: SHA-256 is {found}, its card says {expected}: fetch the file again")
    return content, card
