"""Make the rows of the comparison: one per method, size and seed. Committed rows are read instead.

The methods of a table have the same start states and, unless their names say otherwise, the same teacher and budget.
Distillation times differ from run to run, so they are in a separate file, <table>_seconds.csv.
"""

import contextlib
import os
import time
from dataclasses import dataclass
from functools import cache

from vsp import VoronoiPolicy, get_task, load_teacher
from vsp.protocol import Job, job
from vsp.protocol.job import provenance
from vsp.teachers.teacher import Teacher, further_teachers
from vsp_beyond.few_cells.units import METRIC

from ..committed import keys, read_results
from . import measure
from .methods import ALIKE, FOUND, LONG, METHODS, PRESETS, TABLES, Entry, method, methods_of, sizes_of


@dataclass(frozen=True)
class Row(Job):
    """One row to make: a method at a size, with a seed. Size 0: the method finds its own size."""

    task: str
    method: str
    size: int
    seed: int
    agent: int = 0  # which teacher: 0 is the shipped one, the others are those of `further_teachers`
    kind = "Row"

    @property
    def how(self) -> Entry:
        """The method."""
        return METHODS[self.method]

    @property
    def start_seed(self) -> int:
        """The seed of the start states from which its returns are measured. At the limit small differences count, so a
        slow task is played from as many starts as others, and from new ones, as robots are."""
        if self.how.preset == "walking":
            return measure.NEW_SEED
        slow = get_task(self.task).slowness > 1
        return measure.LIMIT_SEED if slow and self.how.preset == "limit" else measure.REPORT_SEED

    @property
    def provenance(self) -> dict[str, str | int]:
        """What identifies the row besides its seed: settings (an id), teacher, version."""
        how = self.how
        about: dict = {"task": self.task, "method": self.method, "size": self.size}
        about["settings"] = how.read(self.task)
        about["measure"] = measure.settings(self.start_seed)
        about["measure"] |= {"states": measure.N_COMMON} if how.preset in ALIKE else {}
        return provenance(about, _digest(self.task, self.agent), how.version)

    @property
    def named(self) -> dict[str, str | int]:
        """What the row's table says of the job."""
        named: dict = {"task": self.task, "method": self.method, "size": self.size, "seed": self.seed}
        return named | ({"agent": self.agent} if self.agent else {})

    def make(self) -> tuple[dict, dict]:
        """Distil and measure a policy; return the arrays (of Voronoi cells only) and about of the row's file."""
        teacher, task = _teacher(self.task, self.agent), get_task(self.task)
        began = time.perf_counter()
        policy = method(self.method, self.size)(teacher, task, None, self.seed)
        seconds = time.perf_counter() - began
        row = measure.measure(policy, teacher, task, self.start_seed)
        row |= measure.fidelity(policy, teacher, task) if self.how.preset in ALIKE else {}
        arrays = {}
        if isinstance(policy, VoronoiPolicy):
            arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
        return arrays, {"row": row, "seconds": seconds}

    def row(self, folder: str | os.PathLike) -> dict:
        """Return the row in the job's file. Raises `atomic.DamagedFile`."""
        _, made = self.load(folder)
        return {**self.named, "seconds": made["seconds"], **made["row"], **self.provenance}

    def policy(self, folder: str | os.PathLike) -> VoronoiPolicy:
        """Return the policy in the job's file, which must hold one."""
        return VoronoiPolicy(**self.load(folder)[0], task=self.task, metric=METRIC)


@cache
def _teacher(task: str, agent: int) -> Teacher:
    return load_teacher(list(further_teachers(task).values())[agent - 1] if agent else task)


@cache
def _digest(task: str, agent: int) -> str:
    return _teacher(task, agent).digest


def jobs_of(task: str, table: str = "methods") -> list[Row]:
    """List all rows of a task in `table`, a key of `TABLES[task]`."""
    about = TABLES[task][table]
    return [
        Row(task, name, size, seed, agent)
        for name, method in methods_of(task, table).items()
        for size in sizes_of(task, method, about)
        for agent in about.agents
        for seed in _seeds(task, table, method, size)
    ]


def _seeds(task: str, table: str, method: Entry, size: int) -> range:
    about = TABLES[task][table]
    main = size in (*FOUND, PRESETS[method.preset](task).n_cells)
    seeds = about.seeds if main or about.fewer is None else about.fewer
    return seeds if method.chance else seeds[:1]


def committed_rows(task: str, table: str) -> dict[Row, dict | None]:
    """Return the committed row of each job of a table, with its seconds; None for a job that is not committed."""
    jobs, known = jobs_of(task, table), {}
    with contextlib.suppress(FileNotFoundError):
        seconds = read_results(f"{table}_seconds{'_long' * (task in LONG)}")
        rows = seconds[seconds["task"] == task].merge(read_results(f"{table}_{task}"))
        known = dict(zip(keys(rows), rows.to_dict("records")))
    return {row: known.get(key) for row, key in zip(jobs, keys([row.about() for row in jobs]))}


def make_all(folder: str | os.PathLike, todo: list[Row], *, jobs: int | str = 1) -> None:
    """Make the rows of `todo` that are missing in `folder`, lower seeds first; `jobs` as in `workers`."""
    job.make_all(sorted(todo, key=lambda row: row.seed), folder, "beyond", jobs=jobs, unit="rows")
