"""Figures of the studies."""

from .benchmarks import fit_times, kills, times_over_dimension
from .gait import footfall, gait_strip, save_gait
from .methods import LIMITS, ROBOTS, fidelity_map, likeness_over_cells, over_cells, return_over_cells
