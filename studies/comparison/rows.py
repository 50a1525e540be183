"""Make the rows of the comparison, and the policies and tables that are kept beside them.

The methods of a table have the same start states and, unless their names say otherwise, the same teacher and budget.
`make beyond` and `make beyond-long` make the missing rows. Distillation times differ from run to run, so they are in
a separate file, <table>_seconds.csv.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from vsp import VoronoiPolicy, get_task, load_teacher, start_states
from vsp.paper.results import load_made, make_missing, provenance, provenance_folder
from vsp.rollouts import rollout
from vsp.run import listed, sealed
from vsp.run.progress import progress
from vsp.tasks.base import GOAL
from vsp.teachers.teacher import Teacher, further_teachers
from vsp_beyond import optimum, simplify
from vsp_beyond.few_cells.units import METRIC
from vsp_beyond.optimum.grid import GridPolicy

from ..results import BEYOND, write_results
from ..robots import record_gait
from . import measure
from .makers import Budget
from .methods import ALIKE, CHEETAH, FOUND, LANDER, METHODS, PRESETS, TABLES, Method, methods_of, sizes_of

LOSS = 0.02  # share of the teacher's mean return that the simplified policy may lose
SIMPLIFY_VERSION = 1  # raise it when `simplify` returns a different policy
GAIT, GAIT_VERSION = {"start": 0.0, "n_steps": 200}, 2  # raise the version when the same policy gives another gait
OPTIMUM_VERSION = 1  # raise it when the best policies give different returns
# Tasks, and how much finer the grid is; the difference between two returns of a task shows the grid's error
WAYS = ((optimum.TASKS[0], 1.0), *((task, finer) for task in optimum.TASKS[1:] for finer in (1.0, 2.0)))


@dataclass(frozen=True)
class Job:
    """One row to make: a method at a size, with a seed. Size 0: the method finds its own size."""

    task: str
    method: str
    size: int
    seed: int
    agent: int = 0  # which teacher: 0 is the shipped one, the others are those of `further_teachers`
    tail: bool = False  # whether the worst returns are measured too

    @property
    def how(self) -> Method:
        """The method."""
        return METHODS[self.method]

    @property
    def whole(self) -> bool:
        """Whether a slow task is played from as many starts as others: at the limit, small differences count."""
        return get_task(self.task).slowness > 1 and self.how.preset == "limit"

    @property
    def start_seed(self) -> int:
        """The seed of the start states; for robots, and at the limit on LunarLander, not that of earlier versions."""
        if self.whole:
            return measure.LIMIT_SEED
        return measure.NEW_SEED if self.how.preset == "walking" else measure.REPORT_SEED

    @property
    def provenance(self) -> dict[str, str | int]:
        """What identifies the row besides its seed: settings (an id), teacher, version."""
        how, config = self.how, PRESETS[self.how.preset](self.task)
        about: dict = {"task": self.task, "method": self.method, "size": self.size}
        about["settings"] = {name: getattr(config, name) for name in how.reads} | how.settings
        about["measure"] = measure.settings(tail=self.tail, whole=self.whole, seed=self.start_seed)
        about["measure"] |= {"states": measure.N_COMMON} if how.preset in ALIKE else {}
        return provenance(about, _teacher(self.task, self.agent).digest, how.version)

    def path(self, folder: str | os.PathLike) -> Path:
        """Return the path of the row's file in `folder`."""
        return provenance_folder(folder, self.task, self.provenance) / f"{self.seed:04d}.row"

    def about(self) -> dict:
        """Return what the row's file says about the row."""
        named = {"task": self.task, "method": self.method, "size": self.size, "seed": self.seed}
        return {**named, **self.provenance}  # provenance has the teacher's checksum; its settings include the tail

    def policy(self, folder: str | os.PathLike) -> VoronoiPolicy:
        """Load the policy in the row's file, which must hold one."""
        arrays, _ = load_made(self.path(folder), "Row", self.about())
        return VoronoiPolicy(**arrays, task=self.task, metric=METRIC)


@cache
def _teacher(task: str, agent: int) -> Teacher:
    return load_teacher(list(further_teachers(task).values())[agent - 1] if agent else task)


