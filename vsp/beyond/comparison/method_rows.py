"""The comparison beyond the paper: every method at every size, from the same teachers, budgets and starts, on disk.

`make beyond` makes the rows that are missing; data/results/beyond_<task>.csv holds what came out, one row per method,
size and seed. How long a distillation took differs from run to run and has a file of its own, beyond_seconds.csv.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cache, partial
from pathlib import Path

import pandas as pd

from ...algorithms import VERSION
from ...baselines import tdavq
from ...config import Config, paper_preset
from ...paper import printed
from ...paper.results import load_made, make_missing, provenance, provenance_folder
from ...policy import VoronoiPolicy
from ...rollouts import Policy
from ...tasks.registry import get_task
from ...teachers.teacher import Teacher, further_teachers, load_teacher
from ..optimum import limit
from ..refinement.config import Faithful, Refinement, faithful_preset, tuned_preset
from ..refinement.units import METRIC
from . import apart, measure, methods, peers
from .methods import Budget
from .sameness import sameness

TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1")
LONG = ("LunarLanderContinuous-v3",)  # whose rows take hours
SEEDS, FEW_SEEDS = range(20), range(5)  # of rows, and of those that take long

SIZES = (1, 2, 3, 4, 8, 13, 32)  # cells or leaves
OWN = (0,)
TUNED_SIZES = (2, 3, 4, 8, 13)  # of rivals that are tuned as ours is
EPISODES = ("n_episodes", "n_corrections", "n_correction_episodes", "n_validation", "failure_penalty")
TUNING = ("n_restarts", "n_generations", "n_tuning_episodes", "tuning_step")
ALL = tuple(field.name for field in fields(Refinement) if field.name != "n_cells")
OF_FAITHFUL = tuple(field.name for field in fields(Faithful) if field.name != "n_cells")
PAPER = tuple(field.name for field in fields(Config))  # of the paper's preset

# `refined` that stays close to its teacher
FAITHFUL = {"n_generations": 300, "n_tuning_episodes": 500, "tuning_step": 0.01, "error_penalty": 30.0}


@dataclass(frozen=True)
class Method:
    """How a policy is made: `make(budget, size, seed, **settings)`."""

    make: Callable[..., Policy]
    version: int = 1  # raise it when the same arguments give another policy; tests/golden/methods.json guards it
    reads: tuple[str, ...] = ()  # settings of the budget that decide the policy
    settings: dict = field(default_factory=dict)
    sizes: tuple[int, ...] = SIZES  # cells or leaves; `OWN` where the method finds its own number
    chance: bool = True  # whether the seed matters
    tasks: tuple[str, ...] | None = None  # None: for all
    preset: str = "tuned"  # the kind of preset whose settings are the budget


def _by_dagger(fit: str, *, n_restarts: int = 1, rounds: int = 5, sizes=SIZES) -> Method:
    settings, make = {"rounds": rounds, "n_restarts": n_restarts}, partial(methods.corrected, fit=methods.FITS[fit])
    return Method(make, reads=EPISODES, settings=settings, sizes=sizes)


def _by_teacher(fit: str, *, sizes: tuple[int, ...] = SIZES) -> Method:
    return Method(partial(methods.alone, fit=methods.FITS[fit]), reads=EPISODES, sizes=sizes)


def _tuned(fit: Method) -> Method:
    """`fit`, then tuned; sizes of one leaf are left out, since one linear map stands for them."""
    sizes = OWN if fit.sizes == OWN else TUNED_SIZES
    return replace(fit, make=partial(methods.tuned_fit, imitation=fit.make), reads=EPISODES + TUNING, sizes=sizes)


METHODS = {
    "refined": Method(methods.refined, reads=ALL),
    "refined, not tuned": Method(methods.refined, reads=ALL, settings={"n_generations": 0}),
    "refined, no teacher": Method(methods.no_teacher, reads=ALL, sizes=(3, 4)),  # those of presets
    "refined, closest": Method(methods.imitated, reads=ALL, sizes=(13,)),
    "refined, faithful": Method(methods.faithful, reads=ALL, settings=FAITHFUL, sizes=(13,), tasks=printed.TASKS[:1]),
    "k-means cells, DAgger": _by_dagger("k-means", n_restarts=3),
    "CART": _by_teacher("tree"),
    "CART, DAgger": _by_dagger("tree"),
    "CART, linear leaves, DAgger": _by_dagger("linear tree"),
    "oblique tree, linear leaves, DAgger": _by_dagger("oblique tree", n_restarts=2),
    "soft tree, DAgger": _by_dagger("soft tree", rounds=2, sizes=(2, 4, 8, 32)),  # powers of two
    "teacher": Method(methods.the_teacher, sizes=OWN, chance=False),
    "one linear map": _by_teacher("one map", sizes=OWN),
    "rule of thumb": Method(methods.by_thumb, sizes=OWN, chance=False, tasks=printed.TASKS),
    "heuristic": Method(methods.by_hand, sizes=OWN, chance=False, tasks=("Pendulum-v1", *LONG)),
    "TD-AVQ": Method(methods.td_avq, sizes=OWN, tasks=printed.TASKS[:1]),
    "TD-AVQ, coarse": Method(methods.td_avq, settings=tdavq.COARSE, sizes=OWN, tasks=printed.TASKS[:1]),
    "the paper's method": Method(
        methods.paper_method, version=VERSION, reads=PAPER, sizes=OWN, tasks=printed.TASKS, preset="paper"
    ),
}

# Rivals, tuned as `refined` is
UNTUNED = {
    "oblique tree, constant leaves, DAgger": _by_dagger("constant oblique tree", n_restarts=2, sizes=TUNED_SIZES),
    "small network, DAgger": _by_dagger("small network", n_restarts=2, sizes=TUNED_SIZES),
} | {
    name: METHODS[name]
    for name in ("CART, DAgger", "CART, linear leaves, DAgger", "oblique tree, linear leaves, DAgger",
                 "k-means cells, DAgger", "one linear map")
}  # fmt: skip
RIVALS = {f"{name}, tuned": _tuned(method) for name, method in UNTUNED.items()}
RIVALS |= {name: method for name, method in UNTUNED.items() if name not in METHODS}

# `refined` at the size of the preset, with one more part taken away
ABLATION = {
    "cold from the start": {"initial_temperature": 0.04},
    "one beginning": {"n_restarts": 1},
    "not corrected": {"n_corrections": 0},
    "no leak": {"clip_slope": 1e-9},
    "not tuned": {"n_generations": 0},
    "failures at no price": {"failure_penalty": 0.0},
    "no teacher": {},
    "drawn by stakes": {"criticality": True},
}

FAITHFUL_SIZES = (1, 2, 3, 4, 6, 7, 8, 13)
LIKE = {"faithful": Method(methods.faithfully, reads=OF_FAITHFUL, sizes=FAITHFUL_SIZES, preset="faithful")}

# Fit and geometry apart, and newer methods: all imitate the teacher's own episodes
APART = {
    name: Method(make, reads=EPISODES, sizes=(2, 4, 8))
    for name, make in {
        "our cells, our fit": apart.cells_by_global_fit,
        "our cells, greedy fit": apart.cells_by_greedy_fit,
        "oblique tree, our fit": apart.tree_by_global_fit,
        "oblique tree, greedy fit": partial(methods.alone, fit=methods.FITS["oblique tree"]),
        "critic-driven splitting": peers.critic_driven_cells,
        "advantage-weighted maps": peers.advantage_weighted_cells,
    }.items()
}

# The highest return of policies that are so much like the teacher: the way from `faithful` to `refined`
DEMANDED = {
    f"faithful, R² {r2:g}": replace(LIKE["faithful"], settings={"min_r2": r2}, sizes=(2, 4, 8))
    for r2 in (0.5, 0.7, 0.8, 0.9, 0.95)
}

# The highest return, from the best policy where it is known
LIMIT = {"at the limit": Method(methods.limited, limit.VERSION, reads=ALL, sizes=(1, 2, 3, 4, 8, 12), preset="limit")}

OBLIQUE, ONE_MAP = "oblique tree, linear leaves, DAgger, tuned", "one linear map, tuned"  # the nearest rivals
AGENTS = (1, 2)  # further teachers of a task, data/teachers/short/, in the order of their names; 0 is the shipped one


@dataclass(frozen=True)
class Table:
    """Rows that come into one file per task, data/results/<name>_<task>.csv."""

    methods: dict[str, Method]
    seeds: range = SEEDS
    fewer: range = SEEDS  # of sizes that the preset does not have
    sizes: tuple[int, ...] | None = None  # no others than these
    agents: tuple[int, ...] = (0,)
    at_preset: bool = False  # only as many cells as the preset has
    tail: bool = False  # the worst returns are measured too


TABLES = {
    "beyond": Table(METHODS),
    "tuned": Table(RIVALS, seeds=range(7), fewer=range(7)),
    "faithful": Table(LIKE, fewer=range(6)),
    "apart": Table(APART, seeds=FEW_SEEDS, fewer=FEW_SEEDS),
    "demanded": Table(DEMANDED, seeds=range(2), fewer=range(2)),
    "teachers": Table(
        LIKE | {name: (METHODS | RIVALS)[name] for name in ("teacher", "refined", OBLIQUE, ONE_MAP)},
        seeds=FEW_SEEDS, fewer=FEW_SEEDS, agents=AGENTS, at_preset=True,
    ),
}  # fmt: skip

# Of the tasks whose rows take hours
AGAIN = ("teacher", "refined")  # their tail is measured too, beside that of the rivals
LONG_RIVALS = ("CART, linear leaves, DAgger, tuned", OBLIQUE, ONE_MAP)
LONG_SIZES = (0, 1, 2, 4, 8)
LONG_TABLES = {
    "beyond": Table(METHODS, seeds=FEW_SEEDS, fewer=FEW_SEEDS),
    "tuned": Table(
        {name: (METHODS | RIVALS)[name] for name in (*AGAIN, *LONG_RIVALS)},
        seeds=range(3), fewer=range(3), sizes=LONG_SIZES, tail=True,
    ),
    "faithful": Table(LIKE, seeds=range(10), fewer=range(3), sizes=LONG_SIZES, tail=True),
}  # fmt: skip


@dataclass(frozen=True)
class Job:
    """One row to come: a method at a size, with a seed. Size 0: the method's own."""

    task: str
    method: str
    size: int
    seed: int
    agent: int = 0  # the shipped teacher, or one of `AGENTS`
    tail: bool = False  # whether the worst returns are measured too

    @property
    def how(self) -> Method:
        """The method, or `refined` with a part taken away."""
        if self.method in (known := METHODS | RIVALS | LIKE | APART | DEMANDED | LIMIT):
            return known[self.method]
        return replace(METHODS["refined"], settings=ABLATION[self.method.removeprefix("refined, ")])

    @property
    def provenance(self) -> dict[str, str | int]:
        """What names the row beside its seed: settings (an id), teacher, version."""
        how, about = self.how, {"task": self.task, "method": self.method, "size": self.size}
        budget = preset(self.task, how.preset)
        about["settings"] = {name: getattr(budget, name) for name in how.reads} | how.settings
        about["measure"] = measure.settings(tail=self.tail) | (measure.common() if how.preset == "faithful" else {})
        return provenance(about, _teacher(self.task, self.agent).digest, how.version)

    def path(self, folder: str | os.PathLike) -> Path:
        """Its file."""
        return provenance_folder(folder, self.task, self.provenance) / f"{self.seed:04d}.row"

    def about(self) -> dict:
        """What its file names."""
        named = {"task": self.task, "method": self.method, "size": self.size, "seed": self.seed}
        return {**named, **self.provenance}  # which name the agent by its checksum, and the tail in the settings


