"""One door for every agent: the file of one, a model in memory, a function of observations."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from typing import Any

import numpy as np

from ..policy import VoronoiPolicy
from ..rollouts import Policy
from ..tasks.base import Task
from .teacher import Teacher, load_teacher


class Agent:
    """A teacher made from a function of observations (n, d) that returns actions (n, m)."""

    def __init__(self, act: Callable[[np.ndarray], np.ndarray]):
        self._act, self._asked = act, False

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), or (m,) for one (d,).

        Raises ValueError if the first answer is not the same twice: a sampled action carries no information.
        """
        actions = np.asarray(self._act(obs))
        if not self._asked and not np.array_equal(actions, np.asarray(self._act(obs)), equal_nan=True):
            raise ValueError(
                "the agent answers the same observations differently, expected actions without noise: let it take its "
                "most probable action"
            )
        self._asked = True
        return actions, None


def agent(
    source: Policy | Callable[[np.ndarray], np.ndarray] | str | os.PathLike, task: str | Task | None = None, **options
) -> Policy:
    """Turn `source` into a teacher for `vsp.distill` and similar functions.

    `source` is a file or the name of a task, as `load_teacher` takes them with `task` and `options`; an object with
    `predict`, such as a Stable-Baselines3 model, with the normalisation of its observations if it has one, or the one
    in the file `normalize`; or a function of a batch of observations (n, d) that returns actions (n, m). Stochastic
    agents (PPO, SAC, ...) give their most probable actions, because sampling noise carries no information. What is a
    teacher already stays as it is. Raises ValueError for any other `source`.
    """
    if isinstance(source, str | os.PathLike):
        return load_teacher(source, task, **options)
    predict = getattr(source, "predict", source)
    if not callable(predict):
        raise ValueError(f"the agent is {source!r}, expected a file, something with `predict`, or a function")
    ready = isinstance(source, Agent | Teacher | VoronoiPolicy)
    if options and (ready or predict is source or {*options} != {"normalize"}):
        raise ValueError(f"{', '.join(options)} for {type(source).__name__}, expected nothing, or normalize of a model")
    if ready:
        return source  # type: ignore[return-value]
    return Agent(predict if predict is source else _deterministic(source, **options))


def _deterministic(model: Any, normalize: str | os.PathLike | bool | None = None) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function of observations that gives the model's actions without sampling."""
    from . import normalization  # here: most teachers are no models

    parameters = inspect.signature(model.predict).parameters
    takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    options = {"deterministic": True} if takes_any or "deterministic" in parameters else {}
    statistics = normalization.of_model(model, normalize)

    def act(obs: np.ndarray) -> np.ndarray:
        answer = model.predict(statistics(obs).astype(np.float32) if statistics else obs, **options)
        actions, state = answer if isinstance(answer, tuple) else (answer, None)
        if state is not None:
            raise ValueError(
                "the agent keeps a state between steps, expected actions that depend on the observation alone: "
                "train one without memory, or put what it remembers into the observation"
            )
        return actions

    return act
