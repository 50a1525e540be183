"""Figures of the studies."""

from .gait import footfall, save_gait
from .methods import LIMITS, ROBOTS, fidelity_map, likeness_over_cells, over_cells, return_over_cells
