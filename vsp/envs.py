"""The tasks: dynamics written once, on arrays of states; Gymnasium classes are thin adapters over them.

Every function that moves states takes a batch `(n, d)` and returns a batch, so that a thousand episodes advance in one
call. To add a task, write its `start` and `step`, and add a `Task` to `_TASKS`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import gymnasium
import numpy as np

from .checks import check_array

RUNNING, GOAL, PIT, TRUNCATED = range(4)
OUTCOMES = ("running", "goal", "pit", "truncated")

Step = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Task:
    """A continuous-control task whose states and actions are boxes.

    `start(rng, n)` draws start states (n, d) in float64. `step(states, actions)` maps (n, d), (n, m) to the next states
    (n, d), the rewards (n,) and the outcomes (n,), codes of `OUTCOMES`; truncation is counted by the caller.
    """

    name: str
    inputs: tuple[str, ...]  # symbols of the d state variables, as the paper prints them
    outputs: tuple[str, ...]  # symbols of the m actions
    input_labels: tuple[str, ...]  # axis labels, with units
    low: np.ndarray  # (d,) box that the states stay in
    high: np.ndarray  # (d,)
    action_low: np.ndarray  # (m,) box that actions are limited to
    action_high: np.ndarray  # (m,)
    max_steps: int  # an episode is truncated after this many steps
    start: Callable[[np.random.Generator, int], np.ndarray]
    step: Step

    def observe(self, states: np.ndarray) -> np.ndarray:
        """What a policy sees of `states`: the same numbers in float32, as Gymnasium hands them out. (n, d)"""
        return states.astype(np.float32)


# SimpleGoal (paper, section "Navigation task")

GOAL_EDGE = 0.1  # the goal is the box x < 0.1, y < 0.1
PIT_LOW, PIT_HIGH = 0.4, 0.6  # the pit is the open square between them
STRIDE = 0.1  # length of a step at full action, per axis


def simplegoal_start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Uniform over the whole unit square, pit and goal included. (n, 2)"""
    return rng.uniform(0.0, 1.0, size=(n, 2))


