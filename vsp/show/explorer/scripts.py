"""The scripts of the explorer as one, which `npm --prefix docs run build` makes of the modules, and their style."""

from pathlib import Path

SCRIPT, STYLE = (Path(__file__).with_name(f"explorer.{name}").read_text("utf-8") for name in ("bundle.js", "css"))
