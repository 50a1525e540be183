"""Make a `Task` from any Gymnasium environment, with one environment per episode.

This suits physics engines, which step one state at a time.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

import gymnasium
import numpy as np
from gymnasium.envs.registration import find_highest_version, get_env_id, parse_env_id

from .base import ENDED, GOAL, PIT, RUNNING, TRUNCATED, Task

Outcome = Callable[[np.ndarray, float, dict], bool]  # (last observation, reward, info) to success

AT_ONCE = 500  # environments open together: as many as episodes of a teacher that a distillation rolls out together
API = {"reset": "(observation, info)", "step": "(observation, reward, terminated, truncated, info)"}

# Remedies for environments that do not fit
FLATTEN = "gymnasium.wrappers.FlattenObservation converts most of them"
CONTINUOUS = "linear maps give continuous actions, so choose another environment"
RAW = "expected the raw environment, and the agent's statistics by vsp.load_teacher(..., normalize=...)"


@dataclass
class _Episode:
    """A running episode: an environment and its last observation."""

    env: gymnasium.Env
    observation: np.ndarray


def _draw_seeds(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw seeds for `reset` as starts: integers in float64. (n, 1)"""
    return rng.integers(2**32, size=(n, 1)).astype(np.float64)


def begin_live(name: str, starts: np.ndarray) -> np.ndarray:
    """Return a freshly reset environment per start, which `end_live` closes. (n,) objects Raises ValueError for an
    environment of old Gym's API."""
    episodes = np.empty(len(starts), dtype=object)
    with ExitStack() as opened:  # closes them unless all begin
        for i, (seed,) in enumerate(starts):
            env = gymnasium.make(name, max_episode_steps=-1, disable_env_checker=True)  # the caller counts steps
            opened.callback(env.close)
            episodes[i] = _Episode(env, _answer(env, "reset", seed=int(seed))[0])
        opened.pop_all()
    return episodes


def end_live(states: np.ndarray) -> None:
    """Close the environments among `states`, all of them even if one fails to close."""
    with ExitStack() as opened:
        for episode in (state for state in states.flat if isinstance(state, _Episode)):  # others may be numbers
            opened.callback(episode.env.close)


def _answer(env: gymnasium.Env, method: str, *arguments: np.ndarray, **options: int) -> tuple:
    """Return what a method of `env` returns. Raises ValueError unless it takes and returns what Gymnasium's does."""
    try:
        answer, cause = getattr(env, method)(*arguments, **options), None
    except TypeError as error:
        if "unexpected keyword argument 'seed'" not in str(error):
            raise
        answer, cause = "an error for a seed", error
    if not isinstance(answer, tuple) or len(answer) != len(API[method].split(",")):
        given = f"`{method}` of {env.unwrapped.spec.id} gives {answer!r:.60}"  # before an array breaks the line
        raise ValueError(f"{given}, expected {API[method]}: change it from old Gym's API to Gymnasium's") from cause
    return answer


def _see_live(states: np.ndarray) -> np.ndarray:
    return np.array([episode.observation for episode in states], dtype=np.float64)


def _step_live(
    outcome: Outcome | None, states: np.ndarray, actions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Step every environment. `outcome` tells whether an episode that ended succeeded; None: success is undefined. An
    episode that the environment cuts off by itself counts as one that reached the step limit."""
    rewards, outcomes = np.zeros(len(states)), np.full(len(states), RUNNING)
    for i, (episode, action) in enumerate(zip(states, actions)):
        action = action.astype(episode.env.action_space.dtype)
        episode.observation, rewards[i], ended, cut, info = _answer(episode.env, "step", action)
        if ended:
            outcomes[i] = (GOAL if outcome(episode.observation, rewards[i], info) else PIT) if outcome else ENDED
        elif cut:
            outcomes[i] = TRUNCATED
    return states, rewards, outcomes


_KNOWN: dict[tuple[str, Outcome | None], tuple[object, Task]] = {}  # with the entry of Gymnasium's registry


def gymnasium_task(name: str, outcome: Outcome | None = None) -> Task:
    """Return the `Task` of a Gymnasium environment whose observations and actions are boxes of one dimension.

    `outcome` tells whether an episode that ended succeeded; None: success is undefined. Raises ValueError for other
    spaces, an action box of integers or without limits, an environment without a step limit, one that normalises its
    observations by their running statistics, and an old version that is gone. An environment that is registered anew
    gives a new task."""
    entry, known = gymnasium.registry.get(name), _KNOWN.get((name, outcome))
    if known is None or known[0] is not entry:
        known = _KNOWN[name, outcome] = entry, _made(name, outcome)
    return known[1]


def _made(name: str, outcome: Outcome | None) -> Task:
    try:
        env = gymnasium.make(name)
    except ImportError as error:
        newest = get_env_id(*(kin := parse_env_id(name)[:2]), find_highest_version(*kin))
        raise ValueError(f"cannot open {name}: {error if newest == name else f'use {newest}'}") from error
    observations, actions, max_steps = env.observation_space, env.action_space, env.spec.max_episode_steps
    env.close()
    while isinstance(env, gymnasium.Wrapper):
        if isinstance(env, gymnasium.wrappers.NormalizeObservation) and env.update_running_mean:
            raise ValueError(f"statistics of NormalizeObservation in {name} start anew in every episode: {RAW}")
        env = env.env
    similar = "Continuous-".join(name.rsplit("-", 1))
    choose = f"{CONTINUOUS}, such as {similar}" if similar in gymnasium.registry else CONTINUOUS
    for what, space, remedy in (("observations", observations, FLATTEN), ("actions", actions, choose)):
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise ValueError(f"{what} of {name} are {space}, expected a Box of one dimension: {remedy}")
    if actions.dtype.kind != "f":
        raise ValueError(f"actions of {name} are {actions}, expected floats, as -1.9 would act as -1: round in `step`")
    if not actions.is_bounded():
        raise ValueError(f"actions of {name} are {actions}, expected limits, as gymnasium.wrappers.RescaleAction sets")
    if max_steps is None:
        raise ValueError(f"{name} has no step limit, expected one: pass max_episode_steps to gymnasium.register")
    box = [limit.astype(np.float64) for space in (observations, actions) for limit in (space.low, space.high)]
    return live_task(name, *box, max_steps=max_steps, outcome=outcome)


def live_task(
    name: str, low: np.ndarray, high: np.ndarray, action_low: np.ndarray, action_high: np.ndarray, *, max_steps: int,
    outcome: Outcome | None = None,
) -> Task:  # fmt: skip
    """Return the `Task` of the environment `name` with the given boxes (d,) and (m,). Each episode opens the
    environment when it begins, at most `AT_ONCE` together."""
    inputs, outputs = tuple(f"s{i}" for i in range(len(low))), tuple(f"a{j}" for j in range(len(action_low)))
    return Task(
        name, inputs, outputs, inputs, low, high, action_low, action_high, max_steps, _draw_seeds,
        partial(_step_live, outcome), _see_live, partial(begin_live, name), 1, at_once=AT_ONCE, end=end_live,
        slowness=max(1, max_steps // 30),  # 30,000 steps for a thousand episodes
    )  # fmt: skip