def simplegoal_step(
    states: np.ndarray, actions: np.ndarray, *, goal_reward: str = "replace"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move by a tenth of the action; the reward is ten times the distance gained towards the origin.

    Entering the goal pays +10 and the pit -10; `goal_reward` says whether this replaces the progress term ("replace",
    which the paper's own numbers ask for: its teacher's minimum is exactly -10.0) or comes on top of it ("add", which
    its prose says).
    """
    moved = np.clip(states + STRIDE * np.clip(actions, -1.0, 1.0), 0.0, 1.0)
    progress = 10.0 * (np.hypot(states[:, 0], states[:, 1]) - np.hypot(moved[:, 0], moved[:, 1]))
    in_goal = (moved < GOAL_EDGE).all(axis=1)
    in_pit = ((moved > PIT_LOW) & (moved < PIT_HIGH)).all(axis=1)
    bonus = 10.0 * in_goal - 10.0 * in_pit
    rewards = progress + bonus if goal_reward == "add" else np.where(in_goal | in_pit, bonus, progress)
    outcomes = np.select([in_goal, in_pit], [GOAL, PIT], RUNNING)
    return moved, rewards, outcomes


class SimpleGoalEnv(gymnasium.Env):
    """SimpleGoal for Gymnasium: one episode at a time over `simplegoal_start` and `simplegoal_step`."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, render_mode: str | None = None, goal_reward: str = "replace"):
        if goal_reward not in ("replace", "add"):
            raise ValueError(f'goal_reward is {goal_reward!r}, expected "replace" or "add"')
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (2,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.render_mode = render_mode
        self._step = partial(simplegoal_step, goal_reward=goal_reward)
        self.state = np.zeros(2)  # float64; the observation is its float32 copy

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        super().reset(seed=seed)
        self.state = simplegoal_start(self.np_random, 1)[0]
        return self.state.astype(np.float32), {}

    def step(self, action: np.ndarray):
        action = check_array("action", action, (2,))
        (self.state,), (reward,), (outcome,) = self._step(self.state[None], action[None])
        info = {"outcome": OUTCOMES[outcome]}
        return self.state.astype(np.float32), float(reward), bool(outcome != RUNNING), False, info

    def render(self) -> np.ndarray:
        """A (400, 400, 3) picture in bytes: goal blue-green, pit grey, agent dark blue; y points up."""
        x, y = np.meshgrid((np.arange(400) + 0.5) / 400, (399.5 - np.arange(400)) / 400)
        image = np.full((400, 400, 3), 255, np.uint8)
        image[(x < GOAL_EDGE) & (y < GOAL_EDGE)] = (2, 158, 115)
        image[(x > PIT_LOW) & (x < PIT_HIGH) & (y > PIT_LOW) & (y < PIT_HIGH)] = (128, 128, 128)
        image[np.hypot(x - self.state[0], y - self.state[1]) < 0.02] = (1, 60, 130)
        return image


# MountainCarContinuous-v0: Gymnasium's own environment, its dynamics on arrays


def mountaincar_start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Position uniform in [-0.6, -0.4] (no unit), at rest. (n, 2)"""
    return np.column_stack([rng.uniform(-0.6, -0.4, size=n), np.zeros(n)])


def mountaincar_step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gymnasium's `Continuous_MountainCarEnv.step`, for a batch.

    As there, the cost is that of the action *before* it is limited to [-1, 1], and the state is kept in float32 after
    the first step.
    """
    position, velocity = states.T
    force = np.clip(actions[:, 0], -1.0, 1.0)
    velocity = np.clip(velocity + 0.0015 * force - 0.0025 * np.cos(3 * position), -0.07, 0.07)
    position = np.clip(position + velocity, -1.2, 0.6)
    velocity = np.where((position == -1.2) & (velocity < 0), 0.0, velocity)  # the wall on the left stops the car
    at_goal = (position >= 0.45) & (velocity >= 0)
    rewards = 100.0 * at_goal - 0.1 * actions[:, 0] ** 2
    moved = np.column_stack([position, velocity]).astype(np.float32).astype(np.float64)
    return moved, rewards, np.where(at_goal, GOAL, RUNNING)


# Registry

_UNIT = np.ones(1)
_TASKS = {
    "SimpleGoal-v0": Task(
        name="SimpleGoal-v0",
        inputs=("x", "y"),
        outputs=("Δx", "Δy"),
        input_labels=("x", "y"),
        low=np.zeros(2),
        high=np.ones(2),
        action_low=-np.ones(2),
        action_high=np.ones(2),
        max_steps=50,
        start=simplegoal_start,
        step=simplegoal_step,
    ),
    "MountainCarContinuous-v0": Task(
        name="MountainCarContinuous-v0",
        inputs=("x", "v"),
        outputs=("F",),
        input_labels=("position", "velocity (per step)"),
        low=np.array([-1.2, -0.07]),
        high=np.array([0.6, 0.07]),
        action_low=-_UNIT,
        action_high=_UNIT,
        max_steps=999,
        start=mountaincar_start,
        step=mountaincar_step,
    ),
}

gymnasium.register("SimpleGoal-v0", entry_point="vsp.envs:SimpleGoalEnv", max_episode_steps=50)


def tasks() -> list[str]:
    """Names of the tasks that vsp knows."""
    return list(_TASKS)


def get_task(name: str | Task) -> Task:
    """The `Task` called `name`; a `Task` passes through. Raises ValueError with the nearest name for a typo."""
    if isinstance(name, Task):
        return name
    if name not in _TASKS:
        near = difflib.get_close_matches(str(name), _TASKS, n=1, cutoff=0.0)
        raise ValueError(f"unknown task {name!r}, expected one of {tasks()}; did you mean {near[0]!r}?")
    return _TASKS[name]


def render(name: str, state: np.ndarray) -> np.ndarray:
    """A picture of the task in `state` (d,), as Gymnasium draws it. (height, width, 3) bytes"""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pygame, which draws some tasks, needs no screen then
    env = gymnasium.make(get_task(name).name, render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = np.asarray(state, dtype=np.float64)
    image = env.render()
    env.close()
    return image
