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

from .atomic import DamagedFile, atomic_path, read_bytes, remedy, sha256, write_text

if TYPE_CHECKING:
    import pandas as pd

MANIFEST = "MANIFEST.sha256"


def write_listed(path: str | os.PathLike, content: str | bytes) -> None:
    """Write `content` (a string as UTF-8) atomically, then the file's line in the manifest of its folder.

    Concurrent writers keep each other's lines. If a writer is killed between the two steps, readers refuse the file
    until it is written again.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
    list_file(path)


def list_file(path: str | os.PathLike) -> None:
    """Add the file at `path`, as it is, to the manifest of its folder."""
    path = Path(path)
    with _locked(path.parent):
        _write_manifest(path.parent, {**_listed(path.parent), path.name: sha256(path)})


def list_folder(folder: str | os.PathLike) -> int:
    """Write a new manifest of `folder` with all its files, as they are, except hidden ones. Returns their number."""
    folder = Path(folder)
    paths = [path for path in folder.iterdir() if path.is_file() and path.name != MANIFEST]
    listed = {path.name: sha256(path) for path in paths if not path.name.startswith(".")}
    _write_manifest(folder, listed)
    return len(listed)


def read_listed(path: str | os.PathLike) -> bytes:
    """Return the content of a file that the manifest of its folder lists. Raises `MissingFile` or `DamagedFile`."""
    path = Path(path)
    content = read_bytes(path)
    digest, expected = hashlib.sha256(content).hexdigest(), _listed(path.parent).get(path.name)
    if digest != expected:
        restore, accept = remedy(path), f"`python -m vsp.run.manifest {shlex.quote(str(path.parent))}` accepts it"
        remedies = "; ".join(filter(None, (restore, f"if the file is correct, {accept}")))
        raise DamagedFile(f"{path}: SHA-256 is {digest}, {MANIFEST} lists {expected or 'no such file'}: {remedies}")
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
    """Return a file that `write_carded` wrote, and its card, which has its checksum. Raises as `read_listed` does.

    The card is listed, except in a folder without a manifest, as somebody who copied the two files has it.
    """
    path, card_path = Path(path), Path(path).with_suffix(".json")
    content = read_bytes(path)
    text = (read_listed if (path.parent / MANIFEST).exists() else read_bytes)(card_path)
    digest = hashlib.sha256(content).hexdigest()
    try:
        card = json.loads(text)
        expected = card["sha256"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DamagedFile(f"{card_path}: not a card with a sha256: {error!r:.300}") from error
    if digest != expected:
        raise DamagedFile(f"{path}: SHA-256 is {digest}, its card says {expected}: get both files again")
    return content, card


def _listed(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in the manifest of `folder`; an empty dictionary if there is no manifest."""
    manifest = folder / MANIFEST
    text = read_bytes(manifest).decode(errors="replace") if os.path.lexists(manifest) else ""
    lines = [re.fullmatch(r"([0-9a-f]{64})  ([^/]+)", line) for line in text.removesuffix("\n").split("\n") if text]
    listed = {line[2]: line[1] for line in lines if line}
    if len(listed) < len(lines) or text[-1:] not in ("", "\n"):
        raise DamagedFile(f"{manifest}: expected `sha256sum`'s lines, each name once. {remedy(manifest)}")
    return listed


def _write_manifest(folder: Path, listed: dict[str, str]) -> None:
    write_text(folder / MANIFEST, "".join(f"{digest}  {name}\n" for name, digest in sorted(listed.items())))


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock `folder` against others that write its manifest."""
    import fcntl

    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
