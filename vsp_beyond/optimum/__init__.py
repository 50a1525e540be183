"""Compute the best return that any policy can reach, from the dynamics: the reference for teachers and policies."""

from .grid import PENDULUM_REGIONS, losses
from .references import TASKS, best_policy, best_returns
