"""Say how long a search will take, from its settings and the speeds of common machines: nothing is measured."""

from __future__ import annotations

from vsp.tasks.base import Task

from .config import Faithful, Tuned
from .tune import candidates_per_generation

# Steps per second on one core, at most and at least: of tasks whose episodes run in one batch, and of others. Episodes
# are counted at their maximum length, so shorter ones count as faster
BATCHED, ONE_BY_ONE = (8e6, 2e5), (1e5, 5e3)
# Seconds per restart and cell, two cells more than there are: of L-BFGS, and of a thousand steps of Adam
DESCENT, ANNEALING = (0.02, 0.4), (0.01, 0.3)


def expected_time(task: Task, config: Faithful | Tuned) -> str:
    """Return how long the search with `config` takes on one core, as a range in words."""
    low, high = expected_seconds(task, config)
    return f"some {in_words(low)} to {in_words(high)} on one core"


def expected_seconds(task: Task, config: Faithful | Tuned) -> tuple[float, float]:
    """Return the least and the most seconds of the search with `config` on one core, roughly."""
    most, least = ONE_BY_ONE if task.one_by_one else BATCHED
    d, m, k = len(task.low), len(task.action_low), config.n_cells
    candidates = config.n_generations * candidates_per_generation(k * (d + (d + 1) * m))
    taught, tuning = config.n_episodes + config.n_validation, candidates * config.n_tuning_episodes
    # A `Faithful` is not tuned if the closest cells return enough
    fits: float = config.n_restarts * (k + 2)
    certain, (quick, slow) = taught, DESCENT
    if isinstance(config, Tuned):
        certain, fits, (quick, slow) = taught + tuning, fits * config.n_steps / 1000, ANNEALING
    return certain * task.max_steps / most + fits * quick, (taught + tuning) * task.max_steps / least + fits * slow


def in_words(seconds: float) -> str:
    """Return `seconds` in words, such as "20 seconds" or "3 minutes"."""
    for unit, size in (("hours", 3600), ("minutes", 60)):
        if seconds >= 1.5 * size:
            return f"{round(seconds / size)} {unit}"
    return f"{max(2, round(seconds))} seconds"