def jobs_of(task: str, table: str = "methods") -> list[Job]:
    """List all rows of a task in `table`, a key of `TABLES[task]`."""
    about = TABLES[task][table]
    return [
        Job(task, name, size, seed, agent, about.tail)
        for name, method in methods_of(task, table).items()
        for size in sizes_of(task, method, about)
        for agent in about.agents
        for seed in _seeds(task, table, method, size)
    ]


def _seeds(task: str, table: str, method: Method, size: int) -> range:
    about = TABLES[task][table]
    main = size in (*FOUND, PRESETS[method.preset](task).n_cells)
    seeds = about.seeds if main or about.fewer is None else about.fewer
    return seeds if method.chance else seeds[:1]


def make_row(job: Job) -> tuple[dict, dict]:
    """Distil and measure one policy. Returns the arrays (of Voronoi cells only) and the metadata of the row's file."""
    teacher = _teacher(job.task, job.agent)
    budget = Budget(teacher, get_task(job.task), PRESETS[job.how.preset](job.task))
    began = time.perf_counter()
    policy = job.how.make(budget, job.size, job.seed, **job.how.settings)
    seconds = time.perf_counter() - began
    row = measure.measure(policy, teacher, budget.task, tail=job.tail, whole=job.whole, seed=job.start_seed)
    row |= measure.fidelity(policy, teacher, budget.task) if job.how.preset in ALIKE else {}
    arrays = {}
    if isinstance(policy, VoronoiPolicy):
        arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
    return arrays, {"kind": "Row", **job.about(), "row": row, "seconds": seconds}


def make_all(folder: str | os.PathLike, todo: list[Job], *, jobs: int | str = 1) -> None:
    """Make the rows of `todo` that are missing in `folder`, lower seeds first; `jobs` as in `workers`."""
    todo = sorted(todo, key=lambda job: job.seed)
    make_missing(make_row, {job.path(folder): (job,) for job in todo}, "beyond", jobs=jobs, unit="rows")


