"""Listed files: files in common formats, such as CSV, whose checksums are in `MANIFEST.sha256` of their folder.

`sha256sum -c` can check the manifests. `python -m vsp.run.manifest` writes them again for the files as they are.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from .atomic import (
    DamagedFile,
    MissingFile,
    atomic_path,
    open_regular,
    read_bytes,
    remedy,
    remove_leftovers,
    sha256,
    write_text,
)

if TYPE_CHECKING:
    import pandas as pd

MANIFEST = "MANIFEST.sha256"

_LINE = re.compile(rb"([0-9a-f]{64})  ([^/\n]+)\n")


def write_listed(path: str | os.PathLike, content: str | bytes) -> None:
    """Write `content` (a string as UTF-8) atomically, then the file's line in the manifest of its folder.

    Concurrent writers keep each other's lines. If a writer is killed between the two steps, readers refuse the file
    until it is written again.
    """
    path, content = Path(path), content.encode() if isinstance(content, str) else content
    with _locked(path.parent):
        listed = _listed(path.parent)
        remove_leftovers(path)
        with atomic_path(path) as temporary:
            temporary.write_bytes(content)
        _write_manifest(path.parent, {**listed, path.name: hashlib.sha256(content).hexdigest()})


def list_file(path: str | os.PathLike) -> None:
    """Add the file at `path`, as it is, to the manifest of its folder."""
    path = Path(path)
    with _locked(path.parent):
        _write_manifest(path.parent, {**_listed(path.parent), path.name: sha256(path)})


def list_folder(folder: str | os.PathLike) -> int:
    """Write a new manifest of `folder` with all its files, as they are, except hidden ones. Returns their number."""
    folder = Path(folder)
    with _locked(folder):
        names = [path.name for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")]
        _write_manifest(folder, {name: sha256(folder / name) for name in names if name != MANIFEST})
    return len(names) - 1


def read_listed(path: str | os.PathLike) -> bytes:
    """Return the content of a file that the manifest of its folder lists. Raises `MissingFile` or `DamagedFile`."""
    path = Path(path)
    content = read_bytes(path)
    found, expected = hashlib.sha256(content).hexdigest(), _listed(path.parent).get(path.name)
    if found != expected:
        raise DamagedFile(
            f"{path}: SHA-256 is {found}, {MANIFEST} beside it has {expected or 'no such file'}: {remedy(path)}; if "
            f"the file is correct, `python -m vsp.run.manifest {shlex.quote(str(path.parent))}` accepts it"
        )
    return content


def read_table(path: str | os.PathLike, **options) -> pd.DataFrame:
    """Return the table in a listed CSV file; `options` are those of `pandas.read_csv`. Raises as `read_listed` does."""
    import pandas as pd

    return pd.read_csv(io.BytesIO(read_listed(path)), **options)


def write_carded(path: str | os.PathLike, content: bytes, card: dict) -> None:
    """Write `content`, then beside it its card as `.json`, with the SHA-256 added. Both files are listed."""
    text = json.dumps({**card, "sha256": hashlib.sha256(content).hexdigest()}, indent=2, allow_nan=False) + "\n"
    write_listed(path, content)
    write_listed(Path(path).with_suffix(".json"), text)


def read_carded(path: str | os.PathLike) -> tuple[bytes, dict]:
    """Return a file that `write_carded` wrote, and its card. Raises `MissingFile` or `DamagedFile`.

    Both are compared with the manifest of their folder. Without a manifest, as in a user's own folder, the file is
    compared with the checksum on its card.
    """
    path, card_path = Path(path), Path(path).with_suffix(".json")
    for part in (path, card_path):
        if not part.exists():
            raise MissingFile(f"{part}: no such file, expected weights and their card (.json) side by side")
    listed = os.path.lexists(path.parent / MANIFEST)
    content, text = ((read_listed if listed else read_bytes)(part) for part in (path, card_path))
    try:
        card = json.loads(text)
        expected = card["sha256"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DamagedFile(f"{card_path}: not a card with a sha256: {error!r:.300}") from error
    if not listed and (found := hashlib.sha256(content).hexdigest()) != expected:
        raise DamagedFile(f"{path}: SHA-256 is {found}, its card says {expected}: get the file again")
    return content, card


def _listed(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in the manifest of `folder`; an empty dictionary if there is no manifest."""
    manifest = folder / MANIFEST
    content = read_bytes(manifest) if os.path.lexists(manifest) else b""
    lines = _LINE.findall(content)
    listed = {name.decode(errors="replace"): digest.decode() for digest, name in lines}
    if _LINE.sub(b"", content) or len(listed) < len(lines):
        raise DamagedFile(
            f"{manifest}: expected lines of 64 hexadecimal digits, two spaces and a file's name, each name once: "
            f"{remedy(manifest)}"
        )
    return listed


def _write_manifest(folder: Path, listed: dict[str, str]) -> None:
    text = "".join(f"{digest}  {name}\n" for name, digest in sorted(listed.items()))
    if read_bytes(folder / MANIFEST) != text.encode():
        write_text(folder / MANIFEST, text)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock the manifest of `folder` against other writers. Creates it if it does not exist."""
    import fcntl

    folder.mkdir(parents=True, exist_ok=True)
    manifest, held = folder / MANIFEST, False
    while not held:
        with open_regular(manifest, "ab") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            held = manifest.exists() and os.path.samestat(os.fstat(file.fileno()), manifest.stat())
            if held:  # else another writer replaced it while we waited
                remove_leftovers(manifest)
                yield
