"""The tasks by name."""

import difflib
import importlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import NoReturn

import gymnasium
import numpy as np

from . import lunarlander, mountaincar, pendulum, simplegoal
from .base import Task
from .gym_adapter import Outcome, gymnasium_task

BOX = ("low", "high", "action_low", "action_high")  # the limits of a task
_ADDED: dict[str, Task] = {}  # by `register`
_TASKS = {module.TASK.name: module.TASK for module in (simplegoal, mountaincar, pendulum)}
_LATER: dict[str, Callable[[], Task]] = {}  # made on request: they open an environment

gymnasium.register("SimpleGoal-v0", entry_point="vsp.tasks.simplegoal:SimpleGoalEnv", max_episode_steps=50)


def register_maker(name: str, make: Callable[[], Task]) -> None:
    """Add a task that `make` returns, on its first use: it may open an environment or need another package."""
    _LATER[name] = cache(make)


register_maker(lunarlander.NAME, lunarlander.make)


def task_names() -> list[str]:
    """Return the names of the tasks that vsp knows: its own, and those that `register` added."""
    return [*_TASKS, *_LATER, *_ADDED]


def is_own(task: Task) -> bool:
    """Whether `task` is one of vsp's own as they are."""
    own = _TASKS.get(task.name) or (_LATER[task.name]() if task.name in _LATER else None)
    return task is own


def get_task(name: str | Task) -> Task:
    """Return the `Task` called `name`: one of `task_names()`, or any environment in Gymnasium's registry.
    "module:Name-v0" imports the module that registers Name-v0 first. A `Task` is returned as it is. Raises ValueError
    for an unknown name, with the most similar one, and as `gymnasium_task` does; what an import raises."""
    if isinstance(name, Task):
        return name
    if not isinstance(name, str) or name not in _ADDED:
        name = _registered(name)
    return _TASKS.get(name) or _ADDED.get(name) or _LATER.get(name, partial(gymnasium_task, name))()


def _registered(name: str) -> str:
    """Return `name` without its module, which is imported, if any. Raises ValueError for a name that Gymnasium does not
    know. The message suggests a similar name if there is one."""
    if not isinstance(name, str):
        raise ValueError(f"task is a {type(name).__name__}, expected a name or a Task: are the arguments in order?")
    module, colon, name = name.rpartition(":")
    if colon:
        importlib.import_module(module)
    if name in gymnasium.registry:
        return name
    known = task_names()
    near = difflib.get_close_matches(name, known) or difflib.get_close_matches(name, gymnasium.registry, cutoff=0.75)
    guess = f"did you mean {near[0]!r}?" if near else "if it is yours, import what registers it"
    raise ValueError(f"unknown task {name!r}, expected one of {known} or of Gymnasium's registry; {guess}")


def register(
    name: str | Task, *, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
    outcome: Outcome | None = None,
) -> Task:  # fmt: skip
    """Add an environment of Gymnasium's registry, or a `Task`, to vsp's tasks, for this process. Returns its `Task`.

    `inputs` and `outputs` name its observed variables and its actions; None: s0, s1, ... and a0, a1, ...
    `outcome(observation, reward, info)` tells whether an episode that ended succeeded; None: failures are undefined.
    A `Task` has its own names and outcomes. Raises ValueError for one of vsp's own tasks, for names that are too few,
    too many or not distinct, and as `get_task` does."""
    task, name = (name, name.name) if isinstance(name, Task) else (None, _registered(name))
    if name in (*_TASKS, *_LATER):
        raise ValueError(f"{name!r} is one of vsp's own tasks, expected the name of another")
    if task is not None:
        if (inputs, outputs, outcome) != (None, None, None):
            raise ValueError(f"the task {name!r} has names and outcomes, expected no others")
        _ADDED[name] = task
        return task
    if outcome is not None and not callable(outcome):
        raise ValueError(f"outcome is {outcome!r}, expected a function of the last observation, reward and info")
    plain = gymnasium_task(name, outcome)
    inputs = _names("inputs", inputs, plain.inputs)
    _ADDED[name] = replace(plain, inputs=inputs, input_labels=inputs, outputs=_names("outputs", outputs, plain.outputs))
    return _ADDED[name]


def _names(what: str, given: Sequence[str] | None, plain: tuple[str, ...]) -> tuple[str, ...]:
    if given is None:
        return plain
    names = () if isinstance(given, str) else tuple(given)
    distinct = {name for name in names if isinstance(name, str) and name not in ("", "bias")}
    if len(names) != len(plain) or len(distinct) != len(plain):
        raise ValueError(f"{what} are {given!r}, expected {len(plain)} different names, none of them 'bias'")
    return names


def saved_task(name: str, inputs: Sequence[str], outputs: Sequence[str], box: dict[str, np.ndarray]) -> Task:
    """Return the task of a saved policy, with the names and the `BOX` that were saved. If no such environment is
    registered, the task has no dynamics: its policy can act, but no episode can run. Raises ValueError if the
    environment of that name has another box."""
    inputs, outputs = tuple(inputs), tuple(outputs)
    try:
        known = get_task(name.rpartition(":")[2])  # a file must not make us import a module
    except (ValueError, gymnasium.error.Error):  # the latter if packages that it needs are missing
        absent = partial(_absent, name)
        low, high, action_low, action_high = (box[limit] for limit in BOX)
        return Task(name, inputs, outputs, inputs, low, high, action_low, action_high, 1, absent, absent)
    for limit in BOX:
        if not np.array_equal(getattr(known, limit), box[limit]):
            raise ValueError(f"{limit} of {name} is {getattr(known, limit)} here, but {box[limit]} in the file")
    same = (known.inputs, known.outputs) == (inputs, outputs)
    return known if same else replace(known, inputs=inputs, outputs=outputs, input_labels=inputs)


def _absent(name: str, *_) -> NoReturn:
    what = "is not registered here, so its policy can act but no episode can run: import what registers it"
    raise ValueError(f"{name} {what}")
