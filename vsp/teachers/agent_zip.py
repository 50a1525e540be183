"""Read the actor of a Stable-Baselines3 zip: only tensors, within limits of memory and time, without torch.

torch describes tensors in a pickle. No unpickler runs here, because a file could make it run code, exhaust memory or
never end. Instead, `_state_dict` interprets the few opcodes that describe a dictionary of tensors and refuses all
others. The memory that the tensors need is known before the first of them is made.
"""

from __future__ import annotations

import io
import json
import math
import pickletools
import re
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..run import atomic

LARGEST = 2**27  # bytes of a zip, of the policy in it, and of the actor's tensors in float64; a TD3 actor takes 2**22
LARGEST_DATA = 2**24  # bytes of the agent's settings, in JSON
LARGEST_PICKLE = 2**18  # bytes that describe the tensors, about 150 per tensor
MOST_MEMBERS = 10_000  # members of a zip

_DTYPES = {"torch FloatStorage": "<f4", "torch DoubleStorage": "<f8"}


class _View(NamedTuple):
    """A tensor as a pickle of torch describes it. Offset, strides and sizes are in elements of its storage."""

    kind: str  # class of the storage, which gives the type of the elements
    name: str  # name of the zip's member that holds the storage
    elements: int  # number of elements in the storage
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]


def read_zip(path: Path) -> dict[str, np.ndarray]:
    """Return the actor's tensors in a Stable-Baselines3 zip, by name. No code from the file runs.

    Raises FileNotFoundError, `atomic.DamagedFile` for a file that is no such zip or exceeds the limits above, and
    ValueError for an actor whose activation is not ReLU.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file, expected a zip that Stable-Baselines3's `save` wrote")
    try:
        if path.is_file() and path.stat().st_size > LARGEST:
            raise ValueError(f"it has {path.stat().st_size} bytes, expected at most {LARGEST}")
        archive = _archive(atomic.read_bytes(path))
        about = json.loads(_member(archive, "data", LARGEST_DATA))
        activation = str(about.get("policy_kwargs", {}).get("activation_fn", "ReLU"))
        actor = _tensors(_archive(_member(archive, "policy.pth", LARGEST)), "actor")
    except Exception as error:  # of any kind: the content is not trusted
        reason = f"not a zip of a Stable-Baselines3 agent with only tensors: {error!r:.300}"
        raise atomic.DamagedFile(f"{path}: {reason}") from error
    if not re.search(r"\bReLU\b", activation):
        raise ValueError(f"{path}: the agent's activation is {activation:.100}, expected ReLU")
    return actor


def part_of(tensors: dict, part: str) -> dict:
    """Return the tensors of an agent's "actor" or "critic", under the names that `Teacher` expects."""
    return {name.removeprefix(f"{part}."): value for name, value in tensors.items() if name.startswith(f"{part}.")}


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


def _tensors(archive: zipfile.ZipFile, part: str) -> dict[str, np.ndarray]:
    """Return the tensors of a part of the agent in an archive that `torch.save` wrote."""
    (pickle,) = (name for name in archive.namelist() if name.endswith("/data.pkl"))
    views = part_of(_state_dict(_member(archive, pickle, LARGEST_PICKLE)), part)
    needed = sum(8 * max(view.elements, math.prod(view.size)) for view in views.values())
    if needed > LARGEST:
        raise ValueError(f"the tensors of the {part} take {needed} bytes, expected at most {LARGEST}")
    return {name: _tensor(archive, pickle.removesuffix(".pkl"), view) for name, view in views.items()}


def _tensor(archive: zipfile.ZipFile, folder: str, view: _View) -> np.ndarray:
    """Return a tensor that owns its memory. Raises KeyError for elements that are not float32 or float64, ValueError if
    the storage is longer than declared or too short for the tensor."""
    dtype = np.dtype(_DTYPES[view.kind])
    storage = _member(archive, f"{folder}/{view.name}", view.elements * dtype.itemsize)
    strides = [step * dtype.itemsize for step in view.stride]
    return np.ndarray(view.size, dtype, storage, view.offset * dtype.itemsize, strides).copy()


def _state_dict(content: bytes) -> dict[str, _View]:
    """Return the tensors that torch's pickle of a `state_dict` describes, by name.

    This is a stack machine that represents classes and functions by their names. It hashes and prints only strings,
    because hashing or printing nested tuples may never end. Raises ValueError for any other pickle.
    """
    stack: list[Any] = []
    marks: list[int] = []
    memo: dict[Any, Any] = {}
    for opcode, value, _ in pickletools.genops(content):
        match opcode.name:
            case "BINUNICODE" | "BININT" | "BININT1" | "BININT2" | "GLOBAL" | "NONE" | "NEWFALSE" | "NEWTRUE":
                stack.append(value)
            case "EMPTY_TUPLE":
                stack.append(())
            case "EMPTY_DICT":
                stack.append({})
            case "MARK":
                marks.append(len(stack))
            case "TUPLE" | "TUPLE1" | "TUPLE2" | "TUPLE3" as name:
                begin = marks.pop() if name == "TUPLE" else len(stack) - int(name[-1])
                stack[begin:] = [tuple(stack[begin:])]
            case "BINPUT" | "LONG_BINPUT":
                memo[value] = stack[-1]
            case "BINGET" | "LONG_BINGET":
                stack.append(memo[value])
            case "SETITEM" | "SETITEMS" as name:
                begin = marks.pop() if name == "SETITEMS" else len(stack) - 2
                names = stack[begin::2]
                if not all(isinstance(name, str) for name in names):
                    raise ValueError("a dictionary in the pickle has names that are not strings")
                stack[begin - 1].update(zip(names, stack[begin + 1 :: 2]))
                del stack[begin:]
            case "REDUCE":
                stack[-2:] = [_called(*stack[-2:])]
            case "BUILD":
                stack.pop()  # attributes
            case "PROTO" | "BINPERSID" | "STOP":
                pass
            case name:
                raise ValueError(f"{name} in the pickle, expected a dictionary of tensors")
    (found,) = stack
    return {name: view for name, view in found.items() if isinstance(view, _View)}


def _called(function: Any, arguments: Any) -> dict | _View:
    """Return the result of a call in the pickle: an empty dictionary, or a tensor with parts of the expected types."""
    match function, arguments:
        case "collections OrderedDict", ():
            return {}
        case "torch._utils _rebuild_tensor_v2", (
            ("storage", str(kind), str(name), _, n),
            start,
            (*size,),
            (*stride,),
            *_,
        ):
            if all(type(number) is int and number >= 0 for number in (n, start, *size, *stride)):
                return _View(kind, name, n, start, tuple(size), tuple(stride))
    raise ValueError("a call in the pickle makes no tensor, expected a dictionary of tensors")
