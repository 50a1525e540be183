"""Docstrings of vsp for autodoc: plain prose in which `name` is code, and the comments behind the fields of a class."""

import inspect
import re
from dataclasses import fields, is_dataclass

_CODE = re.compile(r"(`[^`]*`)")
_PARAMETERS = re.compile(r'<dl>\s*(<dd><em class="sig-param.*?</dd>)\s*</dl>', re.DOTALL)
_PARAMETER = re.compile(r'<dd>(<em class="sig-param.*?)</dd>', re.DOTALL)
_FIELD = re.compile(r"^    (\w+): [^#\n]+  # (.+)$", re.MULTILINE)


def _docstring(app, what, name, thing, options, lines):
    """Rewrite the docstring `lines` in place, as autodoc asks for it."""
    lines[:] = rest("\n".join(lines)).split("\n")
    for field, comment in _comments(thing) if what == "class" else []:
        lines += ["", f"- `{field}`: {escape(comment)}"]
    lines.append("")


def _signature(app, what, name, thing, options, signature, result):
    """A class with many fields lists them below, each with what it means: no need to list them above too."""
    return ("", None) if what == "class" and is_dataclass(thing) and len(fields(thing)) > 10 else None


def _comments(thing: type) -> list[tuple[str, str]]:
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


def _lines(app, pagename, templatename, context, doctree):
    """Parameters on lines of their own are no list of definitions, which is what Sphinx calls them."""
    body = _PARAMETERS.sub(r'<span class="sig-lines">\1</span>', context.get("body", ""))
    context["body"] = _PARAMETER.sub(r'<span class="sig-line">\1</span>', body)


def setup(app):
    app.connect("autodoc-process-docstring", _docstring)
    app.connect("autodoc-process-signature", _signature)
    app.connect("html-page-context", _lines)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
