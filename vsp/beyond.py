"""The comparison beyond the paper: every method at every size, from the same teachers, budgets and starts, on disk.

`make beyond` makes the rows that are missing; data/results/beyond_<task>.csv holds what came out, one row per method,
size and seed. How long a distillation took differs from run to run and has a file of its own, beyond_seconds.csv. Of
tasks whose rows take hours, one simplified policy is kept too, beyond_<task>.policy.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache, partial
from pathlib import Path

import pandas as pd

from . import methods, paper, store, tdavq, workers
from .config import Config, Refinement, preset
from .envs import get_task
from .evaluate import start_states
from .experiments import code_id
from .measure import measure
from .methods import Budget
from .policy import VoronoiPolicy
from .race import race
from .rollouts import Policy, play
from .simplify import simplify
from .teachers import load_teacher

TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1")
LONG = ("LunarLanderContinuous-v3",)  # whose rows take hours
SEEDS, FEW_SEEDS = range(20), range(5)  # of rows, and of those that take long
LOSS = 0.02  # share of the teacher's mean return that the simplified policy of a long task may lose

SIZES = (1, 2, 3, 4, 8, 13, 32)  # cells or leaves
OWN = (0,)
REFINE = ("refine", "crowd")  # modules
EPISODES = ("n_episodes", "n_corrections", "n_correction_episodes", "n_validation", "failure_price")
ALL = tuple(field.name for field in fields(Refinement) if field.name != "n_cells")
PAPER = tuple(field.name for field in fields(Config))  # of the paper's preset

# `refined` that stays close to its teacher
FAITHFUL = {"n_generations": 300, "n_tuning_episodes": 500, "tuning_step": 0.01, "error_price": 30.0}


@dataclass(frozen=True)
class Method:
    """How a policy is made: `make(budget, size, seed, **settings)`."""

    make: Callable[..., Policy]
    code: tuple[str, ...] = ()  # modules that decide what comes out
    reads: tuple[str, ...] = ()  # settings of the budget that do; empty: none
    settings: dict = field(default_factory=dict)
    sizes: tuple[int, ...] = SIZES  # cells or leaves; `OWN` where the method finds its own number
    chance: bool = True  # whether the seed matters
    tasks: tuple[str, ...] | None = None  # None: for all


def _by_dagger(
    fit: Callable[..., Policy], module: str, *, beginnings: int = 1, rounds: int = 5, sizes: tuple[int, ...] = SIZES
) -> Method:
    settings = {"rounds": rounds, "beginnings": beginnings}
    return Method(partial(methods.corrected, fit=fit), (module, "baselines", *REFINE), EPISODES, settings, sizes)


METHODS = {
    "refined": Method(methods.refined, REFINE, ALL),
    "refined, not tuned": Method(methods.refined, REFINE, ALL, {"n_generations": 0}),
    "refined, no teacher": Method(methods.untaught, (*REFINE, "baselines"), ALL, sizes=(3, 4)),  # those of presets
    "refined, closest": Method(methods.closest, (*REFINE, "moves"), ALL, sizes=(13,)),
    "refined, faithful": Method(
        methods.faithful, (*REFINE, "moves"), ALL, FAITHFUL, sizes=(13,), tasks=paper.TASKS[:1]
    ),
    "k-means cells, DAgger": _by_dagger(methods.kmeans, "baselines", beginnings=3),
    "CART": Method(partial(methods.alone, fit=methods.tree), ("trees", "baselines", *REFINE), EPISODES),
    "CART, DAgger": _by_dagger(methods.tree, "trees"),
    "CART, linear leaves, DAgger": _by_dagger(methods.linear_tree, "trees"),
    "oblique tree, linear leaves, DAgger": _by_dagger(methods.oblique_linear_tree, "trees", beginnings=2),
    "soft tree, DAgger": _by_dagger(methods.soft_tree, "trees", rounds=2, sizes=(2, 4, 8, 32)),  # powers of two
    "teacher": Method(methods.the_teacher, sizes=OWN, chance=False),
    "one linear map": Method(partial(methods.alone, fit=methods.line), ("baselines", *REFINE), EPISODES, sizes=OWN),
    "rule of thumb": Method(methods.by_thumb, ("baselines",), sizes=OWN, chance=False, tasks=paper.TASKS),
    "heuristic": Method(methods.by_hand, ("baselines",), sizes=OWN, chance=False, tasks=("Pendulum-v1", *LONG)),
    "TD-AVQ": Method(methods.td_avq, ("tdavq",), sizes=OWN, tasks=paper.TASKS[:1]),
    "TD-AVQ, coarse": Method(methods.td_avq, ("tdavq",), settings=tdavq.COARSE, sizes=OWN, tasks=paper.TASKS[:1]),
    "the paper's method": Method(methods.paper_method, reads=PAPER, sizes=OWN, tasks=paper.TASKS),
}

# `refined` at the size of the preset, with one more part taken away
ABLATION = {
    "cold from the start": {"hottest": 0.04},
    "one beginning": {"n_restarts": 1},
    "not corrected": {"n_corrections": 0},
    "no leak": {"leak": 1e-9},
    "not tuned": {"n_generations": 0},
    "failures at no price": {"failure_price": 0.0},
    "no teacher": {},
    "drawn by stakes": {"stakes": True},
}


@dataclass(frozen=True)
class Job:
    """One row to come: a method at a size, with a seed. Size 0: the method's own."""

    task: str
    method: str
    size: int
    seed: int

    @property
    def how(self) -> Method:
        """The method, or `refined` with a part taken away."""
        if self.method in METHODS:
            return METHODS[self.method]
        return replace(METHODS["refined"], settings=ABLATION[self.method.removeprefix("refined, ")])

    @property
    def key(self) -> str:
        """Sixteen hexadecimal digits that stand for all that decides the row, teacher and code included."""
        how = self.how
        budget = preset(self.task, "paper" if how.reads == PAPER else "best")
        settings = {name: getattr(budget, name) for name in how.reads} | how.settings
        about = [asdict(self), settings, _code(how.code), _teacher(self.task)]
        return hashlib.sha256(json.dumps(about).encode()).hexdigest()[:16]

    def path(self, folder: str | os.PathLike) -> Path:
        """Its file."""
        return Path(folder) / self.task / f"{self.key}.row"


