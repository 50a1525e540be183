"""Teachers: load a trained TD3 actor and act with it in batches, in NumPy alone.

A shipped teacher acts by three matrix products. torch is imported only to read a Stable-Baselines3 zip.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import re
import zipfile
import zlib
from pathlib import Path

import numpy as np

from . import store
from .checks import check_finite, check_observations
from .envs import Task, get_task, tasks

SHIPPED = store.ROOT / "data" / "teachers"


class Teacher:
    """A deterministic TD3 actor as arrays: ReLU layers and a tanh, scaled to the action box.

    `weights` maps the names that Stable-Baselines3 gives to the actor's tensors ("mu.0.weight", ...) to arrays. Raises
    ValueError when they do not fit the task.
    """

    def __init__(self, weights: dict[str, np.ndarray], task: str | Task, *, card: dict | None = None):
        self.task, self.card = get_task(task), card or {}
        indices = sorted(int(found[1]) for name in weights if (found := re.fullmatch(r"mu\.(\d+)\.weight", name)))
        if not indices:
            raise ValueError(
                f"expected the tensors of a TD3 or DDPG actor (mu.0.weight, ...), got {sorted(weights)[:6]}"
            )
        self.layers = [
            (_tensor(weights, f"mu.{i}.weight", 2).T.copy(), _tensor(weights, f"mu.{i}.bias", 1)) for i in indices
        ]
        inputs, outputs = self.layers[0][0].shape[0], self.layers[-1][0].shape[1]
        d, m = len(self.task.low), len(self.task.action_low)
        if (inputs, outputs) != (d, m):
            raise ValueError(
                f"the teacher has {inputs} inputs and {outputs} outputs, {self.task.name} has {d} and {m}: "
                "load it for the task it was trained on"
            )
        self._centre = (0.5 * (self.task.action_high + self.task.action_low)).astype(np.float32)
        self._half = (0.5 * (self.task.action_high - self.task.action_low)).astype(np.float32)

    @property
    def digest(self) -> str:
        """SHA-256 of the actor's weights, which tells teachers apart."""
        return hashlib.sha256(b"".join(part.tobytes() for layer in self.layers for part in layer)).hexdigest()

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) or (m,) in float32 for observations (n, d) or (d,)."""
        hidden = check_observations(obs, len(self.task.low), self.task.name).astype(np.float32)
        for weight, bias in self.layers[:-1]:
            hidden = np.maximum(hidden @ weight + bias, 0.0)
        weight, bias = self.layers[-1]
        return self._centre + self._half * np.tanh(hidden @ weight + bias), None


def _tensor(weights: dict[str, np.ndarray], name: str, ndim: int) -> np.ndarray:
    if name not in weights or weights[name].ndim != ndim:
        raise ValueError(f"expected a tensor {name} of {ndim} dimensions among {sorted(weights)[:6]}")
    return check_finite(name, weights[name]).astype(np.float32)


def load_teacher(source: str | os.PathLike, task: str | None = None) -> Teacher:
    """A teacher ready to act: the shipped one of a task by its name, or one from a file.

    `source` is a task's name, a `.safetensors` file with its JSON card beside it, or a `.zip` that Stable-Baselines3
    saved (then `task` says which task it is for). Tensors are all that is read: nothing is unpickled. Raises
    ValueError for an unknown task or a teacher that does not fit, FileNotFoundError, `store.DamagedFile`.
    """
    path = Path(source)
    if path.suffix == ".zip":
        if task is None:
            raise ValueError(f'{path}: say which task the agent is for: load_teacher("{path}", "{tasks()[0]}")')
        return Teacher(_read_zip(path), task)
    if path.suffix and path.suffix != ".safetensors":
        raise ValueError(f"{path}: expected a .safetensors file, a .zip, or the name of a task, one of {tasks()}")
    if not path.suffix:
        path = SHIPPED / f"{get_task(str(source)).name}.safetensors"
    from safetensors import SafetensorError
    from safetensors.numpy import load

    content, card = store.read_carded(path)
    try:
        tensors = load(content)
    except SafetensorError as error:
        raise store.DamagedFile(f"{path}: not a safetensors file: {error}") from error
    return Teacher(actor_tensors(tensors), task or card.get("task"), card=card)


def actor_tensors(tensors: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The actor's tensors among those of a whole agent, under the names that `Teacher` expects."""
    return {name.removeprefix("actor."): tensor for name, tensor in tensors.items() if name.startswith("actor.")}


def _read_zip(path: Path) -> dict[str, np.ndarray]:
    """The actor's tensors in a Stable-Baselines3 zip. torch's `weights_only` loading runs no code from the file."""
    import torch

    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file, expected a zip that Stable-Baselines3's `save` wrote")
    try:
        with zipfile.ZipFile(path) as archive:
            about = json.loads(archive.read("data"))
            tensors = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True, map_location="cpu")
        activation = about.get("policy_kwargs", {}).get("activation_fn", "ReLU")
        actor = {name: tensor.numpy() for name, tensor in actor_tensors(tensors).items()}
    except _NO_AGENT as error:
        reason = f"not a zip of a Stable-Baselines3 agent with tensors alone: {error!r:.300}"
        raise store.DamagedFile(f"{path}: {reason}") from error
    if "ReLU" not in str(activation):
        raise ValueError(f"{path}: the agent's activation is {activation}, expected ReLU")
    return actor


# What reading a zip that holds something else ends in
_NO_AGENT = (
    zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, KeyError, ValueError, RuntimeError, AttributeError,
    TypeError, pickle.UnpicklingError,
)  # fmt: skip
