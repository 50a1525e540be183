"""A reader's own agent as a teacher: a function of states, or an agent of Stable-Baselines3 with continuous actions."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import numpy as np

from ..rollouts import Policy


class Agent:
    """A function from observations (n, d) to actions (n, m), as a teacher."""

    def __init__(self, act: Callable[[np.ndarray], np.ndarray]):
        self._act = act

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), or (m,) for one (d,)."""
        return np.asarray(self._act(obs)), None


def _without_state(predicted: tuple[np.ndarray, object]) -> np.ndarray:
    actions, state = predicted
    if state is not None:
        raise ValueError(
            "the agent keeps a state between steps, expected actions that depend on the observation alone: train one "
            "without memory, or put what it remembers into the observation"
        )
    return actions


def agent(source: Policy | Callable[[np.ndarray], np.ndarray]) -> Agent:
    """`source` as a teacher for `vsp.distill` and the like.

    Either something with `predict`, such as an agent of Stable-Baselines3, or a function of a batch of observations
    (n, d) that returns actions (n, m). Stochastic agents (PPO, SAC, ...) are asked for their most probable actions:
    sampling noise carries no information. Raises ValueError for anything else.
    """
    if isinstance(source, Agent):
        return source
    if callable(predict := getattr(source, "predict", None)):
        options = {"deterministic": True} if "deterministic" in inspect.signature(predict).parameters else {}
        return Agent(lambda obs: _without_state(predict(obs, **options)))
    if not callable(source):
        raise ValueError(f"the agent is {source!r}, expected something with `predict`, or a function of observations")
    return Agent(source)
