"""The page of the explorer, its style, and two scripts, each made of the modules by `npm --prefix docs run build`: that
of the explorer and that of the workbench."""

from pathlib import Path

_FILES = ("page.html", "explorer.css", "explorer.bundle.js", "workbench.bundle.js")
PAGE, STYLE, SCRIPT, BENCH = (Path(__file__).with_name(name).read_text("utf-8") for name in _FILES)
