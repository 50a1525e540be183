"""Read what a pickle describes, without running it.

An unpickler imports and calls what a file names. So a file could run code, exhaust memory or never end. Here a stack
machine interprets the opcodes that describe numbers, text, containers and objects, and refuses all others. An object
stays a `Thing`: the name of what would be called, and what it would get. Only strings and integers are hashed, and
nothing nested is printed, because that may never end.
"""

import pickletools
import re
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

LARGEST = 2**21  # bytes of a description; the tensors of an agent take some 150 each
MOST = 100_000  # opcodes of one
_VALUES = set(
    """NONE INT LONG LONG1 BININT BININT1 BININT2 FLOAT BINFLOAT UNICODE BINUNICODE SHORT_BINUNICODE BINBYTES
    SHORT_BINBYTES BINBYTES8 BYTEARRAY8""".split()
)


class Unknown(ValueError):
    """A zip says something that is not modelled here; the message names it."""


class Unfit(Unknown):
    """An agent cannot act in the task, whoever loads it."""


@dataclass(eq=False, repr=False)
class Thing:
    """A class or function (`given` is None), or an object: what would be called, with which arguments and state."""

    name: str  # such as "numpy.dtype"
    given: Any = None
    state: Any = None
    items: dict = field(default_factory=dict)  # of a dictionary's subclass


def described(source: bytes | BinaryIO) -> Any:
    """Return what the pickle in `source`, or the next one in a file, describes. Raises ValueError for any other."""
    if isinstance(source, bytes) and len(source) > LARGEST:
        raise ValueError(f"a description of {len(source)} bytes, expected at most {LARGEST}")
    stack: list[Any] = []
    marks: list[int] = []
    memo: dict[int, Any] = {}
    value: Any
    for done, (opcode, value, _) in enumerate(pickletools.genops(source)):
        if done > MOST:
            raise ValueError(f"a description of more than {MOST} opcodes")
        match opcode.name:
            case name if name in _VALUES:
                stack.append(value)
            case "NEWTRUE" | "NEWFALSE" as name:
                stack.append(name == "NEWTRUE")
            case "GLOBAL":
                stack.append(Thing(value.replace(" ", ".")))
            case "STACK_GLOBAL":
                stack[-2:] = [Thing(".".join(stack[-2:]))]
            case "MARK":
                marks.append(len(stack))
            case "EMPTY_TUPLE" | "EMPTY_DICT" | "EMPTY_LIST" as name:
                stack.append({"EMPTY_TUPLE": (), "EMPTY_DICT": {}, "EMPTY_LIST": []}[name])
            case "TUPLE" | "TUPLE1" | "TUPLE2" | "TUPLE3" as name:
                begin = marks.pop() if name == "TUPLE" else len(stack) - int(name[-1])
                stack[begin:] = [tuple(stack[begin:])]
            case "PUT" | "BINPUT" | "LONG_BINPUT":
                memo[value] = stack[-1]
            case "MEMOIZE":
                memo[len(memo)] = stack[-1]
            case "GET" | "BINGET" | "LONG_BINGET":
                stack.append(memo[value])
            case "APPEND" | "APPENDS" as name:
                begin = marks.pop() if name == "APPENDS" else len(stack) - 1
                if isinstance(stack[begin - 1], list):
                    stack[begin - 1].extend(stack[begin:])
                del stack[begin:]
            case "SETITEM" | "SETITEMS" as name:
                begin = marks.pop() if name == "SETITEMS" else len(stack) - 2
                if not all(isinstance(key, str | int) for key in stack[begin::2]):
                    raise ValueError("a dictionary in the pickle has names that are not strings")
                target = stack[begin - 1]
                (target.items if isinstance(target, Thing) else target).update(
                    zip(stack[begin::2], stack[begin + 1 :: 2])
                )
                del stack[begin:]
            case "REDUCE" | "NEWOBJ":
                function, given = stack[-2:]
                if not isinstance(function, Thing) or not isinstance(given, tuple):
                    raise ValueError("a call in the pickle of what has no name, expected numbers and text")
                stack[-2:] = [Thing(function.name, given)]
            case "BUILD":
                state = stack.pop()
                if isinstance(stack[-1], Thing):
                    stack[-1].state = state
            case "PROTO" | "FRAME" | "BINPERSID" | "STOP":
                pass
            case name:
                raise ValueError(f"{name} in the pickle, expected numbers, text, containers and objects")
    (found,) = stack
    return found


def array(thing: Any, what: str) -> np.ndarray:
    """Return a NumPy array or number that a pickle describes, in float64. Raises Unknown for anything else."""
    match thing:
        case int() | float():
            return np.array(thing, dtype=np.float64)
        case Thing(name, _, (_, (*shape,), kind, fortran, bytes(raw))) if name.endswith("._reconstruct"):
            pass
        case Thing(name, (kind, bytes(raw))) if name.endswith("multiarray.scalar"):
            shape, fortran = [], False
        case Thing(name, (bytes() | bytearray() as raw, kind, (*shape,), str(order))) if name.endswith("._frombuffer"):
            fortran = order == "F"
        case _:
            raise Unknown(f"{what} is no number or array of numbers")
    try:
        return np.frombuffer(raw, _dtype(kind)).reshape(shape, order="F" if fortran else "C").astype(np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise Unknown(f"{what} is no array of numbers") from error


def _dtype(thing: Any) -> np.dtype:
    match thing:
        case Thing("numpy.dtype", (str(code), *_), (_, str(way), *_)) if re.fullmatch(r"[<>|=][fiub]\d", way + code):
            return np.dtype(way + code)
    raise ValueError("expected an array of numbers in the pickle")
