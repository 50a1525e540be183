"""Use your own agent as a teacher: a function of states, or a Stable-Baselines3 agent with continuous actions."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import numpy as np

from ..rollouts import Policy


class Agent:
    """A teacher made from a function of observations (n, d) that returns actions (n, m)."""

    def __init__(self, act: Callable[[np.ndarray], np.ndarray]):
        self._act = act

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), or (m,) for one (d,)."""
        return np.asarray(self._act(obs)), None


def agent(source: Policy | Callable[[np.ndarray], np.ndarray]) -> Agent:
    """Turn `source` into a teacher for `vsp.distill` and similar functions.

    `source` is an object with `predict`, such as a Stable-Baselines3 agent, or a function of a batch of observations
    (n, d) that returns actions (n, m). Stochastic agents (PPO, SAC, ...) give their most probable actions, because
    sampling noise carries no information. Raises ValueError for any other `source`.
    """
    if isinstance(source, Agent):
        return source
    if callable(predict := getattr(source, "predict", None)):
        options = {"deterministic": True} if "deterministic" in inspect.signature(predict).parameters else {}

        def act(obs: np.ndarray) -> np.ndarray:
            actions, state = predict(obs, **options)
            if state is not None:
                raise ValueError(
                    "the agent keeps a state between steps, expected actions that depend on the observation alone: "
                    "train one without memory, or put what it remembers into the observation"
                )
            return actions

        return Agent(act)
    if not callable(source):
        raise ValueError(f"the agent is {source!r}, expected something with `predict`, or a function of observations")
    return Agent(source)
