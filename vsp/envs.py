"""The tasks: dynamics written once, on arrays of states; Gymnasium classes are thin adapters over them.

Every function that moves states takes a batch of n and returns a batch, so that a thousand episodes advance in one
call. To add a task, write its `start` and `step`, and add a `Task` to `_TASKS`; where the dynamics are out of reach (a
physics engine), `gymnasium_task` plays Gymnasium's own environment, one copy per episode.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import gymnasium
import numpy as np

from .checks import check_array, check_choice

RUNNING, GOAL, PIT, TRUNCATED = range(4)
OUTCOMES = ("running", "goal", "pit", "truncated")

Step = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def _as_it_is(states: np.ndarray) -> np.ndarray:
    """The same array: of most tasks starts, states and observations are one thing."""
    return states


@dataclass(frozen=True)
class Signals:
    """What a PID controller of a task works with: q numbers computed from what it sees."""

    names: tuple[str, ...]  # symbols, "e" the error and "ė" its derivative
    compute: Callable[[np.ndarray], np.ndarray]  # observations (..., d) to signals (..., q)
    code: tuple[str, ...]  # the same, as C and Python compute them from an array `state`
    sizes: tuple[float, ...]  # the largest they come to in the box of the observations


@dataclass(frozen=True)
class Task:
    """A continuous-control task whose observations and actions are boxes.

    `start(rng, n)` draws start states (n, s) in float64, plain numbers that name a beginning; `begin` makes the states
    of them that `step(states, actions)` moves: with actions (n, m) to the next states, the rewards (n,) and the
    outcomes (n,), codes of `OUTCOMES`; truncation is counted by the caller. `see` turns states into the d numbers that
    a policy works with. In most tasks start, state and what is seen of it are the same array (n, d).
    """

    name: str
    inputs: tuple[str, ...]  # symbols of the d observed variables, as the paper prints them
    outputs: tuple[str, ...]  # symbols of the m actions
    input_labels: tuple[str, ...]  # axis labels, with units
    low: np.ndarray  # (d,) box that the observations stay in
    high: np.ndarray  # (d,)
    action_low: np.ndarray  # (m,) box that actions are limited to
    action_high: np.ndarray  # (m,)
    max_steps: int  # an episode is truncated after this many steps
    start: Callable[[np.random.Generator, int], np.ndarray]
    step: Step
    see: Callable[[np.ndarray], np.ndarray] = _as_it_is
    begin: Callable[[np.ndarray], np.ndarray] = _as_it_is
    start_size: int | None = None  # s, where it is not d
    signals: Signals | None = None  # None: the task has no natural error

    def observe(self, states: np.ndarray) -> np.ndarray:
        """What a policy sees of `states`, in float32, as Gymnasium hands it out. (n, d)"""
        return self.see(states).astype(np.float32)


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
        check_choice("goal_reward", goal_reward, ("replace", "add"))
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

MOUNTAINCAR_FLAG = 0.45  # position of the goal


def mountaincar_start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Position uniform in [-0.6, -0.4] (no unit), at rest. (n, 2)"""
    return np.column_stack([rng.uniform(-0.6, -0.4, size=n), np.zeros(n)])


def mountaincar_signals(states: np.ndarray) -> np.ndarray:
    """How far the flag is, and how fast that grows, per step. (..., 2)"""
    return np.stack([MOUNTAINCAR_FLAG - states[..., 0], -states[..., 1]], axis=-1)


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
    at_goal = (position >= MOUNTAINCAR_FLAG) & (velocity >= 0)
    rewards = 100.0 * at_goal - 0.1 * actions[:, 0] ** 2
    moved = np.column_stack([position, velocity]).astype(np.float32).astype(np.float64)
    return moved, rewards, np.where(at_goal, GOAL, RUNNING)


# Pendulum-v1: Gymnasium's own environment, its dynamics on arrays


def pendulum_start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Angle (rad, 0 is upright) uniform over the circle, angular velocity (rad/s) uniform in [-1, 1]. (n, 2)"""
    return rng.uniform([-np.pi, -1.0], [np.pi, 1.0], size=(n, 2))


def pendulum_see(states: np.ndarray) -> np.ndarray:
    """Cosine and sine of the angle, and the angular velocity. (n, 3)"""
    angle, velocity = states.T
    return np.column_stack([np.cos(angle), np.sin(angle), velocity])


def pendulum_signals(seen: np.ndarray) -> np.ndarray:
    """The angle (rad) that is missing to upright, and how fast that grows (rad/s). (..., 2)"""
    return np.stack([-np.arctan2(seen[..., 1], seen[..., 0]), -seen[..., 2]], axis=-1)


def pendulum_step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gymnasium's `PendulumEnv.step`, for a batch: a rod of 1 kg and 1 m, 10 m/s2, 0.05 s a step; it never ends."""
    angle, velocity = states.T
    torque = np.clip(actions[:, 0], -2.0, 2.0)
    upright = (angle + np.pi) % (2 * np.pi) - np.pi
    rewards = -(upright**2 + 0.1 * velocity**2 + 0.001 * torque**2)
    velocity = np.clip(velocity + (15.0 * np.sin(angle) + 3.0 * torque) * 0.05, -8.0, 8.0)
    return np.column_stack([angle + velocity * 0.05, velocity]), rewards, np.full(len(states), RUNNING)


# Any environment of Gymnasium, one copy per episode


@dataclass
class _Live:
    """An episode under way: an environment and the last that it let see."""

    env: gymnasium.Env
    observation: np.ndarray


