"""vsp: distil reinforcement-learning policies to linear policies in Voronoi cells of the state space.

The modules of this folder implement the paper's method: start with `algorithms.py`. Its inputs are in tasks/,
subpolicies/ and teachers/. paper/ reproduces the paper, show/ draws figures, run/ runs jobs and notebooks. This file is
the public API: it checks arguments and resolves names of tasks. What goes beyond the paper is in the package
`vsp_beyond`.
"""

import functools
import importlib
import warnings
from collections.abc import Callable
from types import ModuleType

from . import algorithms, evaluation, rollouts
from .algorithms import MergePass, SplitPass, merge_regions, split_regions, teacher_episodes
from .cells import Halfspaces, Nearest
from .checks import check_seed
from .config import Config
from .config import paper_preset as preset
from .evaluation import Likeness, start_states
from .export import distances_latex
from .geometry import Metric, nearest
from .history import History
from .partition import Partition
from .policy import PiecewisePolicy, VoronoiPolicy
from .rollouts import Policy
from .run.progress import shown
from .subpolicies import PolicyClass
from .tasks import Task, get_task, register, task_names
from .teachers import agent, load_teacher

__all__ = [
    "Config", "Halfspaces", "History", "Metric", "Nearest", "Partition", "PiecewisePolicy", "Policy", "PolicyClass",
    "Task", "VoronoiPolicy", "agent", "collect_episodes", "distances_latex", "distill", "evaluate", "explore",
    "get_task", "likeness", "load_teacher", "merge_regions", "nearest", "preset", "register", "rollout",
    "rollout_from_seed", "split_regions", "start_states", "task_names", "teacher_episodes", "visited_states",
]  # fmt: skip

# Imported on first use: modules, and what they define
_LATER = {"paper": "vsp.paper", "show": "vsp.show"}
_LATER |= dict.fromkeys(("Method", "compare", "paper_method"), "vsp.protocol") | {"explore": "vsp.show.explorer"}


def distill(
    teacher: Policy, task: str | Task, config: Config | None = None, *, seed: int, split: SplitPass | None = None,
    merge: MergePass | None = None, progress: bool = True,
) -> tuple[VoronoiPolicy, History]:  # fmt: skip
    """Distil `teacher` to a `VoronoiPolicy` by the paper's method; its history can be replayed.

    `teacher` is whatever `agent` takes. `config` defaults to the paper's preset of the task. `split` and `merge`
    replace `split_regions` and `merge_regions`. The same arguments give the same policy. `progress` shows how far it
    is, and at last how alike teacher and policy are. Raises ValueError if the teacher does not fit the task, if states
    or actions are not finite, for a task without a preset, or if `seed` is not a non-negative integer."""
    check_seed(seed)
    task = get_task(task)
    if config is None:
        config = preset(task)
    if not isinstance(config, Config):
        raise ValueError(f"config is {config!r:.40}, expected a Config, such as vsp.preset({task.name!r})")
    if len(task.low) > 8 and config.neighbours == "delaunay":  # its time grows exponentially with the inputs
        warnings.warn(f"neighbours='delaunay' is slow with {len(task.low)} inputs: 'lookup' is not", stacklevel=2)
    teacher = agent(teacher, task)
    with shown(progress):
        policy, history = algorithms.distill(teacher, task, config, seed=seed, split=split, merge=merge)
        evaluation.remark(policy, teacher, task, config.n_iterations, "vsp_beyond.faithful")
    return policy, history


def likeness(policy: Policy, other: Policy, task: str | Task, n: int = 1000, *, seed: int = 7) -> Likeness:
    """Compare `policy` with the agent `other`: actions, returns and failures in n episodes from the starts of `seed`.
    An engine that is slow plays fewer. Raises ValueError unless both fit the task."""
    return evaluation.likeness(agent(policy, task), agent(other, task), task, n, seed=seed)


def _of_any_agent(function: Callable) -> Callable:
    """Return `function` of a policy as a function of whatever `agent` takes."""

    @functools.wraps(function)
    def of_any_agent(policy: Policy, task: str | Task, *arguments, **options):
        return function(agent(policy, task), task, *arguments, **options)

    return of_any_agent


evaluate, rollout_from_seed = _of_any_agent(evaluation.evaluate), _of_any_agent(evaluation.rollout_from_seed)
rollout, collect_episodes = _of_any_agent(rollouts.rollout), _of_any_agent(rollouts.collect_episodes)
visited_states = _of_any_agent(rollouts.visited_states)


def __getattr__(name: str) -> ModuleType | Callable:
    """Import on first use what `import vsp` leaves out, as in `vsp.paper.published_policy`."""
    if name not in _LATER:
        raise AttributeError(f"module 'vsp' has no attribute {name!r}")
    module = importlib.import_module(_LATER[name])
    return module if module.__name__ == f"vsp.{name}" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted({*__all__, *_LATER})