def preset(task: str, kind: str) -> Refinement | Faithful | Config:
    """The settings that a method of this kind has for `task`."""
    kinds = {
        "tuned": tuned_preset, "paper": paper_preset, "faithful": faithful_preset, "limit": limit.limit_preset,
    }  # fmt: skip
    return kinds[kind](task)


@cache
def _teacher(task: str, agent: int) -> Teacher:
    """The shipped teacher of a task, or one of its further ones, by number."""
    return load_teacher(list(further_teachers(task).values())[agent - 1] if agent else task)


def jobs_of(task: str, table: str = "beyond") -> list[Job]:
    """All rows of a task in a table, a key of `TABLES`."""
    about, found = (LONG_TABLES if task in LONG else TABLES)[table], []
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


def tables_of(task: str) -> tuple[str, ...]:
    """The tables that a task has rows in."""
    return tuple(LONG_TABLES if task in LONG else TABLES)


def make_row(job: Job) -> tuple[dict, dict]:
    """Distil and measure: what the file of the row holds, no arrays and about."""
    teacher = _teacher(job.task, job.agent)
    budget = Budget(teacher, get_task(job.task), preset(job.task, job.how.preset))
    began = time.perf_counter()
    policy = job.how.make(budget, job.size, job.seed, **job.how.settings)
    seconds = time.perf_counter() - began
    row = measure.measure(policy, teacher, budget.task, tail=job.tail)
    if not isinstance(policy, VoronoiPolicy):
        return {}, {"kind": "Row", **job.about(), "row": row, "seconds": seconds}
    row |= measure.fidelity(policy, teacher, budget.task) if job.how.preset == "faithful" else {}
    arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
    return arrays, {"kind": "Row", **job.about(), "row": row, "seconds": seconds}


def make_all(folder: str | os.PathLike, todo: list[Job], *, jobs: int | str = 1) -> None:
    """Make the rows of `todo` that are missing in `folder`, the first seeds first; `jobs` as in `workers`."""
    todo = sorted(todo, key=lambda job: job.seed)
    make_missing(make_row, {job.path(folder): (job,) for job in todo}, "beyond", jobs=jobs, unit="rows")


def rows(folder: str | os.PathLike, wanted: list[Job]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What came out, one row per job, and how long each took. Raises `atomic.DamagedFile`."""
    found, took = [], []
    for job in wanted:
        _, about = load_made(job.path(folder), "Row", job.about())
        what = {"method": job.method, "size": job.size, "seed": job.seed} | ({"agent": job.agent} if job.agent else {})
        found.append({**what, **about["row"], **job.provenance})
        took.append({"task": job.task, **what, "seconds": about["seconds"]})
    return pd.DataFrame(found), pd.DataFrame(took)


def pairs(folder: str | os.PathLike, wanted: list[Job]) -> pd.DataFrame:
    """How alike the policies of different seeds are, one row per size and pair, for rows whose files keep policies."""
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
