"""The explorer's page and style, and its script and the workbench's, which `npm --prefix docs run build` makes."""

from pathlib import Path

_FILES = ("page.html", "explorer.css", "explorer.bundle.js", "workbench.bundle.js")
PAGE, STYLE, SCRIPT, BENCH = (Path(__file__).with_name(name).read_text("utf-8") for name in _FILES)
