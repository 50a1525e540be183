"""Sealed files: the first line is the checksum of the rest, which is verified before anything is parsed."""

import hashlib
import json
import os

import numpy as np

from .atomic import DamagedFile, fault, read_bytes, write_bytes

_REMEDY = "delete it if `make` makes it, else save it again"


def write_sealed(path: str | os.PathLike, payload: bytes) -> None:
    """Write one line with the SHA-256 of `payload`, then `payload`, atomically."""
    write_bytes(path, hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload)


def read_sealed(path: str | os.PathLike) -> bytes:
    """Return the payload of a file that `write_sealed` wrote. Raises `MissingFile` or `DamagedFile`."""
    content = read_bytes(path)
    seal, payload = content[:65], content[65:]
    digest = hashlib.sha256(payload).hexdigest()
    if seal != digest.encode() + b"\n":
        what = f"damaged, or no file of vsp (its SHA-256 is {digest}, its first line says {seal!r})"
        raise DamagedFile(fault(path, what, _REMEDY))
    return payload


def save_arrays(path: str | os.PathLike, arrays: dict[str, np.ndarray], about: dict) -> None:
    """Write `arrays` and the JSON-serialisable `about` to one sealed file, as safetensors."""
    from safetensors.numpy import save

    about_text = json.dumps(about, sort_keys=True, allow_nan=False)
    contiguous = {name: np.ascontiguousarray(a) for name, a in arrays.items()}
    write_sealed(path, save(contiguous, metadata={"about": about_text}))


def load_arrays(path: str | os.PathLike, *, kind: str | tuple[str, ...]) -> tuple[dict[str, np.ndarray], dict]:
    """Read a file that `save_arrays` wrote with this `about["kind"]`, or one of several: its arrays and `about`. Raises
    `MissingFile` or `DamagedFile`."""
    from safetensors import SafetensorError
    from safetensors.numpy import load

    payload = read_sealed(path)
    try:
        arrays = load(payload)
        header = json.loads(payload[8 : 8 + int.from_bytes(payload[:8], "little")])
        about = json.loads(header["__metadata__"]["about"])
        stated = about.get("kind")
    except (SafetensorError, ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
        what = f"right checksum, but `save_arrays` did not write it: {error!r:.300}"
        raise DamagedFile(fault(path, what, _REMEDY)) from error
    if stated not in (kinds := (kind,) if isinstance(kind, str) else kind):
        raise DamagedFile(fault(path, f"holds a {stated!r}, expected a {' or '.join(map(repr, kinds))}", _REMEDY))
    return arrays, about
