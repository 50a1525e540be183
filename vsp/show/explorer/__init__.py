"""The explorer: replay a distillation, query a policy at a state, change the policy and watch its episodes.

The scripts draw on the site, in JupyterLab and in standalone HTML files: `model` computes, `picture` draws, `controls`
and `texts` are around it, `explorer` joins them. `scene` collects the data to draw.
"""

from .explorer import Explorer, explore, standalone
from .scene import PLANES, scene_of
from .scripts import SCRIPT, STYLE

__all__ = ["PLANES", "SCRIPT", "STYLE", "Explorer", "explore", "scene_of", "standalone"]
