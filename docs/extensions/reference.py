"""Pages of the API, made from the code when the site is built: one for each folder of `vsp` and `vsp_beyond`.

What api.md shows is not repeated. `studies`, which nobody imports, has a list of its modules.
"""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_SHOWN = re.compile(r"auto(?:function|class):: ([\w.]+)\.(\w+)$", re.MULTILINE)


def _write(app):
    """Write api/*.md among the sources of the site, before Sphinx looks for them."""
    shown = _SHOWN.findall((app.srcdir / "api.md").read_text("utf-8"))
    pages = {"studies": _list_of_modules("studies")}
    for part in ("vsp", "vsp_beyond"):
        for folder in (ROOT / part, *sorted((ROOT / part).glob("*/"))):
            if text := _sections(folder, shown, deep=folder.name != part):
                pages[_name(folder)] = f"# API: {_name(folder)}\n\n{_docstring(folder / '__init__.py')}\n\n{text}"
    (app.srcdir / "api").mkdir()
    for name, text in pages.items():
        (app.srcdir / "api" / f"{name}.md").write_text(text, "utf-8")


def _modules(folder: Path, deep: bool) -> list[Path]:
    return sorted(folder.glob("**/[!_]*.py" if deep else "[!_]*.py"))


def _sections(folder: Path, shown: list[tuple[str, str]], deep: bool) -> str:
    """A section for each module of `folder`, without the members `shown` elsewhere."""
    sections = []
    for name in map(_name, _modules(folder, deep)):
        excluded = ", ".join(member for module, member in shown if module == name)
        option = f"   :exclude-members: {excluded}\n" * bool(excluded)
        sections.append(f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n   :members:\n{option}```\n")
    return "\n".join(sections)


def _list_of_modules(part: str) -> str:
    lines = [f"- `{_name(path)}`: {_docstring(path)}" for path in _modules(ROOT / part, deep=True)]
    return "\n".join([f"# {part}", "", _docstring(ROOT / part / "__init__.py"), "", *lines, ""])


def _name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def _docstring(path: Path) -> str:
    """The first paragraph of the docstring of the module at `path`, in one line."""
    return " ".join(ast.get_docstring(ast.parse(path.read_text("utf-8"))).partition("\n\n")[0].split())


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
