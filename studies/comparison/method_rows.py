"""Make the rows of the comparison beyond the paper: every method at every size.

The methods of a table have the same start states and, unless their names say otherwise, the same teacher and budget.
`make beyond` and `make beyond-long` make the missing rows.
data/results/<table>_<task>.csv holds the results, one row per method, size and seed. Distillation times differ from run
to run, so they are in a separate file, <table>_seconds.csv.
"""

from __future__ import annotations

import os
import time
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import pandas as pd

from vsp.config import Config, paper_preset
from vsp.paper.readings import Readings
from vsp.paper.results import load_made, make_missing, provenance, provenance_folder
from vsp.policy import VoronoiPolicy
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import Teacher, further_teachers, load_teacher
from vsp_beyond.few_cells import limit
from vsp_beyond.few_cells.config import Faithful, Tuned, faithful_preset, tuned_preset
from vsp_beyond.few_cells.units import METRIC

from ..robots import Walking, walking_preset
from . import measure
from .method_tables import (
    ABLATION,
    ALIKE,
    APART,
    DEMANDED,
    LIKE,
    LIMIT,
    LONG,
    LONG_TABLES,
    METHODS,
    OWN,
    RIVALS,
    ROBOT_TABLES,
    ROBOTS,
    STARTS,
    TABLES,
    WALKERS,
    Method,
    Table,
)
from .methods import Budget
from .sameness import sameness


@dataclass(frozen=True)
class Job:
    """One row to make: a method at a size, with a seed. Size 0: the method finds its own size."""

    task: str
    method: str
    size: int
    seed: int
    agent: int = 0  # which teacher: 0 is the shipped one, others are in `AGENTS`
    tail: bool = False  # whether the worst returns are measured too

    @property
    def how(self) -> Method:
        """The method, or `refined` with one part removed."""
        if self.method in (known := METHODS | RIVALS | LIKE | APART | DEMANDED | LIMIT | STARTS | ROBOTS):
            return known[self.method]
        return replace(METHODS["refined"], settings=ABLATION[self.method.removeprefix("refined, ")])

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
        how, about = self.how, {"task": self.task, "method": self.method, "size": self.size}
        budget = preset(self.task, how.preset)
        about["settings"] = {name: getattr(budget, name) for name in how.reads} | how.settings
        about["settings"] |= asdict(Readings()) if how.preset == "paper" else {}
        about["measure"] = measure.settings(tail=self.tail, whole=self.whole, seed=self.start_seed)
        about["measure"] |= measure.common() if how.preset in ALIKE else {}
        return provenance(about, _teacher(self.task, self.agent).digest, how.version)

    def path(self, folder: str | os.PathLike) -> Path:
        """Return the path of the row's file in `folder`."""
        return provenance_folder(folder, self.task, self.provenance) / f"{self.seed:04d}.row"

    def about(self) -> dict:
        """Return what the row's file says about the row."""
        named = {"task": self.task, "method": self.method, "size": self.size, "seed": self.seed}
        return {**named, **self.provenance}  # provenance has the teacher's checksum; its settings include the tail


def preset(task: str, kind: str) -> Tuned | Faithful | Config | Walking:
    """Return the preset of this kind for `task`."""
    kinds = {
        "tuned": tuned_preset, "paper": paper_preset, "faithful": faithful_preset, "limit": limit.limit_preset,
        "walking": walking_preset,
    }  # fmt: skip
    return kinds[kind](task)


@cache
def _teacher(task: str, agent: int) -> Teacher:
    """Return the shipped teacher of a task (0), or one of its further teachers, by number."""
    return load_teacher(list(further_teachers(task).values())[agent - 1] if agent else task)


