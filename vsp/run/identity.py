"""`identity`: what tells two rules, metrics or methods apart, so that no run of one is taken for a run of the other.

Code of this repository is identified by its name, and by a version that is raised by hand. Code from outside is
identified by its qualified name, its settings, and a hash of its source and of what it uses from its own module.
"""

from __future__ import annotations

import dataclasses
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
    `above`: what uses `thing`, so that a circle ends.
    """
    if isinstance(thing, _PLAIN) or any(thing is one for one in above):
        return thing if isinstance(thing, _PLAIN) else "above"
    above = (*above, thing)
    if isinstance(thing, np.generic | np.ndarray) and thing.dtype != object:
        digest = hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()[:10]
        return thing.item() if isinstance(thing, np.generic) else [digest, str(thing.dtype), *thing.shape]
    if isinstance(thing, dict):
        return {str(key): identity(value, above) for key, value in thing.items()}
    if isinstance(thing, list | tuple | range | set | frozenset):
        values = [identity(value, above) for value in thing]
        return sorted(values, key=repr) if isinstance(thing, set | frozenset) else values
    if isinstance(thing, types.ModuleType):
        return {"module": thing.__name__, "library": _library(thing.__name__)}
    if isinstance(thing, np.ufunc) and "vectorized" not in thing.__name__:  # not one of `numpy.frompyfunc`
        return {"name": thing.__name__, "library": np.__version__}
    if isinstance(thing, types.MethodType):
        return {"method": thing.__name__, "of": identity(thing.__self__, above)}
    kind = thing if isinstance(thing, _CODE) else type(thing)
    found = {"name": f"{kind.__module__}.{kind.__qualname__}"} | _origin(thing, kind, above)
    return found if kind is thing else found | {"settings": identity(_settings(thing), above)}


def _origin(thing: Any, kind: Any, above: tuple) -> dict:
    """Return version, library or source of `thing`; `kind` is its class, or itself if it is code."""
    if (version := getattr(thing, "version", None)) is not None:
        return {"version": identity(version)}
    if kind.__module__.partition(".")[0] in OWN:
        return {}
    library = _library(kind.__module__)
    if library and kind.__name__ not in ("partial", "ufunc"):
        return {"library": library}
    if library or kind.__name__ == "<lambda>":
        raise _unknown(thing, "has no source of its own")
    functions, uses = _written(kind)
    try:
        text = "".join(inspect.getsource(function.__code__) for function in functions)
    except OSError as error:
        raise _unknown(thing, "has no source") from error
    for function in functions:
        uses |= _used(function)
    return {"source": hashlib.sha256(text.encode()).hexdigest()[:10], "uses": identity(uses, above)}


def _written(kind: Any) -> tuple[list[types.FunctionType], dict[str, Any]]:
    """Return the functions that somebody wrote: one, or those of a class and its bases; and the constants of these."""
    if isinstance(kind, types.FunctionType):
        return [kind], {}
    parts = [cls for cls in kind.__mro__[::-1] if not _library(cls.__module__)]
    values = {f"{cls.__qualname__}.{name}": value for cls in parts for name, value in vars(cls).items()}
    inner = [getattr(value, "__func__", getattr(value, "fget", value)) for value in values.values()]
    functions = [one for one in inner if isinstance(one, types.FunctionType)]
    made = ("<string>", dataclasses.__file__)  # methods that `dataclass` writes
    constants = {name: value for name, value in values.items() if isinstance(value, _PLAIN) and "__" not in name}
    return [one for one in functions if one.__code__.co_filename not in made], constants


def _used(function: types.FunctionType) -> dict[str, Any]:
    """Return what a function refers to, by name: globals, closure and defaults."""
    codes = [function.__code__]
    for code in codes:  # which grows
        codes += [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
    names = sorted({name for code in codes for name in code.co_names} & function.__globals__.keys())
    closure = zip(function.__code__.co_freevars, (cell.cell_contents for cell in function.__closure__ or ()))
    used = {name: function.__globals__[name] for name in names} | dict(closure)
    return used | {f"defaults of {function.__qualname__}": [function.__defaults__, function.__kwdefaults__]}


def _settings(thing: Any) -> dict:
    settings = getattr(thing, "settings", None)
    if isinstance(settings, dict):
        return settings
    if not hasattr(thing, "__dict__"):
        raise _unknown(thing, "does not show its settings")
    return {name: value for name, value in sorted(vars(thing).items()) if name != "version"}


def _library(name: str) -> str | None:
    """Return the version of an installed library, "Python" for its own modules, None for code of somebody's own."""
    top = name.partition(".")[0]
    if top in sys.stdlib_module_names and top != "__main__":
        return "Python"
    module = sys.modules.get(top)
    installed = any(f"{kind}-packages" in (getattr(module, "__file__", "") or "") for kind in ("site", "dist"))
    return str(getattr(module, "__version__", top)) if installed else None


def _unknown(thing: Any, why: str) -> ValueError:
    what = f"{thing!r:.60} {why}, so that a change of it would go unseen"
    return ValueError(f"{what}: write it as a function or class in a module, or give it a `version`")
