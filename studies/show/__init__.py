"""Figures of the studies."""

from .agents import agent_maps
from .gait import footfall, poses
from .methods import LIMITS, ROBOTS, TUNING, fidelity_map, likeness_over_cells, over_cells
