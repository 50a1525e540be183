"""The scripts of the explorer, and their style."""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = Path(__file__).parent
MODULES = [FOLDER / f"{name}.js" for name in ("model", "controls", "picture", "texts", "explorer")]
STYLE = (FOLDER / "explorer.css").read_text("utf-8")


def bundle(modules: list[Path]) -> str:
    """Return modules as one, without the lines that import: each comes after those that it uses."""
    texts = [path.read_text("utf-8") for path in modules]
    return "".join(re.sub(r'^import [^"]*"[^"]*"\n', "", text, flags=re.MULTILINE) for text in texts)
