"""`compare`: the paper's protocol for any methods. Runs that exist are read, those that are missing are made."""

import os
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sized
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import pandas as pd
from gymnasium.envs.registration import load_env_creator

from ..checks import check_array, check_seed
from ..evaluation import r_squared, start_states
from ..rollouts import Episodes, Outcomes, Policy, collect_episodes, record, rollout
from ..run.identity import identity
from ..tasks import GOAL, Task, get_task
from ..tasks.registry import is_own
from ..teachers import agent, digest_of, load_teacher
from .intervals import crossed_interval
from .job import EVALUATION_SEED, LIBRARIES, N_EPISODES, Job, make_all, provenance, settings_id
from .method import Method

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = ["task", "method", "policies", "mean", "low", "high", "failing", "cells", "r2", "seconds"]
AGENT, _ITSELF = "agent", Method(lambda agent, *_: agent, name="the agent itself", version=1)
Make = Callable[[Policy, Task, Episodes | None, int], Policy]
Returns = np.ndarray | Mapping[str, np.ndarray]  # (runs, episodes), or by name of the task
_PLAYED: dict[str, tuple[Outcomes, Episodes]] = {}  # by agents, for the next run in the same process


@dataclass(frozen=True)
class Comparison:
    """How methods do: a frame with a row per task and method, and the returns (runs, episodes) behind each row.

    Columns: task, method, policies (how many), mean (return), low and high (its 95 % interval over policies *and* start
    states), failing (share of the episodes that miss the goal; NaN for a task where nobody reaches one, and for returns
    from elsewhere), cells (mean), r2 (median R² of the actions on the agent's own states) and seconds (median)."""

    frame: pd.DataFrame
    returns: dict[tuple[str, str], np.ndarray]

    def _repr_html_(self) -> str:
        return self.frame.to_html(index=False)

    def __str__(self) -> str:
        return self.frame.to_string(index=False)

    def plot(self, task: str | Task, ax: "Axes | None" = None) -> "Axes":
        """Draw the mean returns of one task with their intervals, on `ax` or a new figure. Returns the axes."""
        from ..show import intervals, panels

        name, ax = get_task(task).name, panels(1)[1][0] if ax is None else ax
        rows = self.frame[self.frame["task"] == name].set_index("method")
        intervals(ax, rows.rename(columns={"mean": "here"})).set(xlabel="mean return (95 %)", title=name)
        return ax

    def to_latex(self) -> str:
        """Return the frame as a table for LaTeX; needs booktabs."""
        return self.frame.to_latex(index=False, float_format="%.3f", na_rep="", escape=True)