def jobs_of(task: str, table: str = "beyond") -> list[Job]:
    """List all rows of a task in `table`, a key of `tables_of(task)`."""
    about, found = tables_of(task)[table], []
    for name, method in about.methods.items():
        if method.tasks is None or task in method.tasks:
            for size in _sizes(task, method, about):
                seeds = _seeds(task, method, about, size)
                found += [Job(task, name, size, seed, agent, about.tail) for agent in about.agents for seed in seeds]
    if table != "beyond" or task in LONG:
        return found
    names = [name for part in ABLATION if (name := f"refined, {part}") not in METHODS]
    return found + [Job(task, name, tuned_preset(task).n_cells, seed) for name in names for seed in about.seeds]


def _sizes(task: str, method: Method, about: Table) -> tuple[int, ...]:
    if about.at_preset and method.sizes != OWN:
        return (preset(task, method.preset).n_cells,)
    return tuple(size for size in method.sizes if about.sizes is None or size in about.sizes)


def _seeds(task: str, method: Method, about: Table, size: int) -> range:
    own = size in (OWN[0], preset(task, method.preset).n_cells) if about.fewer != about.seeds else True
    seeds = about.seeds if own else about.fewer
    return seeds if method.chance else seeds[:1]


def tables_of(task: str) -> dict[str, Table]:
    """Return the tables in which a task has rows."""
    tables = ROBOT_TABLES if task in WALKERS else LONG_TABLES if task in LONG else TABLES
    return {name: table.of(task) for name, table in tables.items() if table.has(task)}


def make_row(job: Job) -> tuple[dict, dict]:
    """Distil and measure one policy. Returns the arrays (of Voronoi cells only) and the metadata of the row's file."""
    teacher = _teacher(job.task, job.agent)
    budget = Budget(teacher, get_task(job.task), preset(job.task, job.how.preset))
    began = time.perf_counter()
    policy = job.how.make(budget, job.size, job.seed, **job.how.settings)
    seconds = time.perf_counter() - began
    row = measure.measure(policy, teacher, budget.task, tail=job.tail, whole=job.whole, seed=job.start_seed)
    row |= measure.fidelity(policy, teacher, budget.task) if job.how.preset in ALIKE else {}
    if not isinstance(policy, VoronoiPolicy):
        return {}, {"kind": "Row", **job.about(), "row": row, "seconds": seconds}
    arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
    return arrays, {"kind": "Row", **job.about(), "row": row, "seconds": seconds}


def make_all(folder: str | os.PathLike, todo: list[Job], *, jobs: int | str = 1) -> None:
    """Make the rows of `todo` that are missing in `folder`, lower seeds first; `jobs` as in `workers`."""
    todo = sorted(todo, key=lambda job: job.seed)
    make_missing(make_row, {job.path(folder): (job,) for job in todo}, "beyond", jobs=jobs, unit="rows")


def rows(folder: str | os.PathLike, wanted: list[Job]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the results, one row per job, and the time each took. Raises `atomic.DamagedFile`."""
    found, took = [], []
    for job in wanted:
        _, about = load_made(job.path(folder), "Row", job.about())
        what = {"method": job.method, "size": job.size, "seed": job.seed} | ({"agent": job.agent} if job.agent else {})
        found.append({**what, **about["row"], **job.provenance})
        took.append({"task": job.task, **what, "seconds": about["seconds"]})
    return pd.DataFrame(found), pd.DataFrame(took)


def pairs(folder: str | os.PathLike, wanted: list[Job]) -> pd.DataFrame:
    """Compare the policies of different seeds, one row per size and pair. The files of `wanted` must hold policies."""
    found, by_kind = [], {}
    for job in wanted:
        arrays, _ = load_made(job.path(folder), "Row", job.about())
        policy = VoronoiPolicy(**arrays, task=job.task, metric=METRIC)
        by_kind.setdefault(replace(job, seed=0), {})[job.seed] = policy
    for job, policies in by_kind.items():
        frame = sameness(policies, load_teacher(job.task), get_task(job.task)).assign(**job.provenance)
        frame.insert(0, "size", job.size)
        found.append(frame)
    return pd.concat(found, ignore_index=True)
