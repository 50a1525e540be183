"""Docstrings of vsp for autodoc: plain prose in which `name` is code, and the comments behind the fields of a class."""

import inspect
import re

_CODE = re.compile(r"(`[^`]*`)")
_FIELD = re.compile(r"^    (\w+): [^#\n]+  # (.+)$", re.MULTILINE)


def _docstring(app, what, name, thing, options, lines):
    """Rewrite the docstring `lines` in place, as autodoc asks for it."""
    lines[:] = rest("\n".join(lines)).split("\n")
    for field, comment in _fields(thing) if what == "class" else []:
        lines += ["", f"- `{field}`: {escape(comment)}"]
    lines.append("")


def _fields(thing: type) -> list[tuple[str, str]]:
    """Fields of a class and the comments behind them."""
    try:
        return _FIELD.findall(inspect.getsource(thing))
    except (OSError, TypeError):  # a class without a `class` statement in Python
        return []


def rest(text: str) -> str:
    """`text` as reStructuredText: an indented paragraph is code, and no sign but a backtick means anything."""
    paragraphs = text.split("\n\n")
    return "\n\n".join(f"::\n\n{p}" if p.startswith("    ") else escape(p) for p in paragraphs)


def escape(text: str) -> str:
    """`text` with a backslash before what reStructuredText would take for mark-up, outside of `code`."""
    parts = _CODE.split(text)
    parts[::2] = [re.sub(r"([*|\\]|_\b)", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def setup(app):
    app.connect("autodoc-process-docstring", _docstring)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
