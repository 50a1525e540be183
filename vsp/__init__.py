"""vsp: distil reinforcement-learning policies to linear policies in Voronoi cells of the state space.

The modules of this folder implement the paper's method: start with `algorithms.py`. Its inputs are in tasks/,
subpolicies/ and teachers/. The folders baselines/, paper/, beyond/ and course/ compare, reproduce, extend and teach it.
show/ draws figures; run/ runs jobs and notebooks. This file is the public API: it resolves names of tasks, and
`distill` and `preset` choose between the paper's method and ours.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from types import ModuleType
from typing import Literal

import pandas as pd

from . import algorithms
from .algorithms import merge_regions, split_regions, teacher_episodes
from .beyond.proofs import prove
from .beyond.refinement import Faithful, Refinement, faithful_preset, simplify, tuned_preset
from .beyond.refinement.refine import refine
from .checks import check_choice, check_seed
from .config import PAPER_TASKS, Config, paper_preset
from .evaluation import evaluate, rollout_from_seed, start_states
from .export import distances_latex
from .geometry import nearest
from .history import History
from .partition import Partition
from .policy import VoronoiPolicy
from .rollouts import Policy, collect_episodes, rollout, visited_states
from .tasks import Task, get_task, register, task_names
from .teachers import agent, load_teacher

__all__ = [
    "Config", "Faithful", "History", "Partition", "Policy", "Refinement", "Task", "VoronoiPolicy", "agent",
    "collect_episodes", "distances_latex", "distill", "evaluate", "explore", "get_task", "load_teacher",
    "merge_regions", "nearest", "preset", "prove", "refine", "register", "rollout", "rollout_from_seed", "simplify",
    "split_regions", "start_states", "task_names", "teacher_episodes", "visited_states",
]  # fmt: skip

_KINDS = ("paper", "faithful", "tuned")
_LATER = ("baselines", "beyond", "course", "paper", "show")


def distill(
    teacher: Policy, task: str | Task, config: Config | Refinement | Faithful | None = None, *, seed: int
) -> tuple[VoronoiPolicy, History | pd.DataFrame]:
    """Distil `teacher` to a `VoronoiPolicy`, by the method that the type of `config` selects.

    A `Config` selects the paper's method. Ours are a `Refinement` (few cells with a high return) and a `Faithful` (few
    cells with the teacher's actions and return). `teacher` is any object with `.predict(obs) -> (actions, None)` for
    batches. `config` defaults to the paper's preset; for a task that is not in the paper, it defaults to
    `preset(task, "faithful")` and prints the expected time. Returns the policy and its history: a `History` that a
    notebook can replay, or for our methods a table with a row per candidate. The same arguments give the same policy.
    Raises ValueError if the teacher does not fit the task, if states or actions are not finite, or if `seed` is not a
    non-negative integer.
    """
    check_seed(seed)
    task = get_task(task)
    if config is None and task.name not in PAPER_TASKS:
        from .beyond.refinement.duration import announcement  # slow to import

        config = faithful_preset(task)
        how = f"{task.name} is not in the paper: distilling by vsp.preset({task.name!r}, 'faithful')"
        print(f"{how}, {announcement(teacher, task, config)}")
    if isinstance(config, Refinement):
        return refine(teacher, task, config, seed=seed)
    if isinstance(config, Faithful):
        from .beyond.refinement.faithful import distill_faithfully  # slow to import

        return distill_faithfully(teacher, task, config, seed=seed)
    if config is not None and not isinstance(config, Config):
        kind = config if isinstance(config, str) and config in _KINDS else "faithful"
        raise ValueError(
            f"config is {config!r:.40}, expected a Config, a Refinement or a Faithful, such as "
            f"vsp.preset({task.name!r}, {kind!r})"
        )
    return algorithms.distill(teacher, task, config or paper_preset(task), seed=seed)


def preset(
    task: str | Task,
    kind: Literal["paper", "faithful", "tuned"] = "paper",
    *,
    n_cells: int | None = None,
    min_r2: float | None = None,
) -> Config | Refinement | Faithful:
    """Return the settings for `task`: the paper's (table T2, with the default readings), or ours.

    Ours are "faithful", for actions like the teacher's, in any task, and "tuned", for a high return alone. Two numbers
    constrain a faithful policy: `n_cells` is the largest number of cells, and `min_r2` is the least R² of its actions
    against the teacher's. Given `min_r2`, the policy maximises the return. `distill` takes the settings of one task for
    another too; they are tested for their own. Raises ValueError for an unknown task or kind, for a task without such
    settings, and for numbers that are out of range or belong to another kind.
    """
    check_choice("kind", kind, _KINDS)
    if kind == "faithful":
        return faithful_preset(task, n_cells=n_cells, min_r2=min_r2)
    if (n_cells, min_r2) != (None, None):
        raise ValueError(f"n_cells and min_r2 choose a 'faithful' policy, but kind is {kind!r}")
    return paper_preset(task) if kind == "paper" else tuned_preset(task)


def __getattr__(name: str) -> ModuleType | Callable:
    """Import the other subpackages and `vsp.explore` on first use, as in `vsp.paper.published_policy`."""
    if name == "explore":
        return importlib.import_module("vsp.show.explorer").explore
    if name in _LATER:
        return importlib.import_module(f"vsp.{name}")
    raise AttributeError(f"module 'vsp' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List what this file offers, also what is imported on first use."""
    return sorted({*__all__, *_LATER})
