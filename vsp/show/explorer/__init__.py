"""The explorer: replay a distillation, query a policy at a state, change the policy and watch its episodes.

`explorer.js` draws on the site, in JupyterLab and in standalone HTML files; `scene` collects the data to draw.
"""

from .explorer import SCRIPT, Explorer, explore, standalone
from .scene import PLANES, scene_of

__all__ = ["PLANES", "SCRIPT", "Explorer", "explore", "scene_of", "standalone"]