@dataclass(frozen=True)
class Trial(Job):
    """One policy of one method, and its evaluation."""

    method: Method
    where: str | Task  # the task; a name may begin with a module, which a worker then imports
    agent: Policy
    seed: int
    most: int  # episodes; a slow engine plays fewer
    kind = "Trial"

    def __post_init__(self) -> None:
        if not isinstance(self.where, str) or ":" not in self.where:  # else a worker may not know the name
            object.__setattr__(self, "where", get_task(self.where))

    @property
    def task(self) -> str:
        """The name of the task."""
        return get_task(self.where).name

    @property
    def n_episodes(self) -> int:
        """The number of episodes."""
        slowness = get_task(self.where).slowness
        return self.most if slowness == 1 else max(10, self.most // slowness)

    @cached_property
    def provenance(self) -> dict[str, str | int]:
        """What identifies the trial: settings (an id), agent, version."""
        task = get_task(self.where)
        settings = {"task": _task_identity(task), "method": self.method.identity(task), "n": self.n_episodes}
        settings |= {"start seed": EVALUATION_SEED, "versions": LIBRARIES}
        return provenance(settings, digest_of(self.agent), self.method.version or 0)

    def make(self) -> tuple[dict[str, np.ndarray], dict]:
        """Make a policy, and play it from the start states that all share."""
        task, agent, data = get_task(self.where), self.agent, None
        if self.method.n_data:
            starts = task.start(np.random.default_rng(np.random.SeedSequence([self.seed, 1])), self.method.n_data)
            data = collect_episodes(agent, task, starts)
        began = time.perf_counter()
        policy = self.method.make(agent, task, data, self.seed)
        seconds = time.perf_counter() - began
        starts = start_states(task, self.n_episodes, EVALUATION_SEED)
        key = settings_id([_task_identity(task), digest_of(agent), self.n_episodes])
        if key not in _PLAYED:
            _PLAYED[key] = record(agent, task, starts)
        outcomes, seen = rollout(policy, task, starts), _PLAYED[key][1]
        half = (task.action_high - task.action_low) / 2
        r2 = r_squared(np.asarray(policy.predict(seen.states)[0]) / half, seen.actions / half)
        cells = len(policy) if isinstance(policy, Sized) else None
        return asdict(outcomes), {"seconds": seconds, "cells": cells, "r2": r2}


def compare(
    methods: Mapping[str, Method | Make | Returns], tasks: Iterable[str | Task],
    agents: Mapping[str, Policy] | None = None, *, seeds: Iterable[int] = range(20), n_episodes: int = N_EPISODES,
    runs: str | os.PathLike = "build/comparison", jobs: int | str = 1,
) -> Comparison:  # fmt: skip
    """Compare `methods`, by name, with the same agents, seeds and start states.

    A method is a `Method`, or the function `make` of one that needs no data. Beside them may stand returns that were
    made elsewhere, (runs, episodes), where each run has the same starts; for several tasks, a dictionary by name.
    `agents`: by name of the task, as `vsp.agent` takes them; None: those shipped. Each trial is a file below `runs` and
    is made once; `jobs` as in `run.workers`. Episodes start from `start_states(task, n_episodes, 1)`, which no method
    may train on; a task whose engine is slow plays fewer. Raises ValueError for a method or an agent that cannot be
    identified, and for returns that do not fit."""
    asked, seeds = {get_task(task).name: task for task in tasks}, list(seeds)
    made = {name: one if isinstance(one, Method) else Method(one) for name, one in methods.items() if callable(one)}
    if AGENT in methods or not seeds:
        raise ValueError(
            f"methods are {[*methods]} with seeds {seeds}, expected seeds, and another name than {AGENT!r}"
        )
    trials = {}
    for task, where in asked.items() if made else ():
        teacher = agent((agents or {}).get(task) or load_teacher(task), where)
        for name, method in {AGENT: _ITSELF, **made}.items():
            trials[task, name] = [
                Trial(method, where, teacher, seed, n_episodes) for seed in (seeds if name != AGENT else [0])
            ]
        _check_apart({name: trials[task, name][0] for name in made})
    make_all((trial for group in trials.values() for trial in group), runs, "comparing", jobs=jobs, unit="trials")
    rows, returns = [], {}
    for task in asked:
        for name in (AGENT, *methods):
            if (task, name) in trials:
                loaded = [trial.load(runs) for trial in trials[task, name]]
                returns[task, name] = np.stack([arrays["returns"] for arrays, _ in loaded])
                rows.append(_row(task, name, returns[task, name]) | _measured(loaded))
            elif not callable(given := methods.get(name)) and (values := _returns(name, given, task, asked)).size:
                returns[task, name] = values
                rows.append(_row(task, name, values))
    frame = pd.DataFrame(rows).reindex(columns=COLUMNS)
    reached = frame.groupby("task")["failing"].transform("min") < 1
    return Comparison(frame.assign(failing=frame["failing"].where(reached)), returns)


def _check_apart(trials: dict[str, Trial]) -> None:
    """Raise ValueError if different methods have the same identity, so that one would load the other's trials."""
    known: dict[Path, Trial] = {}
    for name, trial in trials.items():
        check_seed(trial.seed)
        if known.setdefault(trial.path(""), trial).method != trial.method:
            raise ValueError(f"{name!r} has the name, version and settings of another method, expected its own")


def _returns(name: str, given: Any, task: str, tasks: Collection[str]) -> np.ndarray:
    """Return the returns (runs, episodes) of a task that were made elsewhere; empty if there are none."""
    if given is not None and not isinstance(given, Mapping) and len(tasks) > 1:
        raise ValueError(f"the returns of {name!r} are one array, expected one by name of the task: {[*tasks]}")
    given = given.get(task) if isinstance(given, Mapping) else given
    return np.zeros((0, 0)) if given is None else check_array(f"the returns of {name!r}", given, (-1, -1))


def _row(task: str, name: str, returns: np.ndarray) -> dict[str, Any]:
    low, high = crossed_interval(returns)
    return {"task": task, "method": name, "policies": len(returns), "mean": returns.mean(), "low": low, "high": high}


def _measured(loaded: list[tuple[dict, dict]]) -> dict[str, float]:
    """Return what trials show beside their returns."""
    missed = np.mean([arrays["outcomes"] != GOAL for arrays, _ in loaded])
    told = pd.DataFrame([about for _, about in loaded])[["cells", "r2", "seconds"]].astype(float)
    return {"failing": missed, **told.median(), "cells": told["cells"].mean()}


def _task_identity(task: Task) -> Any:
    """Return the name of a task of vsp; for others also what they do, or the class of their environment."""
    if is_own(task):
        return task.name
    if task.one_by_one:
        spec = gymnasium.spec(task.name)
        maker = load_env_creator(spec.entry_point) if isinstance(spec.entry_point, str) else spec.entry_point
        outcome = getattr(task.step, "args", None)  # what `vsp.register` was given
        return [task.name, identity(maker), identity(spec.kwargs), identity(outcome), task.max_steps]
    return identity(task)
