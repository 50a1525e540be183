"""Figures of the studies."""

from .maps import action_tones, agent_maps, polygons
from .gaits import footfall, poses
from .curves import LIMITS, ROBOTS, TUNING, fidelity_map, likeness_over_cells, over_cells
