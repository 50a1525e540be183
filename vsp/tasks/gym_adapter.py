"""Make a `Task` from any Gymnasium environment, with one environment per episode.

This suits physics engines, which step one state at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import gymnasium
import numpy as np

from .base import ENDED, GOAL, PIT, RUNNING, TRUNCATED, Task

Outcome = Callable[[np.ndarray, float, dict], bool]  # (last observation, reward, info) to success

# Remedies for spaces that do not fit
FLATTEN = "gymnasium.wrappers.FlattenObservation converts most of them"
CONTINUOUS = "linear maps give continuous actions, so choose another environment"


@dataclass
class _Episode:
    """A running episode: an environment and its last observation."""

    env: gymnasium.Env
    observation: np.ndarray


def _draw_seeds(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw seeds for `reset` as starts: integers in float64. (n, 1)"""
    return rng.integers(2**32, size=(n, 1)).astype(np.float64)


def begin_live(name: str, starts: np.ndarray) -> np.ndarray:
    """Return a freshly reset environment per start. (n,) objects"""
    episodes = np.empty(len(starts), dtype=object)
    for i, (seed,) in enumerate(starts):
        env = gymnasium.make(name, max_episode_steps=-1, disable_env_checker=True)  # no step limit: the caller counts
        episodes[i] = _Episode(env, env.reset(seed=int(seed))[0])
    return episodes


def _see_live(states: np.ndarray) -> np.ndarray:
    return np.array([episode.observation for episode in states], dtype=np.float64)


def _step_live(
    outcome: Outcome | None, states: np.ndarray, actions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Step every environment. `outcome` tells whether an episode that ended succeeded; None: success is undefined.

    An episode that the environment cuts off by itself counts as one that reached the step limit.
    """
    rewards, outcomes = np.zeros(len(states)), np.full(len(states), RUNNING)
    for i, (episode, action) in enumerate(zip(states, actions)):
        action = action.astype(episode.env.action_space.dtype)
        episode.observation, rewards[i], ended, cut, info = episode.env.step(action)
        if ended and outcome:
            outcomes[i] = GOAL if outcome(episode.observation, rewards[i], info) else PIT
        elif ended:
            outcomes[i] = ENDED
        elif cut:
            outcomes[i] = TRUNCATED
    return states, rewards, outcomes


_KNOWN: dict[tuple[str, Outcome | None], tuple[object, Task]] = {}  # with the entry of Gymnasium's registry


def gymnasium_task(name: str, outcome: Outcome | None = None) -> Task:
    """Return the `Task` of a Gymnasium environment whose observations and actions are boxes of one dimension.

    `outcome` tells whether an episode that ended succeeded; None: success is undefined. Raises ValueError for other
    spaces, an action box without limits, or an environment without a step limit. An environment that is registered anew
    gives a new task.
    """
    entry, known = gymnasium.registry.get(name), _KNOWN.get((name, outcome))
    if known is None or known[0] is not entry:
        known = _KNOWN[name, outcome] = entry, _made(name, outcome)
    return known[1]


def _made(name: str, outcome: Outcome | None) -> Task:
    env = gymnasium.make(name)
    observations, actions, max_steps = env.observation_space, env.action_space, env.spec.max_episode_steps
    env.close()
    for what, space, remedy in (("observations", observations, FLATTEN), ("actions", actions, CONTINUOUS)):
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise ValueError(f"{what} of {name} are {space}, expected a Box of one dimension: {remedy}")
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
    """Return the `Task` of the environment `name` with the given boxes (d,) and (m,).

    Each episode opens the environment when it begins.
    """
    inputs, outputs = tuple(f"s{i}" for i in range(len(low))), tuple(f"a{j}" for j in range(len(action_low)))
    return Task(
        name, inputs, outputs, inputs, low, high, action_low, action_high, max_steps, start=_draw_seeds,
        step=partial(_step_live, outcome), see=_see_live, begin=partial(begin_live, name), start_size=1,
    )  # fmt: skip
