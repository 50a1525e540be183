"""Make the files beside the rows: kept policies, how alike policies of two seeds are, a gait, the best returns."""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from vsp import VoronoiPolicy, get_task, load_teacher, start_states
from vsp.protocol.job import PROVENANCE, provenance
from vsp.rollouts import rollout
from vsp.run import listed, sealed
from vsp.run.progress import progress
from vsp.tasks.base import GOAL
from vsp_beyond import optimum
from vsp_beyond.optimum.grid import GridPolicy

from ..committed import BEYOND, RESULTS, differing, write_results
from ..robots import record_gait
from . import measure
from .methods import CHEETAH, METHODS, PRESETS, TABLES, TASKS
from .rows import Row, jobs_of

GAIT, GAIT_VERSION = {"start": 0.0, "n_steps": 200}, 2  # raise the version when the same policy gives another gait
OPTIMUM_VERSION = 1  # raise it when the best policies give different returns
# Tasks, and how much finer the grid is; the difference between two returns of a task shows the grid's error
WAYS = ((optimum.TASKS[0], 1.0), *((task, finer) for task in optimum.TASKS[1:] for finer in (1.0, 2.0)))


@dataclass(frozen=True)
class Beside:
    """A policy or a table in data/beyond that stands beside the rows."""

    name: str
    today: list[dict]  # what each of its rows is made with; one for all of them, or for a policy
    make: Callable[..., VoronoiPolicy | pd.DataFrame]  # of the policies of `jobs`
    jobs: tuple[Row, ...] = ()

    @property
    def current(self) -> bool:
        """Whether the committed file is made with the same."""
        with contextlib.suppress(FileNotFoundError):
            return not differing(self.name, self.today)
        return False

    def write(self, folder: Path, out: Path) -> None:
        """Write it to OUT/data/beyond: the committed one if it is current, else from the row files in `folder`."""
        path = out / BEYOND / self.name
        if self.current:
            return listed.write_listed(path, listed.read_listed(RESULTS / self.name))
        made = self.make(*(job.policy(folder) for job in self.jobs))
        if isinstance(made, pd.DataFrame):
            made_with = pd.DataFrame(self.today * (len(made) // len(self.today)))[list(PROVENANCE)]
            return write_results(made.join(made_with), path.stem, out=out)
        made.save(path)
        arrays, about = sealed.load_arrays(path, kind="VoronoiPolicy")
        sealed.save_arrays(path, arrays, about | self.today[0])
        listed.list_file(path)


def beside(task: str, table: str) -> Iterator[Beside]:
    """Yield the files beside the rows of a table. Those of the best returns, for all tasks, are beside one table."""
    if table == "faithful":
        jobs = tuple(jobs_of(task, table))
        pairs = [(a, b) for a, b in combinations(jobs, 2) if a.size == b.size]
        today = [{**a.about(), "other": b.seed} for a, b in pairs]
        yield Beside(f"same_{task}.csv", today, partial(_sameness, task, pairs, jobs), jobs)
    for name, job in kept_jobs(task, table).items():
        yield Beside(name, [job.provenance], lambda policy: policy, (job,))
        if task == CHEETAH:
            settings = {"policy": job.provenance, "table": "gait", **GAIT}
            today = [provenance(settings, job.provenance["teacher"], GAIT_VERSION)]
            yield Beside(f"gait_{task}.csv", today, partial(record_gait, task=task, **GAIT), (job,))
    if (task, table) == (TASKS[0], "limit"):
        starts = [measure.REPORT_SEED, measure.N_REPORTED]
        ways = [{"task": name, "finer": finer, "starts": starts} for name, finer in WAYS]
        yield Beside("optimum.csv", [provenance(way, "none", OPTIMUM_VERSION) for way in ways], best_returns)


def kept_jobs(task: str, table: str) -> dict[str, Row]:
    """Return the rows of a table whose policies are kept, by file: the preset's size first, all of the first seed."""
    about = TABLES[task][table]
    if not about.keeps:
        return {}
    preset = PRESETS[METHODS[about.keeps].preset](task).n_cells
    sizes = {"": preset, **{f"_size_{size}": size for size in about.keeps_also}}
    return {f"{table}_{task}{suffix}.policy": Row(task, about.keeps, size, 0) for suffix, size in sizes.items()}


def _sameness(name: str, pairs: list[tuple[Row, Row]], jobs: tuple[Row, ...], *policies: VoronoiPolicy) -> pd.DataFrame:
    """Compare policies of different seeds on `common_states`, one row per pair."""
    teacher, task, of_job, rows = load_teacher(name), get_task(name), dict(zip(jobs, policies)), []
    states = measure.common_states(teacher, task)
    for a, b in pairs:
        about = {"size": a.size, "seed": a.seed, "other": b.seed}
        rows.append(about | measure.sameness(of_job[a], of_job[b], teacher, task, states))
    return pd.DataFrame(rows)


def best_returns() -> pd.DataFrame:
    """Return the returns of the best policies, one row per task and way to find them; a task's last row is its best.
    Columns: task, found (how: "closed form", or the points of the grid), mean, worst, failing (share of the episodes
    that miss the goal; NaN for a task without a goal), longest (steps). Takes about five minutes."""
    rows = []
    for name, finer in progress(WAYS, "optimum", total=len(WAYS), unit="policies"):
        task = get_task(name)
        policy = optimum.best_policy(task, finer=finer)
        starts = start_states(task, measure.N_REPORTED, measure.REPORT_SEED)
        result = rollout(policy, task, starts)
        if isinstance(policy, GridPolicy):
            returns, how = result.returns, "{} × {} points".format(*policy.grid.shape)
        else:
            returns, how = optimum.best_returns(starts), "closed form"
        failing = np.nan if name == "Pendulum-v1" else np.mean(result.outcomes != GOAL)  # nothing can fail there
        row = {"task": name, "found": how, "mean": returns.mean(), "worst": returns.min(), "failing": failing}
        rows.append(row | {"longest": result.lengths.max()})
    return pd.DataFrame(rows)
