"""Read a Stable-Baselines3 zip: its settings and tensors, within limits of memory and time, without torch.

The settings are JSON, with a pickle beside what JSON cannot say; torch describes tensors in a pickle too. No unpickler
runs here: `inert.described` says what they describe. The memory that the tensors need is known before the first of them
is made.
"""

import base64
import io
import json
import math
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..run import atomic
from .inert import LARGEST as LARGEST_PICKLE
from .inert import Thing, Unknown, described

LARGEST = 2**27  # bytes of a zip, of the policy in it, and of the tensors in float64; a TD3 agent takes 2**24
LARGEST_DATA = 2**24  # bytes of the agent's settings, in JSON
MOST_MEMBERS = 10_000  # members of a zip

_DTYPES = {f"torch.{name}Storage": kind for name, kind in (("Float", "<f4"), ("Double", "<f8"), ("Long", "<i8"))}


class Saved(NamedTuple):
    """What a zip says: the agent's settings, and the tensors of its policy, but not those of target networks."""

    settings: dict[str, Any]  # JSON
    tensors: dict[str, np.ndarray]

    def setting(self, name: str) -> Any:
        """Return a setting as Python's value, or as the `Thing` that its pickle describes. Raises Unknown if it is
        pickled as code, such as a class of one's own, or damaged."""
        value = self.settings.get(name)
        if not isinstance(value, dict) or ":serialized:" not in value:
            return value
        try:
            return described(base64.b64decode(value[":serialized:"]))
        except Exception as error:  # of any kind: the content is not trusted
            words = {key: text for key, text in value.items() if key not in (":serialized:", "__doc__")}
            raise Unknown(
                f"its {name} is one that only its own code can build, {words!r:.400} ({error!r:.100})"
            ) from error


class _View(NamedTuple):
    """A tensor as a pickle of torch describes it. Offset, strides and sizes are in elements of its storage."""

    dtype: np.dtype
    name: str  # of the storage
    elements: int  # number of elements in the storage
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]


def read_zip(path: Path) -> Saved:
    """Return what a Stable-Baselines3 zip says. No code from the file runs. Raises FileNotFoundError, and
    `atomic.DamagedFile` for a file that is no such zip or exceeds the limits above."""
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file, expected a zip that Stable-Baselines3's `save` wrote")
    try:
        archive = _archive(atomic.read_bytes(path, LARGEST))
        settings = json.loads(_member(archive, "data", LARGEST_DATA))
        policy = _member(archive, "policy.pth", LARGEST)
        tensors = _tensors(policy) if policy.startswith(b"PK") else _old_tensors(policy)
        if not isinstance(settings, dict):
            raise ValueError("its settings are no dictionary, expected one")
        return Saved(settings, tensors)
    except Exception as error:  # of any kind: the content is not trusted
        reason = f"not a zip of a Stable-Baselines3 agent with only tensors: {error!r:.300}"
        raise atomic.DamagedFile(f"{path}: {reason}") from error


def _archive(content: bytes) -> zipfile.ZipFile:
    if (members := content.count(b"PK\1\2")) > MOST_MEMBERS:  # before zipfile makes a list of them
        raise ValueError(f"about {members} members, expected at most {MOST_MEMBERS}")
    return zipfile.ZipFile(io.BytesIO(content))


def _member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """Return a member of a zip. Raises ValueError if it is, or claims to be, larger than `most` bytes."""
    info = archive.getinfo(name)
    # With other types of compression the file decides how much memory they take
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{name} has compression type {info.compress_type}, expected none or deflate")
    with archive.open(info) as file:
        content = file.read(most + 1)
    if max(info.file_size, len(content)) > most:
        raise ValueError(f"{name} is {max(info.file_size, len(content))} bytes unpacked, expected at most {most}")
    return content


def _tensors(content: bytes) -> dict[str, np.ndarray]:
    """Return the tensors in an archive that `torch.save` wrote."""
    archive = _archive(content)
    (pickle,) = (name for name in archive.namelist() if name.endswith("/data.pkl"))
    folder = pickle.removesuffix(".pkl")
    views = _views(described(_member(archive, pickle, LARGEST_PICKLE)))
    return {
        name: _tensor(_member(archive, f"{folder}/{view.name}", view.elements * view.dtype.itemsize), view)
        for name, view in views.items()
    }


def _old_tensors(content: bytes) -> dict[str, np.ndarray]:
    """Return the tensors in a file of torch before 1.6: five pickles, then the number of elements and bytes of each
    storage, in the order of the last pickle."""
    file = io.BytesIO(content[:LARGEST_PICKLE])
    _, _, _, found, names = (described(file) for _ in range(5))
    views, place, storages = _views(found), file.tell(), {}
    kinds = {view.name: view.dtype for view in views.values()}
    for name in names:
        size = int.from_bytes(content[place : place + 8], "little") * kinds.get(name, np.dtype("<f4")).itemsize
        storages[name] = content[place + 8 : place + 8 + size]
        place += 8 + size
    return {name: _tensor(storages[view.name], view) for name, view in views.items()}


def _views(found: Any) -> dict[str, _View]:
    """Return the tensors that torch's pickle of a `state_dict` describes, but those of target networks, by name. Raises
    ValueError for another pickle, and for tensors that need too much memory."""
    if not isinstance(found, Thing) or found.name != "collections.OrderedDict":
        raise ValueError("the policy is no dictionary of tensors, expected one as torch writes it")
    tensors = ((str(name), value) for name, value in found.items.items())
    views = {
        name: _view(name, value) for name, value in tensors if not name.startswith(("actor_target", "critic_target"))
    }
    needed = sum(8 * max(view.elements, math.prod(view.size)) for view in views.values())
    if needed > LARGEST:
        raise ValueError(f"the tensors take {needed} bytes, expected at most {LARGEST}")
    return views


def _view(name: str, thing: Any) -> _View:
    match thing:
        case Thing(
            "torch._utils._rebuild_tensor_v2", (("storage", Thing(kind), str(place), _, n, *_), start, size, stride, *_)
        ):
            if all(type(number) is int and number >= 0 for number in (n, start, *size, *stride)) and kind in _DTYPES:
                return _View(np.dtype(_DTYPES[kind]), place, n, start, tuple(size), tuple(stride))
    raise ValueError(f"{name:.100} is no tensor of plain numbers, expected one")


def _tensor(storage: bytes, view: _View) -> np.ndarray:
    """Return a tensor that owns its memory. Raises ValueError unless it lies in a storage of the length described."""
    last = view.offset + sum((n - 1) * step for n, step in zip(view.size, view.stride, strict=True))
    if len(storage) != view.elements * view.dtype.itemsize or (last >= view.elements and 0 not in view.size):
        raise ValueError(f"a tensor ends at element {last}, of {view.elements} in {len(storage)} bytes")
    strides = [step * view.dtype.itemsize for step in view.stride]
    return np.ndarray(view.size, view.dtype, storage, view.offset * view.dtype.itemsize, strides).copy()
