"""`View`: the explorer in JupyterLab, where a kernel runs."""

from __future__ import annotations

from pathlib import Path

import anywidget
import traitlets


class View(anywidget.AnyWidget):
    """Draw a scene, given as JSON."""

    _esm = Path(__file__).with_name("explorer.js")
    scene = traitlets.Unicode().tag(sync=True)
