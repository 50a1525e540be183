"""Sealed files: the first line is the checksum of the rest, which is verified before anything is parsed."""

from __future__ import annotations

import hashlib
import json
import os

import numpy as np

from .atomic import DamagedFile, atomic_path, read_bytes, remedies


def write_sealed(path: str | os.PathLike, payload: bytes) -> None:
    """Write one line with the SHA-256 of `payload`, then `payload`, atomically."""
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        file.write(hashlib.sha256(payload).hexdigest().encode() + b"\n")
        file.write(payload)


def read_sealed(path: str | os.PathLike) -> bytes:
    """Return the payload of a file that `write_sealed` wrote. Raises `MissingFile` or `DamagedFile`."""
    content = read_bytes(path)
    seal, payload = content[:65], content[65:]
    found = hashlib.sha256(payload).hexdigest()
    if seal != found.encode() + b"\n":
        raise DamagedFile(
            f"{path}: damaged, or no file of vsp (its SHA-256 is {found}, its first line says {seal!r}): "
            + remedies(path, "delete it if `make` makes it, else save it again")
        )
    return payload


def save_arrays(path: str | os.PathLike, arrays: dict[str, np.ndarray], about: dict) -> None:
    """Write `arrays` and the JSON-serialisable `about` to one sealed file, as safetensors."""
    from safetensors.numpy import save

    about_text = json.dumps(about, sort_keys=True, allow_nan=False)
    contiguous = {name: np.ascontiguousarray(a) for name, a in arrays.items()}
    write_sealed(path, save(contiguous, metadata={"about": about_text}))


def load_arrays(path: str | os.PathLike, *, kind: str) -> tuple[dict[str, np.ndarray], dict]:
    """Read a file that `save_arrays` wrote with `about["kind"] == kind`: its arrays and `about`.

    Raises `MissingFile` or `DamagedFile`.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    payload = read_sealed(path)
    try:
        arrays = load(payload)
        header = json.loads(payload[8 : 8 + int.from_bytes(payload[:8], "little")])
        about = json.loads(header["__metadata__"]["about"])
        found = about.get("kind")
    except (SafetensorError, ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
        raise DamagedFile(
            f"{path}: right checksum, but `save_arrays` did not write it: {error!r:.300}: {remedies(path, 'delete it')}"
        ) from error
    if found != kind:
        raise DamagedFile(
            f"{path}: holds a {found!r}, expected a {kind!r}: {remedies(path, 'delete it or name another')}"
        )
    return arrays, about
