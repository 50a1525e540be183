"""Listed files: files in common formats, such as CSV, whose checksums are in `MANIFEST.sha256` of their folder.

`sha256sum -c` can check the manifests. `python -m vsp.run.manifest` writes them again for the files as they are.
"""

import hashlib
import os
import shlex
from pathlib import Path

from .atomic import DamagedFile, fault, read_bytes, sha256, write_bytes, write_text

MANIFEST = "MANIFEST.sha256"


def write_listed(path: str | os.PathLike, content: str | bytes) -> None:
    """Write `content` (a string as UTF-8) atomically, then the file's line in the manifest of its folder. Concurrent
    writers keep each other's lines. If a writer is killed between the two steps, readers refuse the file until it is
    written again."""
    write_bytes(path, content.encode() if isinstance(content, str) else content)
    list_file(path)


def list_file(path: str | os.PathLike) -> None:
    """Add the file at `path`, as it is, to the manifest of its folder."""
    from .locks import folder_lock  # here: who reads needs no lock

    path = Path(path)
    with folder_lock(path.parent):
        _write_manifest(path.parent, {**_listed(path.parent), path.name: sha256(path)})


def list_folder(folder: str | os.PathLike) -> int:
    """Write a new manifest of `folder` with all its files, as they are, except hidden ones. Returns their number."""
    folder = Path(folder)
    paths = [path for path in folder.glob("[!.]*") if path.is_file() and path.name != MANIFEST]
    listed = {path.name: sha256(path) for path in paths}
    _write_manifest(folder, listed)
    return len(listed)


def read_listed(path: str | os.PathLike) -> bytes:
    """Return the content of a file that the manifest of its folder lists. Raises `MissingFile` or `DamagedFile`."""
    path = Path(path)
    content = read_bytes(path)
    digest, expected = hashlib.sha256(content).hexdigest(), _listed(path.parent).get(path.name, "no such file")
    if digest != expected:
        accept = f"if the file is correct, `python -m vsp.run.manifest {shlex.quote(str(path.parent))}` accepts it"
        raise DamagedFile(fault(path, f"SHA-256 is {digest}, {MANIFEST} lists {expected}", accept))
    return content


def _listed(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in the manifest of `folder`; an empty dictionary if there is no manifest. A
    damaged line lists no file that exists, and neither does a last line that was cut."""
    manifest = folder / MANIFEST
    text = read_bytes(manifest).decode(errors="replace") if os.path.lexists(manifest) else ""
    return {name: digest for digest, _, name in (line.partition("  ") for line in text.split("\n")[:-1])}


def _write_manifest(folder: Path, listed: dict[str, str]) -> None:
    write_text(folder / MANIFEST, "".join(f"{digest}  {name}\n" for name, digest in sorted(listed.items())))
