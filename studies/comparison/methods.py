"""The table of methods: how each is made, at which sizes, with which settings. And the tables of rows, a row for each
method, size and seed: data/beyond/<table>_<task>.csv."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

from vsp import Policy, Task
from vsp.protocol import Method
from vsp_beyond import Faithful, Tuned, faithful_preset, tuned_preset
from vsp_beyond.few_cells import limit
from vsp_beyond.few_cells.faithful import VERSION

from ..robots import walking_preset
from . import makers

TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1")
LANDER, WALKER, CHEETAH = "LunarLanderContinuous-v3", "BipedalWalker-v3", "HalfCheetah-v5"
LONG = (LANDER, WALKER, CHEETAH)  # rows take minutes to hours

PRESETS: dict[str, Callable[..., Any]] = {
    "tuned": tuned_preset, "faithful": faithful_preset, "limit": limit.limit_preset, "walking": walking_preset,
}  # fmt: skip
ALIKE = ("faithful", "walking")  # presets whose rows also measure `fidelity`

# Settings of presets that policies depend on
EPISODES = ("n_episodes", "n_corrections", "n_correction_episodes", "n_validation", "failure_penalty")
TUNING = ("n_restarts", "n_generations", "n_tuning_episodes", "tuning_step")
OF_IMITATION = (
    "push", "n_episodes", "n_corrections", "n_correction_episodes", "n_states", "n_restarts", "n_validation"
)  # fmt: skip
OF_TRAINING = ("n_steps", "n_filling", "learning_rate", "critic_rate", "batch_size", "gamma", "temperature")
OF_SEARCH = ("n_random_steps", "n_directions", "n_best", "step_size", "search_noise", "n_validation")


def _but_cells(config: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(config) if field.name != "n_cells")


ALL, OF_FAITHFUL = _but_cells(Tuned), _but_cells(Faithful)

SIZES = (1, 2, 3, 4, 8, 13, 32)  # cells or leaves
FOUND = (0,)  # the method finds its own number
OF_PRESET = (-1,)  # the preset's number
TUNED_SIZES = (2, 3, 4, 8, 13)  # of other methods tuned as ours; "one linear map" has size 1


@dataclass(frozen=True)
class Entry:
    """How a policy is made: `make(teacher, task, config, seed, **settings)`, with the size in the config."""

    make: Callable[..., Policy]
    reads: tuple[str, ...] = ()  # settings of the preset that the policy depends on
    sizes: tuple[int, ...] = SIZES
    table: str = "methods"  # where its rows are
    settings: dict = field(default_factory=dict)
    version: int = 1  # raise it when the same arguments give a different policy; tests/golden/methods.json checks this
    chance: bool = True  # whether the policy depends on the seed
    tasks: tuple[str, ...] = ()  # empty: all tasks
    preset: str = "tuned"  # key of `PRESETS`

    def read(self, task: str) -> dict:
        """Return the settings that the policies for a task depend on, by name."""
        config = PRESETS[self.preset](task)
        return {name: getattr(config, name) for name in self.reads} | self.settings


def _corrected(fit: str, *, by_chance: bool = True, **about) -> Entry:
    make = partial(makers.corrected, fit=fit, by_chance=by_chance)
    return Entry(make, EPISODES + ("n_restarts",) * by_chance, settings={"rounds": 5}, **about)


def _uncorrected(fit: str, sizes: tuple[int, ...] = SIZES, **about) -> Entry:
    return Entry(partial(makers.uncorrected, fit=fit), EPISODES, sizes, **about)


def _tuned(fit: Entry) -> Entry:
    make = partial(makers.tuned_fit, imitation=fit.make)
    sizes = FOUND if fit.sizes == FOUND else TUNED_SIZES
    return replace(fit, make=make, reads=EPISODES + TUNING, sizes=sizes, table="tuned")


def _robot(make: Callable[..., Policy], reads: tuple[str, ...], sizes: tuple[int, ...] = FOUND, **about) -> Entry:
    return Entry(make, reads, sizes, "robots", preset="walking", **about)


def _further(imitation: Entry) -> Entry:
    make = partial(makers.trained_further, imitation=imitation.make)
    return replace(imitation, make=make, reads=imitation.reads + OF_TRAINING)


def _without(**settings) -> Entry:
    """Tune our cells at the size of the preset, with one part removed or changed."""
    return Entry(makers.our_cells, ALL, OF_PRESET, settings=settings, tasks=TASKS)


METHODS = {
    "our cells, tuned": Entry(makers.our_cells, ALL),
    "our cells": Entry(makers.our_cells, ALL, settings={"n_generations": 0}),
    "our cells, no teacher": Entry(makers.no_teacher, ALL, (3, 4)),  # sizes of presets
    "k-means cells, DAgger": _corrected("k-means"),
    "CART": _uncorrected("tree"),
    "CART, DAgger": _corrected("tree", by_chance=False),
    "CART, linear leaves, DAgger": _corrected("linear tree", by_chance=False),
    "oblique tree, linear leaves, DAgger": _corrected("oblique tree", version=2),
    "teacher": Entry(makers.the_teacher, sizes=FOUND, chance=False),
    "one linear map": _uncorrected("one map", FOUND),
    "our cells, no annealing": _without(initial_temperature=0.04),
    "our cells, one restart": _without(n_restarts=1),
    "our cells, no correction": _without(n_corrections=0),
    "our cells, no slope beyond the limits": _without(clip_slope=1e-9),
    "our cells, no failure penalty": _without(failure_penalty=0.0),
    "our cells, weighted by criticality": _without(criticality=True),
    # The highest likeness to the teacher; and the highest return of policies whose R² is at least a given value
    "faithful": (_faithful := Entry(
        makers.faithful, OF_FAITHFUL, (1, 2, 3, 4, 6, 7, 8, 13), "faithful", version=VERSION, preset="faithful"
    )),
    **{f"faithful, R² {r2:g}": replace(_faithful, sizes=(2, 4, 8), table="demanded", settings={"min_r2": r2})
       for r2 in (0.5, 0.7, 0.8, 0.9, 0.95)},
    # The fit and the borders exchanged: all imitate the teacher's own episodes
    "our cells, our fit": _uncorrected("global cells", (2, 4, 8), table="apart"),
    "our cells, greedy fit": _uncorrected("greedy cells", (2, 4, 8), table="apart", version=2),
    "oblique tree, our fit": _uncorrected("global tree", (2, 4, 8), table="apart"),
    "oblique tree, greedy fit": _uncorrected("oblique tree", (2, 4, 8), table="apart", version=2),
    # The highest return, from the best policy where it is known; and searches with another start or another length
    "at the limit": (_limit := Entry(
        makers.limited, ALL, (1, 2, 3, 4, 8, 12), "limit", version=limit.VERSION, preset="limit"
    )),
    "at the limit, from the teacher": replace(
        _limit, make=partial(makers.limited, by_teacher=True), sizes=(3,), table="starts", tasks=TASKS[1:2]
    ),
    "our cells, 800 generations": replace(_without(n_generations=800), sizes=(3,), table="starts", tasks=TASKS[1:2]),
    # Robots: imitate the teacher, then continue training as its actor; and one linear map by returns alone
    "cells": (_cells := _robot(makers.robot_cells, OF_IMITATION, (1, 2, 4, 8, 16))),
    "cells, trained further": _further(_cells),
    "oblique tree": (_tree := _robot(makers.robot_tree, OF_IMITATION, (2, 4, 8, 16), version=2)),
    "oblique tree, trained further": _further(_tree),
    "one map, random search": (_search := _robot(makers.searched, OF_SEARCH)),
    "one map, longer search": replace(_search, settings={"n_random_steps": 18_000_000}, tasks=(WALKER,)),
    "robot's teacher": _robot(makers.the_teacher, (), chance=False),
}  # fmt: skip

# Methods tuned as our cells are, beside them untuned where no other table has them
_NEW = {
    "oblique tree, constant leaves, DAgger": _corrected(
        "constant oblique tree", sizes=TUNED_SIZES, version=2, table="tuned"
    ),
    "small network, DAgger": _corrected("small network", sizes=TUNED_SIZES, table="tuned"),
}
_UNTUNED = (
    "CART, DAgger", "CART, linear leaves, DAgger", "oblique tree, linear leaves, DAgger", "k-means cells, DAgger",
    "one linear map",
)  # fmt: skip
UNTUNED = _NEW | {name: METHODS[name] for name in _UNTUNED}
METHODS |= {f"{name}, tuned": _tuned(fit) for name, fit in UNTUNED.items()} | _NEW


@dataclass(frozen=True)
class Table:
    """The rows that are written to one file of a task."""

    seeds: range = range(20)
    fewer: range | None = None  # seeds of sizes other than the preset's; None: the same
    methods: tuple[str, ...] = ()  # empty: the methods whose table it is
    sizes: tuple[int, ...] = ()  # only these sizes; empty: all sizes of a method
    agents: tuple[int, ...] = (0,)  # teachers: 0 is the shipped one, the others are those of `further_teachers`
    keeps: str = ""  # the method whose policy of the preset's size and of the first seed is kept
    keeps_also: tuple[int, ...] = ()  # further sizes whose policy of the first seed is kept


OBLIQUE, ONE_MAP = "oblique tree, linear leaves, DAgger, tuned", "one linear map, tuned"  # the closest rivals
WITH_OTHERS = ("faithful", "teacher", "our cells, tuned", OBLIQUE, ONE_MAP)  # the methods that distil other teachers
_SMALL = {
    "methods": Table(),
    "tuned": Table(range(7)),
    "faithful": Table(fewer=range(6), keeps="faithful"),
    "apart": Table(range(5)),
    "demanded": Table(range(2)),
    "teachers": Table(range(5), methods=WITH_OTHERS, agents=(1, 2), sizes=FOUND + OF_PRESET),
    "limit": Table(fewer=range(3), keeps="at the limit"),
}
TABLES = {
    TASKS[0]: _SMALL | {
        "faithful": replace(_SMALL["faithful"], keeps_also=(4, 3)), "limit": replace(_SMALL["limit"], keeps_also=(1,))
    },
    TASKS[1]: _SMALL | {
        "limit": Table(range(5), range(3), sizes=(3, 4), keeps="at the limit"), "starts": Table(range(3))
    },
    TASKS[2]: _SMALL | {"limit": Table(range(10), range(3), sizes=(8, 12), keeps="at the limit")},
    LANDER: {
        "methods": Table(range(5)),
        "tuned": Table(
            range(3), methods=("CART, linear leaves, DAgger, tuned", OBLIQUE, ONE_MAP), sizes=(0, 1, 2, 4, 8)
        ),
        "faithful": Table(range(10), range(3), sizes=(0, 1, 2, 4, 8), keeps="faithful"),
        "limit": Table(range(2), sizes=(3,), keeps="at the limit"),
    },
    WALKER: {"robots": Table(range(3), keeps="cells, trained further")},
    CHEETAH: {"robots": Table(range(5), range(3), keeps="cells, trained further")},
}  # fmt: skip


def methods_of(task: str, table: str) -> dict[str, Entry]:
    """Return the methods that have rows of `task` in `table`, by name."""
    names = TABLES[task][table].methods or [name for name, method in METHODS.items() if method.table == table]
    return {name: METHODS[name] for name in names if task in (METHODS[name].tasks or TABLES)}


def sizes_of(task: str, method: Entry, table: Table) -> tuple[int, ...]:
    """Return the sizes at which `table` has a method."""
    if OF_PRESET[0] in method.sizes + table.sizes and method.sizes != FOUND:
        return (PRESETS[method.preset](task).n_cells,)
    return tuple(size for size in method.sizes if size in (table.sizes or method.sizes))


def method(name: str, size: int) -> Method:
    """Return a method of the table at a size, for `vsp.compare`."""
    entry = METHODS[name]

    def make(agent: Policy, task: Task, data: None, seed: int) -> Policy:
        config = replace(PRESETS[entry.preset](task), n_cells=max(1, size))
        return entry.make(agent, task, config, seed, **entry.settings)

    return Method(make, name=name, version=entry.version, settings=lambda task: {"size": size, **entry.read(task.name)})
