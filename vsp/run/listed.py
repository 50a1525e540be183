"""Listed files: files in their own formats, such as CSV, whose checksums stand in `MANIFEST.sha256` of their folder.

`sha256sum -c` reads the manifests too; `python -m vsp.run.manifest` accepts files as they are.
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
    """Write `content` (a string as UTF-8), atomically, then the file's line in the manifest of its folder.

    Of several writers none loses another's line. A writer that is killed between the two leaves a file that readers
    refuse until it is written again.
    """
    path, content = Path(path), content.encode() if isinstance(content, str) else content
    with _locked(path.parent):
        listed = _listed(path.parent)
        remove_leftovers(path)
        with atomic_path(path) as temporary:
            temporary.write_bytes(content)
        _write_manifest(path.parent, {**listed, path.name: hashlib.sha256(content).hexdigest()})


def list_file(path: str | os.PathLike) -> None:
    """Put the file at `path`, as it is, into the manifest of its folder."""
    path = Path(path)
    with _locked(path.parent):
        _write_manifest(path.parent, {**_listed(path.parent), path.name: sha256(path)})


def list_folder(folder: str | os.PathLike) -> int:
    """Write the manifest of `folder` anew, with every file there but hidden ones, as it is; returns their number."""
    folder = Path(folder)
    with _locked(folder):
        names = [path.name for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")]
        _write_manifest(folder, {name: sha256(folder / name) for name in names if name != MANIFEST})
    return len(names) - 1


def read_listed(path: str | os.PathLike) -> bytes:
    """The content of a file that the manifest of its folder lists. Raises `MissingFile` or `DamagedFile`."""
    path = Path(path)
    content = read_bytes(path)
    found, expected = hashlib.sha256(content).hexdigest(), _listed(path.parent).get(path.name)
    if found != expected:
        raise DamagedFile(
            f"{path}: SHA-256 is {found}, {MANIFEST} beside it has {expected or 'no such file'}: {remedy(path)}; if "
            f"it is as it should be, `python -m vsp.run.manifest {shlex.quote(str(path.parent))}` accepts it"
        )
    return content


def read_table(path: str | os.PathLike, **options) -> pd.DataFrame:
    """The table in a listed CSV file, `options` as `pandas.read_csv` has them. Raises as `read_listed` does."""
    import pandas as pd

    return pd.read_csv(io.BytesIO(read_listed(path)), **options)


def write_carded(path: str | os.PathLike, content: bytes, card: dict) -> None:
    """Write `content` and, beside it as `.json`, its card with the SHA-256 added; both listed. The card comes last."""
    text = json.dumps({**card, "sha256": hashlib.sha256(content).hexdigest()}, indent=2, allow_nan=False) + "\n"
    write_listed(path, content)
    write_listed(Path(path).with_suffix(".json"), text)


def read_carded(path: str | os.PathLike) -> tuple[bytes, dict]:
    """A file that `write_carded` wrote and its card. Raises `MissingFile` or `DamagedFile`.

    Both are compared with the manifest of their folder; where it has none, as a reader's own folder may, the file is
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
        raise DamagedFile(f"{path}: SHA-256 is {found}, its card says {expected}: fetch the file again")
    return content, card


def _listed(folder: Path) -> dict[str, str]:
    """The SHA-256 of every file that the manifest of `folder` lists; none if there is no manifest."""
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
    """Hold the manifest of `folder`, which is made if need be, against other writers."""
    import fcntl

    folder.mkdir(parents=True, exist_ok=True)
    manifest, held = folder / MANIFEST, False
    while not held:
        with open_regular(manifest, "ab") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            held = manifest.exists() and os.path.samestat(os.fstat(file.fileno()), manifest.stat())
            if held:  # else another writer put a new one in its place while we waited
                remove_leftovers(manifest)
                yield