def rows(folder: str | os.PathLike, wanted: list[Job]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the results, one row per job, and the time each took. Raises `atomic.DamagedFile`."""
    results, times = [], []
    for job in wanted:
        _, about = load_made(job.path(folder), "Row", job.about())
        what = {"method": job.method, "size": job.size, "seed": job.seed} | ({"agent": job.agent} if job.agent else {})
        results.append({**what, **about["row"], **job.provenance})
        times.append({"task": job.task, **what, "seconds": about["seconds"]})
    return pd.DataFrame(results), pd.DataFrame(times)


def by_seed(jobs: list[Job]) -> dict[Job, list[Job]]:
    """Return the jobs that differ only in their seed, by the one with seed 0. Their provenance is the same."""
    kinds: dict[Job, list[Job]] = {}
    for job in jobs:
        kinds.setdefault(replace(job, seed=0), []).append(job)
    return kinds


# Policies and tables beside the rows


def kept_jobs(task: str, table: str) -> dict[str, Job]:
    """Return the rows of a table whose policies are kept, by file: the preset's size first, all of the first seed."""
    about = TABLES[task][table]
    if not about.keeps:
        return {}
    preset = PRESETS[METHODS[about.keeps].preset](task).n_cells
    sizes = {"": preset, **{f"_size_{size}": size for size in about.keeps_also}}
    return {
        f"{table}_{task}{suffix}.policy": Job(task, about.keeps, size, 0, tail=about.tail)
        for suffix, size in sizes.items()
    }


def extras(task: str, table: str) -> Iterator[tuple[str, list[dict], Callable[[Path, Path], None]]]:
    """Yield the files of a table beside that of its rows: name, provenance of each row, and a function that writes it.

    The function takes the folder of the rows and OUT; the file goes to OUT/data/beyond.
    """
    if table == "faithful":
        pairs = (
            {**kind.provenance, "seed": a.seed, "other": b.seed}
            for kind, jobs in by_seed(jobs_of(task, table)).items()
            for a, b in combinations(jobs, 2)
        )
        yield f"same_{task}.csv", list(pairs), partial(_write_sameness, task)
    for name, job in kept_jobs(task, table).items():
        yield name, [job.provenance], partial(_keep_job, name, job)
        if task == CHEETAH:
            made_with = job.provenance
            walks = provenance({"policy": made_with, "table": "gait", **GAIT}, made_with["teacher"], GAIT_VERSION)
            yield f"gait_{task}.csv", [walks], partial(_write_gait, job, walks)
    if (table, task) == ("methods", LANDER):
        kept, about = f"{table}_{task}.policy", simplest_provenance(task)
        yield kept, [about], lambda folder, out: _keep(simplest(task), out / BEYOND / kept, about)


def _write_sameness(task: str, folder: Path, out: Path) -> None:
    """Compare the faithful policies of different seeds, one row per size and pair."""
    tables = []
    for kind, jobs in by_seed(jobs_of(task, "faithful")).items():
        policies = {job.seed: job.policy(folder) for job in jobs}
        table = measure.sameness(policies, load_teacher(task), get_task(task)).assign(**kind.provenance)
        table.insert(0, "size", kind.size)
        tables.append(table)
    write_results(pd.concat(tables, ignore_index=True), f"same_{task}", out=out)


def _write_gait(job: Job, made_with: dict, folder: Path, out: Path) -> None:
    gait = record_gait(job.policy(folder), job.task, **GAIT)
    write_results(gait.assign(**made_with), f"gait_{job.task}", out=out)


def simplest(task: str) -> VoronoiPolicy:
    """Make the simplest policy that loses at most `LOSS` of the teacher's mean return. Takes about ten minutes."""
    teacher, config = load_teacher(task), PRESETS["tuned"](task)
    starts = start_states(get_task(task), config.n_validation, 0)
    of_teacher = rollout(teacher, get_task(task), starts).returns.mean()
    return simplify(teacher, task, config, tolerance=LOSS * abs(of_teacher), seed=0)[0]


def simplest_provenance(task: str) -> dict[str, str | int]:
    """Return the provenance of the policy of `simplest`: what determines it besides the seed, which is 0."""
    settings = {"task": task, "loss": LOSS, **asdict(PRESETS["tuned"](task))}
    return provenance(settings, load_teacher(task).digest, SIMPLIFY_VERSION)


def _keep_job(name: str, job: Job, folder: Path, out: Path) -> None:
    _keep(job.policy(folder), out / BEYOND / name, job.provenance)


def _keep(policy: VoronoiPolicy, path: Path, made_with: dict) -> None:
    policy.save(path)
    arrays, about = sealed.load_arrays(path, kind="VoronoiPolicy")
    sealed.save_arrays(path, arrays, about | made_with)
    listed.list_file(path)


# The best policies


def best_returns() -> pd.DataFrame:
    """Return the returns of the best policies, one row per task and way to find them. A task's last row is its best.

    Columns: task, found (how: "closed form", or the points of the grid), mean, worst, failing (share of the episodes
    that miss the goal; NaN for a task without a goal), longest (steps), and the provenance. Takes about five minutes.
    """
    return pd.DataFrame([_best(*way) for way in progress(WAYS, "optimum", total=len(WAYS), unit="policies")])


def _best(name: str, finer: float) -> dict:
    """Return the row of a task, from a grid with `finer` times the points in each variable."""
    task = get_task(name)
    policy, starts = optimum.best_policy(task, finer=finer), start_states(task, measure.N_REPORTED, measure.REPORT_SEED)
    result = rollout(policy, task, starts)
    if isinstance(policy, GridPolicy):
        returns, how = result.returns, "{} × {} points".format(*policy.grid.shape)
    else:
        returns, how = optimum.best_returns(starts), "closed form"
    failing = np.nan if name == "Pendulum-v1" else np.mean(result.outcomes != GOAL)  # nothing can fail there
    row = {"task": name, "found": how, "mean": returns.mean(), "worst": returns.min(), "failing": failing}
    return row | {"longest": result.lengths.max()} | best_provenance(name, finer)


def best_provenance(task: str, finer: float) -> dict[str, str | int]:
    """Return the provenance of a row of `best_returns`. Its teacher is "none"."""
    starts = [measure.REPORT_SEED, measure.N_REPORTED]
    return provenance({"task": task, "finer": finer, "starts": starts}, "none", OPTIMUM_VERSION)
