"""One door for every agent: the file of one, a model in memory, a function of observations."""

import hashlib
import inspect
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..policy import PiecewisePolicy
from ..rollouts import Policy
from ..tasks import Task, get_task
from .actors import check_spaces
from .teacher import Teacher, load_teacher

if TYPE_CHECKING:
    from .normalization import Normalization


class Agent:
    """A teacher made from a function of observations (n, d) that returns actions (n, m). `identify` returns what its
    `digest` is made of, None if nobody knows."""

    def __init__(self, act: Callable[[np.ndarray], np.ndarray], identify: Callable[[], bytes | None] = lambda: None):
        self._act, self._identify, self._asked = act, identify, False

    @property
    def digest(self) -> str | None:
        """SHA-256 of the weights that act, or of the name that the user gave; None if there is neither."""
        known = self._identify()
        return None if known is None else hashlib.sha256(known).hexdigest()

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), or (m,) for one (d,). Raises ValueError if the first answer is not
        the same twice: a sampled action carries no information."""
        actions = np.asarray(self._act(obs))
        if not self._asked and not np.array_equal(actions, np.asarray(self._act(obs)), equal_nan=True):
            raise ValueError(
                "the agent answers the same observations differently, expected actions without noise or memory: let it "
                "take its most probable action, and put what it remembers into the observation"
            )
        self._asked = True
        return actions, None


def agent(
    source: Policy | Callable[[np.ndarray], np.ndarray] | str | os.PathLike, task: str | Task | None = None, *,
    name: str | None = None, normalize: Any = None,
) -> Policy:  # fmt: skip
    """Turn `source` into a teacher for `vsp.distill` and similar functions.

    `source` is a file or the name of a task, as `load_teacher` takes them with `task` and `normalize`; an object with
    `predict`, such as a Stable-Baselines3 model; or a function of a batch of observations (n, d) that returns actions
    (n, m). A model keeps the normalisation of its observations if its environment has one; `normalize` gives one: a
    file of `VecNormalize`, such an object, or (mean, variance). Stochastic agents (PPO, SAC, ...) give their most
    probable actions, because sampling noise carries no information. `name` identifies a function where its runs are
    stored: give another name to another function. What is a teacher already stays as it is. Raises ValueError for any
    other `source`, and for a model whose spaces are not those of `task`."""
    task = None if task is None else get_task(task)
    if isinstance(source, str | os.PathLike):
        return load_teacher(source, task, normalize=normalize)
    predict = getattr(source, "predict", source)
    if not callable(predict):
        raise ValueError(f"the agent is {source!r}, expected a file, something with `predict`, or a function")
    if isinstance(source, Agent | Teacher | PiecewisePolicy):
        if normalize is not None:
            raise ValueError(f"normalize for {type(source).__name__}, expected none: it belongs to a model or function")
        return source
    from . import normalization  # here: most teachers are shipped

    if task is not None and hasattr(source, "action_space"):
        check_spaces(lambda space: getattr(source, space, None), task)
    statistics = normalization.of_model(source, normalize)
    act = _deterministic(source) if hasattr(source, "predict") else predict
    seen = (lambda obs: act(statistics(obs).astype(np.float32))) if statistics else act
    of_function = name.encode() + _bytes(statistics) if name else None
    return Agent(seen, lambda: of_function or _weights(source, statistics))


def digest_of(agent: Policy) -> str:
    """Return the identity of an agent. Raises ValueError if it has none, for its runs could be taken for another's."""
    digest = getattr(agent, "digest", None)
    if not digest:
        raise ValueError(f'the agent {agent!r:.60} has no identity, expected a name: vsp.agent(function, name="mine")')
    return digest


def _weights(model: Any, statistics: "Normalization | None") -> bytes | None:
    """Return the weights of a Stable-Baselines3 model and its statistics of observations; None for other objects."""
    if hasattr(model, "digest"):
        return str(model.digest).encode()
    state = getattr(getattr(model, "policy", None), "state_dict", None)
    if state is None:
        return None
    parts = [part for name, tensor in state().items() for part in (name.encode(), tensor.cpu().numpy().tobytes())]
    return b"".join(parts) + _bytes(statistics)


def _bytes(statistics: "Normalization | None") -> bytes:
    return b"".join(np.asarray(part).tobytes() for part in statistics or ())


def _deterministic(model: Any) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function of observations that gives the model's actions without sampling."""
    parameters = inspect.signature(model.predict).parameters
    takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    options = {"deterministic": True} if takes_any or "deterministic" in parameters else {}

    def act(obs: np.ndarray) -> np.ndarray:
        answer = model.predict(obs, **options)
        actions, state = answer if isinstance(answer, tuple) else (answer, None)
        if state is not None:
            raise ValueError(
                "the agent keeps a state between steps, expected actions that depend on the observation alone: "
                "train one without memory, or put what it remembers into the observation"
            )
        return actions

    return act
