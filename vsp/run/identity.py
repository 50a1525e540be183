"""`identity`: what tells two rules, metrics or methods apart, so that no run of one is taken for a run of the other.

Code of this repository is identified by its name, and by a version that is raised by hand. Code from outside is
identified by its qualified name, its settings, and a hash of its source and of what it uses from its own modules.
"""

import dataclasses
import functools
import hashlib
import inspect
import sys
import types
from typing import Any

import numpy as np

OWN = ("vsp", "vsp_beyond", "studies", "vsp_course")
_PLAIN = (bool, int, float, str, type(None))
_CODE = (type, types.FunctionType, types.BuiltinFunctionType)


def identity(thing: Any, above: tuple = ()) -> Any:
    """Return a JSON-able value that differs wherever a result may; numbers and texts stay as they are.

    An attribute `version` stands for the source, and `settings`, a dictionary, for the attributes of an object. Raises
    ValueError for code from outside that has neither a source of its own, as a lambda or a partial, nor a version.
    `above`: what uses `thing`, so that a circle ends."""
    if isinstance(thing, _PLAIN):
        return thing
    if any(thing is one for one in above):
        return "above"
    above = (*above, thing)
    if isinstance(thing, np.generic | np.ndarray) and thing.dtype != object:
        return [_hash(np.ascontiguousarray(thing).tobytes()), str(thing.dtype), *thing.shape]
    if isinstance(thing, dict):
        return {str(key): identity(value, above) for key, value in thing.items()}
    if isinstance(thing, list | tuple | range | set | frozenset):
        values = [identity(value, above) for value in thing]
        return sorted(values, key=repr) if isinstance(thing, set | frozenset) else values
    if isinstance(thing, types.ModuleType):
        known = _own(thing.__name__) or _library(thing.__name__)
        return {"module": thing.__name__, "is": known or _hash(inspect.getsource(thing).encode())}
    if isinstance(thing, np.ufunc) and "vectorized" not in thing.__name__:  # not one of `numpy.frompyfunc`
        return {"name": thing.__name__, "is": np.__version__}
    if isinstance(thing, types.MethodType):
        return {"method": thing.__name__, "of": identity(thing.__self__, above)}
    kind = thing if isinstance(thing, _CODE) else type(thing)
    settings = identity(_settings(thing), above)
    return {"name": f"{kind.__module__}.{kind.__qualname__}", "settings": settings} | _origin(thing, kind, above)


def _origin(thing: Any, kind: Any, above: tuple) -> dict:
    """Return version, library or source of `thing`; `kind` is its class, or itself if it is code."""
    if (version := getattr(thing, "version", None)) is not None:
        code = thing.__code__ if kind.__name__ == "<lambda>" else None  # all lambdas of a function have one name
        return {"version": identity(version), "code": code and _hash(code.co_code + repr(code.co_consts).encode())}
    if _own(kind.__module__):
        return {}
    if kind.__name__ in ("partial", "ufunc", "<lambda>"):
        raise _unknown(thing, "has no source of its own")
    if library := _library(kind.__module__):
        return {"library": library}
    functions, uses = _written(kind)
    try:
        text = "".join(inspect.getsource(function.__code__) for function in functions)
    except OSError as error:
        raise _unknown(thing, "has no source") from error
    for function in functions:
        uses |= _globals(function)
    return {"source": _hash(text.encode()), "uses": identity(uses, above)}


def _written(kind: Any) -> tuple[list[types.FunctionType], dict[str, Any]]:
    """Return the functions that somebody wrote: one, or those of a class and its bases; and their other parts."""
    if isinstance(kind, types.FunctionType):
        return [kind], {}
    classes = [cls for cls in kind.__mro__[::-1] if not _library(cls.__module__)]
    parts = {f"{cls.__qualname__}.{name}": part for cls in classes for name, part in vars(cls).items()}
    inner = {name: getattr(part, "__func__", getattr(part, "fget", part)) for name, part in parts.items()}
    functions = [part for part in inner.values() if isinstance(part, types.FunctionType)]
    made = ("<string>", dataclasses.__file__)  # methods that `dataclass` writes
    others = {name: part for name, part in inner.items() if "__" not in name and part not in functions}
    plain = {name: part for name, part in others.items() if not isinstance(part, types.MemberDescriptorType)}
    return [one for one in functions if one.__code__.co_filename not in made], plain


def _globals(function: types.FunctionType) -> dict[str, Any]:
    """Return the globals that a function refers to, by name."""
    codes = [function.__code__]
    for code in codes:  # which grows
        codes += [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
    names = {name for code in codes for name in code.co_names}
    return {name: function.__globals__[name] for name in sorted(names & function.__globals__.keys())}


def _settings(thing: Any) -> dict:
    """Return what an object or a function was made with: its attributes, or its closure and defaults."""
    settings = getattr(thing, "settings", None)
    if isinstance(settings, dict):
        return settings
    if isinstance(thing, types.FunctionType) and not _own(thing.__module__):
        closure = zip(thing.__code__.co_freevars, (cell.cell_contents for cell in thing.__closure__ or ()))
        return {**dict(closure), "defaults": [thing.__defaults__, thing.__kwdefaults__]}
    if isinstance(thing, _CODE):
        return {}
    if hasattr(thing, "__wrapped__"):  # as `functools.lru_cache` leaves it
        return {"of": thing.__wrapped__}
    if isinstance(thing, functools.partial):
        return {"of": getattr(thing.func, "__qualname__", ""), "with": [thing.args, thing.keywords]}
    if not hasattr(thing, "__dict__"):
        raise _unknown(thing, "does not show its settings")
    return {name: value for name, value in sorted(vars(thing).items()) if name != "version"}


def _own(module: str) -> bool:
    return module.partition(".")[0] in OWN


def _library(name: str) -> str | None:
    """Return the version of an installed library, "Python" for its own modules, None for code of somebody's own."""
    top = name.partition(".")[0]
    if top in sys.stdlib_module_names and top != "__main__":
        return "Python"
    module = sys.modules.get(top)
    installed = any(f"{kind}-packages" in (getattr(module, "__file__", "") or "") for kind in ("site", "dist"))
    return str(getattr(module, "__version__", top)) if installed else None


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:10]


def _unknown(thing: Any, why: str) -> ValueError:
    what = f"{thing!r:.60} {why}, so that a change of it would go unseen"
    return ValueError(f"{what}: write it as a function or class in a module, or give it a `version`")
