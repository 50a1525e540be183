"""Files on disk: atomic writes, and checksums that are compared before anything is parsed. Nothing here ever unpickles.

A sealed file bears its checksum in its first line. Files that are to stay as others know them, such as CSV, are listed
in the `MANIFEST.sha256` of their folder, which `sha256sum -c` reads too; `vsp.manifest` lists them anew.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import hashlib
import io
import json
import os
import re
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

ROOT = Path(__file__).resolve().parents[1]  # the checkout: data/ lies beside vsp/
MANIFEST = "MANIFEST.sha256"

_LINE = re.compile(rb"([0-9a-f]{64})  ([^/\n]+)\n")
_MADE_BY = {  # which target makes a file anew, by a part of its path; nothing makes data/paper
    "data/teachers/short/": "short-teachers",
    "data/teachers/": "teachers",
    "data/results/readings": "study",
    "data/results/teachers": "study",
    "data/results/lookup": "lookup",
    "data/results/trust": "bench torture",
    "data/results/kills": "torture",
    "data/results/scale": "bench",
    "data/results/beyond_LunarLander": "beyond-long",
    "data/results/beyond_seconds_long": "beyond-long",
    "data/results/beyond": "beyond",
    "data/results/": "paper-figures",
    "data/runs/": "runs",
    "build/beyond/": "beyond",
    "build/study/": "study",
}

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
        if error.errno:
            error.filename = error.filename or str(path)  # a full disk is told of without a name
        raise
    finally:
        temporary.unlink(missing_ok=True)


def sweep(path: str | os.PathLike) -> None:
    """Remove what `atomic_path` left beside `path` where it was killed; for whom no other writes it now."""
    path = Path(path)
    for left in path.parent.glob(f".{glob.escape(path.stem)}-????????{glob.escape(path.suffix)}"):
        left.unlink(missing_ok=True)


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
    import fcntl  # here, since Windows, where students read files, has none

    Path(lock).parent.mkdir(parents=True, exist_ok=True)
    with open(lock, "ab", buffering=0) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"another run {what}: waiting for it to end", file=sys.stderr, flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        with contextlib.suppress(OSError):  # a full disk shall stop what is done alone, with its own words
            file.truncate(0)
            file.write(b"%d" % os.getpid())  # for `end_others`
        yield


def end_others(locks: str | os.PathLike) -> None:
    """SIGTERM to the processes that hold locks in the folder `locks`, if they are of our process group.

    That is mostly those of the same make. One that has no lock yet goes on.
    """
    import fcntl

    for lock in Path(locks).iterdir():
        with contextlib.suppress(OSError, ValueError), open(lock, encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # who held it has ended, whatever is written there
            except BlockingIOError:
                holder = int(file.read())
                if holder != os.getpid() and os.getpgid(holder) == os.getpgrp():
                    os.kill(holder, signal.SIGTERM)


def heed_sigterm() -> None:
    """Let SIGTERM raise KeyboardInterrupt, which unwinds through whatever has kernels or workers to end."""
    signal.signal(signal.SIGTERM, _interrupt)


def _interrupt(signum: int, frame: object) -> None:
    raise KeyboardInterrupt


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write `text` to `path` atomically, as UTF-8 with Unix line ends on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def sha256(path: str | os.PathLike) -> str:
    """SHA-256 of the file at `path`, as 64 hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class DamagedFile(ValueError):
    """A file whose content does not match its checksum, or that is not of the expected kind."""


def _content(path: Path) -> bytes:
    """All bytes of a file. Raises FileNotFoundError, and `DamagedFile` for a folder or a device in its place."""
    if path.exists() and not path.is_file():
        raise DamagedFile(f"{path}: is a folder or a device, expected a file: move it away")
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        link = f", but a link to {os.readlink(path)}" if path.is_symlink() else ""
        raise FileNotFoundError(f"{path}: no such file{link}; {_remedy(path)}") from error


def _remedy(path: Path) -> str:
    """How a file that is missing or altered comes back."""
    place = path.absolute().as_posix()
    made = next((f"`make {target}` makes it anew, " for part, target in _MADE_BY.items() if part in place), "")
    return f"{made}`git checkout {path}` brings back a committed one"


# Sealed files


def write_sealed(path: str | os.PathLike, payload: bytes) -> None:
    """Write one line with the SHA-256 of `payload`, then `payload`, atomically."""
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        file.write(hashlib.sha256(payload).hexdigest().encode() + b"\n")
        file.write(payload)


def read_sealed(path: str | os.PathLike) -> bytes:
    """The payload of a file that `write_sealed` wrote. Raises FileNotFoundError or `DamagedFile`."""
    content = _content(Path(path))
    seal, payload = content[:64], content[65:]
    found = hashlib.sha256(payload).hexdigest()
    if content[64:65] != b"\n" or seal != found.encode():
        raise DamagedFile(
            f"{path}: SHA-256 is {found}, expected {seal.decode(errors='replace')}: delete it and remake it"
        )
    return payload


def save(path: str | os.PathLike, arrays: dict[str, np.ndarray], about: dict) -> None:
    """Write `arrays` and the JSON-able `about` to one sealed file, as safetensors."""
    from safetensors.numpy import save as to_bytes

    about_text = json.dumps(about, sort_keys=True, allow_nan=False)
    contiguous = {name: np.ascontiguousarray(a) for name, a in arrays.items()}
    write_sealed(path, to_bytes(contiguous, metadata={"about": about_text}))


