"""`View`: the explorer in JupyterLab, where a kernel runs."""

import anywidget
import traitlets

from .scripts import SCRIPT, STYLE


class View(anywidget.AnyWidget):
    """Draw a scene, given as JSON."""

    _esm, _css = SCRIPT, STYLE
    scene = traitlets.Unicode().tag(sync=True)
