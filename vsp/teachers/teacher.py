"""Load a trained TD3 actor as a teacher and act with it in batches. This needs only NumPy: three matrix products."""

from __future__ import annotations

import hashlib
import json
import os
import re
from pathlib import Path

import numpy as np

from ..checks import check_array, check_observations
from ..run import atomic, listed
from ..tasks.base import Task
from ..tasks.registry import get_task, task_names
from .agent_zip import part_of, read_zip

SHIPPED = atomic.data_folder("teachers")
MOST_WEIGHT = 1e6  # largest absolute value in a tensor, so that 3 layers of 1000 units stay far below float32's 3e38


class Teacher:
    """A deterministic TD3 actor as arrays: ReLU layers and a tanh, scaled to the action box.

    `weights` maps Stable-Baselines3's names of the actor's tensors ("mu.0.weight", ...) to arrays. `critic` does the
    same for the critics ("qf0.0.weight", ...), which are only kept. Raises ValueError if the actor does not fit the
    task, and for numbers that are not finite or beyond `MOST_WEIGHT`.
    """

    def __init__(
        self,
        weights: dict[str, np.ndarray],
        task: str | Task,
        *,
        card: dict | None = None,
        critic: dict[str, np.ndarray] | None = None,
    ):
        self.task, self.card, self.critic = get_task(task), card or {}, critic or {}
        self.layers = layers_of(weights, "mu")
        if not self.layers:
            raise ValueError(
                f"expected the tensors of a TD3 or DDPG actor (mu.0.weight, ...), got {sorted(weights)[:6]}"
            )
        inputs, outputs = self.layers[0][0].shape[0], self.layers[-1][0].shape[1]
        d, m = len(self.task.low), len(self.task.action_low)
        if (inputs, outputs) != (d, m):
            raise ValueError(
                f"the teacher has {inputs} inputs and {outputs} outputs, {self.task.name} has {d} and {m}: "
                "load it for the task it was trained on"
            )
        self.centre = (0.5 * (self.task.action_high + self.task.action_low)).astype(np.float32)
        self.half = (0.5 * (self.task.action_high - self.task.action_low)).astype(np.float32)

    @property
    def digest(self) -> str:
        """SHA-256 of the actor's weights: the identity of a teacher."""
        return hashlib.sha256(b"".join(part.tobytes() for layer in self.layers for part in layer)).hexdigest()

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) or (m,) in float32 for observations (n, d) or (d,)."""
        states = check_observations(obs, len(self.task.low), self.task.name).astype(np.float32)
        return self.centre + self.half * np.tanh(forward(self.layers, states)), None


def forward(layers: list[tuple[np.ndarray, np.ndarray]], hidden: np.ndarray) -> np.ndarray:
    """Return the outputs (n, m) of a network with ReLU between its layers, at the inputs (n, d) `hidden`."""
    for weight, bias in layers[:-1]:
        hidden = np.maximum(hidden @ weight + bias, 0.0)
    weight, bias = layers[-1]
    return hidden @ weight + bias


def layers_of(tensors: dict[str, np.ndarray], name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return weight and bias of every layer of the network called `name`; an empty list if there is no such network."""
    indices = sorted(int(m[1]) for m in (re.fullmatch(rf"{name}\.(\d+)\.weight", key) for key in tensors) if m)
    weights = [_tensor(tensors, f"{name}.{i}.weight", 2).T.copy() for i in indices]
    biases = [_tensor(tensors, f"{name}.{i}.bias", 1) for i in indices]
    shapes, outputs = [weight.shape for weight in weights], [len(bias) for bias in biases]
    if [given for _, given in shapes] != outputs or [taken for taken, _ in shapes[1:]] != outputs[:-1]:
        raise ValueError(
            f"the layers of {name} are {shapes} (inputs, outputs) with {outputs} biases, expected one for each output, "
            "and as many inputs as the layer before has outputs"
        )
    return list(zip(weights, biases))


def _tensor(weights: dict[str, np.ndarray], name: str, ndim: int) -> np.ndarray:
    if name not in weights:
        raise ValueError(f"expected a tensor {name} among {sorted(weights)[:6]}")
    return check_array(name, weights[name], (-1,) * ndim, most=MOST_WEIGHT).astype(np.float32)


def load_teacher(source: str | os.PathLike, task: str | None = None) -> Teacher:
    """Load a teacher: the one shipped for a task, or one from a file.

    `source` is a task's name, a `.safetensors` file with its JSON card and their manifest beside it, or a `.zip` of a
    TD3 or DDPG agent with ReLU layers that Stable-Baselines3 saved; for a zip, `task` names the task. Only tensors are
    read: no code from the file runs. Raises ValueError for an unknown task or a teacher that does not fit,
    FileNotFoundError, and `run.atomic.DamagedFile`.
    """
    path = Path(source)
    if path.suffix == ".zip":
        if task is None:
            raise ValueError(f'{path}: name the task of the agent: load_teacher("{path}", "{task_names()[0]}")')
        return Teacher(read_zip(path), task)
    if path.suffix and path.suffix != ".safetensors":
        raise ValueError(
            f"{path}: expected a .safetensors file, a .zip, or the name of a task, one of {task_names()} (a "
            "distilled policy: vsp.VoronoiPolicy.load)"
        )
    if not path.suffix:
        path = SHIPPED / f"{get_task(str(source)).name}.safetensors"
    from safetensors.numpy import load

    tensors = load(listed.read_listed(path))
    card = json.loads(listed.read_listed(path.with_suffix(".json")))
    critic = part_of(tensors, "critic")
    return Teacher(part_of(tensors, "actor"), task or card.get("task"), card=card, critic=critic)


def further_teachers(task: str) -> dict[str, Path]:
    """Return the files of a task's other teachers, from shorter trainings than the shipped one's, by training seed."""
    others = sorted((SHIPPED / "short").glob(f"{task}-*.safetensors"))
    return {f"seed {path.stem.split('-')[-1]}": path for path in others}