@cache
def _code(modules: tuple[str, ...]) -> str:
    return code_id("measure", "methods", *modules)


@cache
def _teacher(task: str) -> str:
    return load_teacher(task).digest


def jobs_of(task: str) -> list[Job]:
    """All rows of a task."""
    found, several = [], FEW_SEEDS if task in LONG else SEEDS
    for name, method in METHODS.items():
        if method.tasks is None or task in method.tasks:
            seeds = several if method.chance else several[:1]
            found += [Job(task, name, size, seed) for size in method.sizes for seed in seeds]
    size = preset(task, "best").n_cells
    names = [name for part in ABLATION if (name := f"refined, {part}") not in METHODS and task not in LONG]
    return found + [Job(task, name, size, seed) for name in names for seed in several]


def make_row(job: Job) -> dict:
    """Distil and play: what the file of the row tells."""
    budget = Budget(load_teacher(job.task), get_task(job.task), preset(job.task, "best"))
    began = time.perf_counter()
    policy = job.how.make(budget, job.size, job.seed, **job.how.settings)
    seconds = time.perf_counter() - began
    row = measure(policy, budget.teacher, budget.task)
    return {"kind": "Row", "job": asdict(job), "row": row, "seconds": seconds}


def make_all(folder: str | os.PathLike, *, jobs: int | str = 1, tasks=TASKS) -> None:
    """Make the rows that are missing in `folder`; `jobs` as in `workers`."""
    asked = [job for task in tasks for job in jobs_of(task)]
    missing = [job for job in asked if not job.path(folder).exists()]
    made = workers.results(make_row, [(job,) for job in missing], "beyond", jobs=jobs, total=len(asked), unit="rows")
    for i, about in made:
        store.save(missing[i].path(folder), {}, about)


def rows(folder: str | os.PathLike, task: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What came out for `task`, one row per job, and how long each took."""
    found = [(job, store.load(job.path(folder), kind="Row")[1]) for job in jobs_of(task)]
    about = [{"method": job.method, "size": job.size, "seed": job.seed} for job, _ in found]
    frame = pd.DataFrame([{**what, **one["row"], "key": job.key} for what, (job, one) in zip(about, found)])
    return frame, pd.DataFrame(
        [{"task": task, **what, "seconds": one["seconds"]} for what, (_, one) in zip(about, found)]
    )


def simplest(task: str) -> VoronoiPolicy:
    """The simplest policy that loses at most `LOSS` of what the teacher returns; made anew, in about ten minutes."""
    teacher, config = load_teacher(task), preset(task, "best")
    starts = start_states(get_task(task), config.n_validation, 0)
    own = play(teacher, get_task(task), starts).returns.mean()
    return simplify(teacher, task, config, tolerance=LOSS * abs(own), seed=0)[0]


def stale(folder: str | os.PathLike) -> list[str]:
    """Which of the results in `folder` were made with other settings or code than today's, in words."""
    found = []
    for task in (*TASKS, *LONG):
        path, target = Path(folder) / f"beyond_{task}.csv", "beyond-long" if task in LONG else "beyond"
        try:
            made = set(store.read_table(path, dtype={"key": str})["key"])
        except FileNotFoundError:
            found.append(f"data/results/{path.name} is missing: `make {target}` makes it")
            continue
        except store.DamagedFile as error:
            found.append(str(error))
            continue
        if made != {job.key for job in jobs_of(task)}:
            found.append(f"data/results/{path.name} was made with other settings or code: `make {target}` renews it")
    return found


def main() -> None:
    """Make the rows that are missing, and write data/results/beyond_<task>.csv and, with times, beyond_seconds.csv and
    beyond_race.csv; or the rows that take hours, their times in beyond_seconds_long.csv, and beyond_<task>.policy."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="results go to OUT/data/results, rows to OUT/build/beyond")
    parser.add_argument("--jobs", type=workers.jobs, default=-1, help=workers.JOBS)
    parser.add_argument("--long", action="store_true", help="the tasks whose rows take hours")
    arguments = parser.parse_args()
    folder, results = Path(arguments.out) / "build" / "beyond", Path(arguments.out) / "data" / "results"
    tasks, end = (LONG, "_long") if arguments.long else (TASKS, "")
    make_all(folder, jobs=arguments.jobs, tasks=tasks)
    found = {task: rows(folder, task) for task in tasks}
    for task, (frame, _) in found.items():
        text = frame.to_csv(index=False, float_format="%.6f", lineterminator="\n")
        store.write_listed(results / f"beyond_{task}.csv", text)
    for task in tasks if arguments.long else ():
        simplest(task).save(results / f"beyond_{task}.policy")
        store.list_file(results / f"beyond_{task}.policy")
    times = {f"seconds{end}": pd.concat([took for _, took in found.values()])}
    times |= {} if arguments.long else {"race": race()}
    for name, frame in times.items():
        store.write_listed(results / f"beyond_{name}.csv", frame.to_csv(index=False, float_format="%.6f"))


if __name__ == "__main__":
    from vsp.beyond import main  # of the module by its name, under which workers find what it holds

    with workers.in_one_line():
        main()
