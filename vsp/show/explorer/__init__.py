"""The explorer: replay a distillation, ask a policy about a state, change it and watch the episodes.

`explorer.js` draws it everywhere: on the site, in JupyterLab, and in an HTML file of its own; `scene` is what it draws.
"""

from .explorer import SCRIPT, Explorer, explore
from .scene import PLANES, scene_of

__all__ = ["PLANES", "SCRIPT", "Explorer", "explore", "scene_of"]
