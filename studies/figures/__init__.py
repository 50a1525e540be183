"""Figures of the studies."""

from .maps import agent_maps
from .gaits import footfall, poses
from .curves import LIMITS, ROBOTS, TUNING, fidelity_map, likeness_over_cells, over_cells
