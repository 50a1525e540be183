"""The tasks by name."""

from __future__ import annotations

import difflib
import os
from functools import cache, partial

import gymnasium
import numpy as np

from ..checks import check_array
from . import lunarlander, mountaincar, pendulum, simplegoal
from .base import Task
from .gym_adapter import gymnasium_task

_TASKS = {module.TASK.name: module.TASK for module in (simplegoal, mountaincar, pendulum)}
_LATER = {lunarlander.NAME: cache(lunarlander.make)}  # made on request: it opens an environment

gymnasium.register("SimpleGoal-v0", entry_point="vsp.tasks.simplegoal:SimpleGoalEnv", max_episode_steps=50)


def task_names() -> list[str]:
    """Names of the tasks that vsp knows."""
    return [*_TASKS, *_LATER]


def get_task(name: str | Task) -> Task:
    """The `Task` called `name`: one of ours, or any environment in Gymnasium's registry. A `Task` passes through.

    Raises ValueError with the nearest name for a typo, and as `gymnasium_task` does.
    """
    if isinstance(name, Task):
        return name
    if isinstance(name, str) and name in _TASKS:
        return _TASKS[name]
    (near,) = difflib.get_close_matches(str(name), task_names(), n=1, cutoff=0.0)
    if not isinstance(name, str) or name not in gymnasium.registry:
        raise ValueError(f"unknown task {name!r}, expected one of {task_names()}; did you mean {near!r}?")
    try:
        return _LATER.get(name, partial(gymnasium_task, name))()
    except ValueError as error:
        raise ValueError(f"{error}; did you mean {near!r}?") from error


def render(name: str, state: np.ndarray) -> np.ndarray:
    """A picture of the task in `state` (s,), as Gymnasium draws it. (height, width, 3) bytes"""
    state = check_array("state", state, (get_task(name).start_size or len(get_task(name).low),))
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # so that pygame needs no screen
    env = gymnasium.make(get_task(name).name, render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = state
    image = env.render()
    env.close()
    return image


# Tasks stepped by a physics engine: policies are evaluated on so many times fewer episodes
SLOW = {"LunarLanderContinuous-v3": 10}
