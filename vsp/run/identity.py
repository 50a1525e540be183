"""`identity`: what tells two rules, metrics or methods apart, so that no run of one is taken for a run of the other.

Code of this repository is identified by its name, and by a version that is raised by hand. Code from outside is
identified by its qualified name, its settings, and a hash of its source and of what it uses from its own module.
"""

from __future__ import annotations

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
    if isinstance(thing, list | tuple | range):
        return [identity(value, above) for value in thing]
    if isinstance(thing, types.ModuleType):
        return {"module": thing.__name__, "library": _library(thing.__name__)}
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
    if library and kind.__name__ != "partial":
        return {"library": library}
    if library or kind.__name__ == "<lambda>":
        raise _unknown(thing, "has no source of its own")
    parts = [cls for cls in kind.__mro__ if not _library(cls.__module__)] if isinstance(kind, type) else [kind]
    uses: dict[str, Any] = {}
    for part in parts:
        uses |= _uses(part)
    try:
        text = "".join(inspect.getsource(getattr(part, "__code__", part)) for part in parts)
    except (OSError, TypeError) as error:
        raise _unknown(thing, "has no source") from error
    return {"source": hashlib.sha256(text.encode()).hexdigest()[:10], "uses": identity(uses, above)}


def _uses(part: Any) -> dict[str, Any]:
    """Return what the source of a function or class refers to, by name: defaults, closure and globals."""
    if isinstance(part, type):
        inner = [getattr(value, "__func__", getattr(value, "fget", value)) for value in vars(part).values()]
        uses = {name: value for name, value in vars(part).items() if name[:2] != "__" and isinstance(value, _PLAIN)}
        for function in (one for one in inner if isinstance(one, types.FunctionType)):
            uses |= _uses(function)
        return uses
    codes = [part.__code__]
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
    names = sorted({name for code in codes for name in code.co_names} & part.__globals__.keys())
    closure = zip(part.__code__.co_freevars, (cell.cell_contents for cell in part.__closure__ or ()))
    used = {name: part.__globals__[name] for name in names} | dict(closure)
    return used | {"defaults": [part.__defaults__, part.__kwdefaults__]}


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
