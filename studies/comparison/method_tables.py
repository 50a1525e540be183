"""Define the tables beyond the paper: which methods are compared, at which sizes, with how many seeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import partial

from vsp.algorithms import VERSION
from vsp.config import Config
from vsp.paper import printed
from vsp.rollouts import Policy
from vsp_beyond.few_cells import limit
from vsp_beyond.few_cells.config import Faithful, Tuned

from ..rivals import tdavq
from . import apart, methods, peers, robot_methods

TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1")
LONG = ("LunarLanderContinuous-v3",)  # rows take minutes to hours
WALKERS = ("BipedalWalker-v3", "HalfCheetah-v5")  # robots; rows take up to an hour
SEEDS, FEW_SEEDS = range(20), range(5)  # by default, and for rows that take long

SIZES = (1, 2, 3, 4, 8, 13, 32)  # cells or leaves
OWN = (0,)
TUNED_SIZES = (2, 3, 4, 8, 13)  # sizes of rivals that are tuned in the same way as ours
EPISODES = ("n_episodes", "n_corrections", "n_correction_episodes", "n_validation", "failure_penalty")
TUNING = ("n_restarts", "n_generations", "n_tuning_episodes", "tuning_step")
ALL = tuple(field.name for field in fields(Tuned) if field.name != "n_cells")
OF_FAITHFUL = tuple(field.name for field in fields(Faithful) if field.name != "n_cells")
PAPER = tuple(field.name for field in fields(Config))  # settings of the paper's preset
ALIKE = ("faithful", "walking")  # kinds of presets whose rows also measure `fidelity`

# Settings with which `refined` stays close to its teacher
FAITHFUL = {"n_generations": 300, "n_tuning_episodes": 500, "tuning_step": 0.01, "error_penalty": 30.0}


@dataclass(frozen=True)
class Method:
    """How a policy is made: `make(budget, size, seed, **settings)`."""

    make: Callable[..., Policy]
    version: int = 1  # raise it when the same arguments give a different policy; tests/golden/methods.json checks this
    reads: tuple[str, ...] = ()  # settings of the budget that the policy depends on
    settings: dict = field(default_factory=dict)
    sizes: tuple[int, ...] = SIZES  # cells or leaves; `OWN` where the method finds its own number
    chance: bool = True  # whether the policy depends on the seed
    tasks: tuple[str, ...] | None = None  # None: all tasks
    preset: str = "tuned"  # the kind of preset that gives the budget's settings


def _by_dagger(fit: str, *, by_chance: bool = True, rounds: int = 5, sizes=SIZES, version: int = 1) -> Method:
    make = partial(methods.corrected, fit=methods.FITS[fit], by_chance=by_chance)
    return Method(make, version, EPISODES + ("n_restarts",) * by_chance, {"rounds": rounds}, sizes)


def _by_teacher(fit: str, *, sizes: tuple[int, ...] = SIZES) -> Method:
    return Method(partial(methods.alone, fit=methods.FITS[fit]), reads=EPISODES, sizes=sizes)


def _tuned(fit: Method) -> Method:
    """Tune the policy of `fit`. Size 1 is left out, since "one linear map" covers it."""
    sizes = OWN if fit.sizes == OWN else TUNED_SIZES
    return replace(fit, make=partial(methods.tuned_fit, imitation=fit.make), reads=EPISODES + TUNING, sizes=sizes)


METHODS = {
    "refined": Method(methods.refined, reads=ALL),
    "refined, not tuned": Method(methods.refined, reads=ALL, settings={"n_generations": 0}),
    "refined, no teacher": Method(methods.no_teacher, reads=ALL, sizes=(3, 4)),  # sizes of presets
    "refined, closest": Method(methods.imitated, reads=ALL, sizes=(13,)),
    "refined, faithful": Method(
        methods.gently, version=2, reads=ALL, settings=FAITHFUL, sizes=(13,), tasks=printed.TASKS[:1]
    ),
    "k-means cells, DAgger": _by_dagger("k-means"),
    "CART": _by_teacher("tree"),
    "CART, DAgger": _by_dagger("tree", by_chance=False),
    "CART, linear leaves, DAgger": _by_dagger("linear tree", by_chance=False),
    "oblique tree, linear leaves, DAgger": _by_dagger("oblique tree", version=2),
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

# Rivals, tuned in the same way as `refined`
UNTUNED = {
    "oblique tree, constant leaves, DAgger": _by_dagger("constant oblique tree", sizes=TUNED_SIZES, version=2),
    "small network, DAgger": _by_dagger("small network", sizes=TUNED_SIZES),
} | {
    name: METHODS[name]
    for name in ("CART, DAgger", "CART, linear leaves, DAgger", "oblique tree, linear leaves, DAgger",
                 "k-means cells, DAgger", "one linear map")
}  # fmt: skip
RIVALS = {f"{name}, tuned": _tuned(method) for name, method in UNTUNED.items()}
RIVALS |= {name: method for name, method in UNTUNED.items() if name not in METHODS}

# `refined` at the size of the preset, with one part removed or changed
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
LIKE = {"faithful": Method(methods.faithful, reads=OF_FAITHFUL, sizes=FAITHFUL_SIZES, preset="faithful")}

# Fit and geometry separated, and newer methods: all imitate the teacher's own episodes
APART = {
    name: Method(make, version=2 if "greedy" in name else 1, reads=EPISODES, sizes=(2, 4, 8))
    for name, make in {
        "our cells, our fit": apart.cells_by_global_fit,
        "our cells, greedy fit": apart.cells_by_greedy_fit,
        "oblique tree, our fit": apart.tree_by_global_fit,
        "oblique tree, greedy fit": partial(methods.alone, fit=methods.FITS["oblique tree"]),
        "critic-driven splitting": peers.critic_driven_cells,
        "advantage-weighted maps": peers.advantage_weighted_cells,
    }.items()
}

# The highest return of policies whose R² is at least a given value: from `faithful` towards `refined`
DEMANDED = {
    f"faithful, R² {r2:g}": replace(LIKE["faithful"], settings={"min_r2": r2}, sizes=(2, 4, 8))
    for r2 in (0.5, 0.7, 0.8, 0.9, 0.95)
}

# LIMIT: the highest return, starting from the best policy where it is known.
# STARTS: searches with another start or another length, to see which of the two matters
LIMIT = {"at the limit": Method(methods.limited, limit.VERSION, reads=ALL, sizes=(1, 2, 3, 4, 8, 12), preset="limit")}
_ON_THE_CAR = {"sizes": (3,), "tasks": printed.TASKS[1:]}
STARTS = {
    "at the limit, from the teacher": replace(
        LIMIT["at the limit"], make=partial(methods.limited, by_teacher=True), **_ON_THE_CAR
    ),
    "refined, 800 generations": replace(METHODS["refined"], settings={"n_generations": 800}, **_ON_THE_CAR),
}

# Robots: imitate the teacher, then continue training as the teacher's actor; and one linear map by returns alone
OF_IMITATION = (
    "push", "n_episodes", "n_corrections", "n_correction_episodes", "n_states", "n_restarts", "n_validation"
)  # fmt: skip
OF_TRAINING = ("n_steps", "n_filling", "learning_rate", "critic_rate", "batch_size", "gamma", "temperature")
OF_SEARCH = ("n_random_steps", "n_directions", "n_best", "step_size", "search_noise", "n_validation")


def _robot(make: Callable[..., Policy], reads: tuple[str, ...], sizes: tuple[int, ...] = OWN) -> Method:
    return Method(make, reads=reads, sizes=sizes, preset="walking")


def _further(imitation: Method) -> Method:
    make = partial(robot_methods.trained_further, imitation=imitation.make)
    return replace(imitation, make=make, reads=imitation.reads + OF_TRAINING)


ROBOTS = {
    "cells": (_cells := _robot(robot_methods.cells, OF_IMITATION, (1, 2, 4, 8, 16))),
    "cells, trained further": _further(_cells),
    "oblique tree": (_tree := replace(_robot(robot_methods.oblique_tree, OF_IMITATION, (2, 4, 8, 16)), version=2)),
    "oblique tree, trained further": _further(_tree),
    "one map, random search": (_search := _robot(robot_methods.searched, OF_SEARCH)),
    "one map, longer search": replace(_search, settings={"n_random_steps": 18_000_000}, tasks=("BipedalWalker-v3",)),
    "robot's teacher": replace(METHODS["teacher"], preset="walking"),
}

OBLIQUE, ONE_MAP = "oblique tree, linear leaves, DAgger, tuned", "one linear map, tuned"  # the closest rivals
AGENTS = (1, 2)  # further teachers of a task, in data/teachers/short/, in order of name; 0 is the shipped one


@dataclass(frozen=True)
class Table:
    """Rows that are written to one file per task, data/beyond/<name>_<task>.csv."""

    methods: dict[str, Method]
    seeds: range = SEEDS
    fewer: range = SEEDS  # seeds of sizes other than the preset's
    sizes: tuple[int, ...] | None = None  # only these sizes; None: all sizes of a method
    agents: tuple[int, ...] = (0,)
    at_preset: bool = False  # only the preset's size
    tail: bool = False  # measure the worst returns too
    by_task: dict[str, dict] = field(default_factory=dict)  # fields that differ for a task

    def of(self, task: str) -> Table:
        """Return the table for `task`, with its own fields."""
        return replace(self, **self.by_task.get(task, {}))

    def has(self, task: str) -> bool:
        """Return whether `task` has rows in this table."""
        return any(method.tasks is None or task in method.tasks for method in self.methods.values())


TABLES = {
    "methods": Table(METHODS),
    "tuned": Table(RIVALS, seeds=range(7), fewer=range(7)),
    "faithful": Table(LIKE, fewer=range(6)),
    "apart": Table(APART, seeds=FEW_SEEDS, fewer=FEW_SEEDS),
    "demanded": Table(DEMANDED, seeds=range(2), fewer=range(2)),
    "teachers": Table(
        LIKE | {name: (METHODS | RIVALS)[name] for name in ("teacher", "refined", OBLIQUE, ONE_MAP)},
        seeds=FEW_SEEDS, fewer=FEW_SEEDS, agents=AGENTS, at_preset=True,
    ),
    "limit": Table(
        LIMIT, fewer=range(3),
        by_task={  # rows of these tasks take 3 to 17 minutes
            "MountainCarContinuous-v0": {"seeds": FEW_SEEDS, "sizes": (3, 4)},
            "Pendulum-v1": {"seeds": range(10), "sizes": (8, 12)},
        },
    ),
    "starts": Table(STARTS, seeds=range(3), fewer=range(3)),
}  # fmt: skip

# Tables of the tasks whose rows take long
REPEATED = ("teacher", "refined")  # repeated here so that their tail is measured too, like that of the rivals
LONG_RIVALS = ("CART, linear leaves, DAgger, tuned", OBLIQUE, ONE_MAP)
LONG_SIZES = (0, 1, 2, 4, 8)
LONG_TABLES = {
    "methods": Table(METHODS, seeds=FEW_SEEDS, fewer=FEW_SEEDS),
    "tuned": Table(
        {name: (METHODS | RIVALS)[name] for name in (*REPEATED, *LONG_RIVALS)},
        seeds=range(3), fewer=range(3), sizes=LONG_SIZES, tail=True,
    ),
    "faithful": Table(LIKE, seeds=range(10), fewer=range(3), sizes=LONG_SIZES, tail=True),
    "limit": Table(LIMIT, seeds=range(2), sizes=(3,)),
}  # fmt: skip
# One cell trained further is the control: it has a teacher too, as eight have
ROBOT_TABLES = {
    "robots": Table(
        ROBOTS, seeds=range(3), fewer=range(3),
        by_task={"HalfCheetah-v5": {"seeds": FEW_SEEDS}},  # eight cells against one map and against a tree
    ),
}  # fmt: skip