def load(path: str | os.PathLike, *, kind: str) -> tuple[dict[str, np.ndarray], dict]:
    """Read a file that `save` wrote with `about["kind"] == kind`: its arrays and `about`.

    Raises FileNotFoundError or `DamagedFile`.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load as from_bytes

    payload = read_sealed(path)
    try:
        arrays = from_bytes(payload)
        header = json.loads(payload[8 : 8 + int.from_bytes(payload[:8], "little")])
        about = json.loads(header["__metadata__"]["about"])
        found = about.get("kind")
    except (SafetensorError, ValueError, KeyError, AttributeError) as error:
        raise DamagedFile(f"{path}: sealed, but not what `save` writes: {error!r:.300}: delete it") from error
    if found != kind:
        raise DamagedFile(f"{path}: holds a {found!r}, expected a {kind!r}")
    return arrays, about


# Listed files


def write_listed(path: str | os.PathLike, content: str | bytes) -> None:
    """Write `content` (a string as UTF-8), atomically, then the file's line in the manifest of its folder.

    Of several writers none loses another's line. Killed between the two, a writer leaves a file that readers refuse
    until it is written again.
    """
    path, content = Path(path), content.encode() if isinstance(content, str) else content
    with _held(path.parent):
        listed = _listed(path.parent)
        sweep(path)
        with atomic_path(path) as temporary:
            temporary.write_bytes(content)
        _write_manifest(path.parent, {**listed, path.name: hashlib.sha256(content).hexdigest()})


def list_file(path: str | os.PathLike) -> None:
    """Put the file at `path`, as it is, into the manifest of its folder."""
    path = Path(path)
    with _held(path.parent):
        _write_manifest(path.parent, {**_listed(path.parent), path.name: sha256(path)})


def list_folder(folder: str | os.PathLike) -> None:
    """Write the manifest of `folder` anew: all that lies there, as it is, but hidden files."""
    folder = Path(folder)
    with _held(folder):
        names = (path.name for path in folder.iterdir() if path.is_file())
        _write_manifest(folder, {n: sha256(folder / n) for n in names if n != MANIFEST and not n.startswith(".")})


def read_listed(path: str | os.PathLike) -> bytes:
    """The content of a file that the manifest of its folder lists. Raises FileNotFoundError or `DamagedFile`."""
    path = Path(path)
    content = _content(path)
    found, expected = hashlib.sha256(content).hexdigest(), _listed(path.parent).get(path.name)
    if found != expected:
        raise DamagedFile(
            f"{path}: SHA-256 is {found}, {MANIFEST} beside it has {expected or 'no such file'}: {_remedy(path)}; if "
            f"it is as it should be, `make manifest` (or `python -m vsp.manifest {path.parent}`) lists it so"
        )
    return content


def read_table(path: str | os.PathLike, **options) -> pd.DataFrame:
    """The table in a listed CSV file, `options` as `pandas.read_csv` has them. Raises as `read_listed` does."""
    import pandas as pd

    return pd.read_csv(io.BytesIO(read_listed(path)), **options)


def _listed(folder: Path) -> dict[str, str]:
    """The SHA-256 of every file that the manifest of `folder` lists; none if there is no manifest."""
    manifest = folder / MANIFEST
    content = _content(manifest) if os.path.lexists(manifest) else b""
    lines = _LINE.findall(content)
    listed = {name.decode(errors="replace"): digest.decode() for digest, name in lines}
    if _LINE.sub(b"", content) or len(listed) < len(lines):
        raise DamagedFile(
            f"{manifest}: expected lines of 64 hexadecimal digits, two spaces and a file's name, each name once: "
            f"`git checkout {manifest}` brings it back, `make manifest` writes it anew"
        )
    return listed


def _write_manifest(folder: Path, listed: dict[str, str]) -> None:
    text = "".join(f"{digest}  {name}\n" for name, digest in sorted(listed.items()))
    if _content(folder / MANIFEST) != text.encode():
        write_text(folder / MANIFEST, text)


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold the manifest of `folder`, which is made if need be, against other writers."""
    import fcntl

    folder.mkdir(parents=True, exist_ok=True)
    manifest, held = folder / MANIFEST, False
    while not held:
        with open(manifest, "ab") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            held = manifest.exists() and os.path.samestat(os.fstat(file.fileno()), manifest.stat())
            if held:  # else another writer put a new one in its place while we waited
                sweep(manifest)
                yield


# Weights and their card


def write_carded(path: str | os.PathLike, content: bytes, card: dict) -> None:
    """Write `content` and, beside it as `.json`, its card with the SHA-256 added; both listed. The card comes last."""
    card = {**card, "sha256": hashlib.sha256(content).hexdigest()}
    text = json.dumps(card, indent=2, allow_nan=False) + "\n"
    write_listed(path, content)
    write_listed(Path(path).with_suffix(".json"), text)


def read_carded(path: str | os.PathLike) -> tuple[bytes, dict]:
    """A file that `write_carded` wrote and its card. Raises FileNotFoundError or `DamagedFile`.

    Where the folder has no manifest, as somebody's own may, the file is compared with its card alone.
    """
    path, card_path = Path(path), Path(path).with_suffix(".json")
    for part in (path, card_path):
        if not part.exists():
            raise FileNotFoundError(f"{part}: no such file, expected the weights and their card (.json) side by side")
    read = read_listed if os.path.lexists(path.parent / MANIFEST) else _content
    content, text = read(path), read(card_path)
    try:
        card = json.loads(text)
        expected = card["sha256"]
    except (ValueError, KeyError, TypeError) as error:
        raise DamagedFile(f"{card_path}: not a card with a sha256: {error}") from error
    found = hashlib.sha256(content).hexdigest()
    if found != expected:
        raise DamagedFile(f"{path}: SHA-256 is {found}, its card says {expected}: fetch the file again")
    return content, card