def _draw_seeds(rng: np.random.Generator, n: int) -> np.ndarray:
    """Seeds for `reset` as start states: whole numbers in float64. (n, 1)"""
    return rng.integers(2**32, size=(n, 1)).astype(np.float64)


def _begin_live(name: str, starts: np.ndarray) -> np.ndarray:
    """A freshly reset environment per start. (n,) objects"""
    live = np.empty(len(starts), dtype=object)
    for i, (seed,) in enumerate(starts):
        env = gymnasium.make(name).unwrapped  # without the limit of steps, which the caller counts
        live[i] = _Live(env, env.reset(seed=int(seed))[0])
    return live


def _see_live(states: np.ndarray) -> np.ndarray:
    return np.array([live.observation for live in states], dtype=np.float64)


def _step_live(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A step of every environment. An end that pays is a goal, one that costs is a pit."""
    rewards, outcomes = np.zeros(len(states)), np.full(len(states), RUNNING)
    for i, (live, action) in enumerate(zip(states, actions)):
        live.observation, rewards[i], ended, _, _ = live.env.step(action.astype(live.env.action_space.dtype))
        if ended:
            outcomes[i] = GOAL if rewards[i] > 0 else PIT
    return states, rewards, outcomes


@cache
def gymnasium_task(name: str) -> Task:
    """The `Task` of any environment of Gymnasium whose observations and actions are boxes of one dimension.

    Raises ValueError for other spaces, an action box without limits, or an environment without a limit of steps.
    """
    env = gymnasium.make(name)
    seen, acts, most = env.observation_space, env.action_space, env.spec.max_episode_steps
    env.close()
    for what, space in (("observations", seen), ("actions", acts)):
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise ValueError(f"{what} of {name} are {space}, expected a Box of one dimension")
    if not (np.isfinite(acts.low).all() and np.isfinite(acts.high).all()) or most is None:
        raise ValueError(f"{name} has actions {acts} and {most} steps at most, expected limits for both")
    return Task(
        name=name,
        inputs=(inputs := tuple(f"s{i}" for i in range(seen.shape[0]))),
        outputs=tuple(f"a{j}" for j in range(acts.shape[0])),
        input_labels=inputs,
        low=seen.low.astype(np.float64),
        high=seen.high.astype(np.float64),
        action_low=acts.low.astype(np.float64),
        action_high=acts.high.astype(np.float64),
        max_steps=most,
        start=_draw_seeds,
        step=_step_live,
        see=_see_live,
        begin=partial(_begin_live, name),
        start_size=1,
    )


def _lunarlander() -> Task:
    return replace(
        gymnasium_task("LunarLanderContinuous-v3"),
        inputs=("x", "y", "vx", "vy", "θ", "ω", "l", "r"),
        outputs=("main", "side"),
        input_labels=(
            "x (half widths)",
            "height above the pad",
            "vx",
            "vy",
            "angle (rad)",
            "ω",
            "left leg down",
            "right leg down",
        ),  # fmt: skip
    )


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
        signals=Signals(
            ("e", "ė"),
            mountaincar_signals,
            (f"{MOUNTAINCAR_FLAG} - state[0]", "-state[1]"),
            (MOUNTAINCAR_FLAG + 1.2, 0.07),
        ),
    ),
    "Pendulum-v1": Task(
        name="Pendulum-v1",
        inputs=("cos θ", "sin θ", "ω"),
        outputs=("τ",),
        input_labels=("cos θ", "sin θ", "angular velocity (rad/s)"),
        low=np.array([-1.0, -1.0, -8.0]),
        high=np.array([1.0, 1.0, 8.0]),
        action_low=-2 * _UNIT,
        action_high=2 * _UNIT,
        max_steps=200,
        start=pendulum_start,
        step=pendulum_step,
        see=pendulum_see,
        start_size=2,
        signals=Signals(("e", "ė"), pendulum_signals, ("-atan2(state[1], state[0])", "-state[2]"), (np.pi, 8.0)),
    ),
}
_LATER = {"LunarLanderContinuous-v3": cache(_lunarlander)}  # made when asked for: it opens an environment

gymnasium.register("SimpleGoal-v0", entry_point="vsp.envs:SimpleGoalEnv", max_episode_steps=50)


def tasks() -> list[str]:
    """Names of the tasks that vsp knows."""
    return [*_TASKS, *_LATER]


def get_task(name: str | Task) -> Task:
    """The `Task` called `name`, one of ours or an environment that Gymnasium knows; a `Task` passes through.

    Raises ValueError with the nearest name for a typo, and as `gymnasium_task` does.
    """
    if isinstance(name, Task):
        return name
    if isinstance(name, str) and name in _TASKS:
        return _TASKS[name]
    (near,) = difflib.get_close_matches(str(name), tasks(), n=1, cutoff=0.0)
    if not isinstance(name, str) or name not in gymnasium.registry:
        raise ValueError(f"unknown task {name!r}, expected one of {tasks()}; did you mean {near!r}?")
    try:
        return _LATER.get(name, partial(gymnasium_task, name))()
    except ValueError as error:
        raise ValueError(f"{error}; did you mean {near!r}?") from error


def render(name: str, state: np.ndarray) -> np.ndarray:
    """A picture of the task in `state` (s,), as Gymnasium draws it. (height, width, 3) bytes"""
    state = check_array("state", state, (get_task(name).start_size or len(get_task(name).low),))
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pygame, which draws some tasks, needs no screen then
    env = gymnasium.make(get_task(name).name, render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = state
    image = env.render()
    env.close()
    return image
