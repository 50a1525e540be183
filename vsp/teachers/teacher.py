"""Load a trained actor as a teacher and act with it in batches. This needs only NumPy: some matrix products."""

import hashlib
import json
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..checks import check_choice, check_observations
from ..run import atomic, listed
from ..tasks import Task, get_task, task_names
from . import actors
from .actors import Actor, layers_of, part_of

if TYPE_CHECKING:
    from .normalization import Normalization

SHIPPED = atomic.data_folder("teachers")
_CALLS = {  # how to ask the model of a file for the actions at observations
    ".pt": "model(torch.as_tensor(obs, dtype=torch.float32)).detach().numpy()",
    ".onnx": "session.run(None, {session.get_inputs()[0].name: obs.astype('float32')})[0]",
}


class Teacher:
    """An actor as arrays: a network whose actions are scaled, or limited, to the action box.

    `weights` is an `Actor`, or maps Stable-Baselines3's names of a TD3 actor's tensors ("mu.0.weight", ...) to arrays.
    `critic` does the same for the critics ("qf0.0.weight", ...), which are only kept. With `normalization` it takes raw
    observations all the same. Raises ValueError if the actor does not fit the task, and for numbers that are not finite
    or beyond `actors.MOST_WEIGHT`."""

    def __init__(
        self,
        weights: dict[str, np.ndarray] | Actor,
        task: str | Task,
        *,
        card: dict | None = None,
        critic: dict[str, np.ndarray] | None = None,
        normalization: "Normalization | None" = None,
    ):
        self.task, self.card, self.critic = get_task(task), card or {}, critic or {}
        self.actor = weights if isinstance(weights, Actor) else Actor(layers_of(weights, "mu"))
        self.layers, self.normalization = self.actor.layers, normalization
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
        """SHA-256 of the numbers and settings that act: the identity of a teacher."""
        numbers = [*(part for layer in self.layers for part in layer), *(self.normalization or ())]
        actor = (self.actor.activation, self.actor.squashed, self.actor.clip_mean)
        more = "" if actor == ("ReLU", True, np.inf) else repr(actor)  # nothing, so that TD3's identity stays
        return hashlib.sha256(b"".join(np.asarray(x).tobytes() for x in numbers) + more.encode()).hexdigest()

    def inputs(self, obs: np.ndarray) -> np.ndarray:
        """Return what the network sees of the raw observations (n, d) or (d,), in float32."""
        states = check_observations(obs, len(self.task.low), self.task.name)
        return (self.normalization(states) if self.normalization else states).astype(np.float32)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) or (m,) in float32 for observations (n, d) or (d,)."""
        outputs = self.actor.forward(self.inputs(obs))
        if self.actor.squashed:
            return self.centre + self.half * outputs, None
        return np.clip(outputs, self.task.action_low, self.task.action_high).astype(np.float32), None


def load_teacher(
    source: str | os.PathLike, task: str | Task | None = None, *, normalize: str | os.PathLike | bool | None = None
) -> Teacher:
    """Load a teacher: the one shipped for a task, or one from a file.

    `source` is a task's name, a `.safetensors` file with its JSON card and their manifest beside it, or a `.zip` of an
    agent that Stable-Baselines3 or sb3-contrib saved (`actors.POLICIES`); for a zip, `task` names the task. Of an actor
    other than TD3's, the card says in "acts" the settings of `Actor` and the "normalization". `normalize` is the file
    of `VecNormalize` for an agent that was trained on normalised observations; False says that it was not. Only numbers
    are read: no code from a file runs. Raises ValueError for an unknown task, an agent that does not fit it or that
    says what is not modelled here, and without `normalize` where something shows that it is needed; FileNotFoundError,
    and `run.atomic.DamagedFile`."""
    path = Path(source)
    if path.suffix.lower() == ".zip":
        if task is None:
            raise ValueError(f'{path}: name the task of the agent: load_teacher("{path}", "{task_names()[0]}")')
        return _from_zip(path, get_task(task), normalize)
    if normalize:
        raise ValueError(f"{path}: normalize is {normalize!r}, expected none: it belongs to a .zip")
    if path.suffix and path.suffix != ".safetensors":
        raise ValueError(
            f"{path}: expected a .safetensors file, a .zip, or the name of a task, one of {task_names()} (a "
            "distilled policy: vsp.VoronoiPolicy.load). What another library loads is an agent as a function: "
            f"vsp.agent(lambda obs: {_CALLS.get(path.suffix, _CALLS['.pt'])}, name={path.name!r})"
        )
    if not path.suffix:
        path = SHIPPED / f"{get_task(str(source)).name}.safetensors"
    from safetensors import SafetensorError
    from safetensors.numpy import load

    from .normalization import checked

    weights, text = listed.read_listed(path), listed.read_listed(path.with_suffix(".json"))
    try:
        tensors = load(weights)
    except SafetensorError as error:
        raise atomic.DamagedFile(f"{path}: its checksum is right, but it holds no tensors: {error!r:.300}") from error
    card = json.loads(text)
    critic = part_of(tensors, "critic")
    named = str(card.get("task")).rpartition(":")[2]  # a file imports no module
    layers, acts = layers_of(part_of(tensors, "actor"), "mu"), {"activation": "ReLU"} | card.get("acts", {})
    check_choice(f"{path}: activation", acts["activation"], actors.ACTIVATIONS)
    *moments, epsilon, clip = acts.pop("normalization", (0, 0))
    named_moments, d = dict(zip(("mean", "var"), moments)), len(layers[0][0])
    statistics = checked(named_moments, epsilon, clip, d, f"{path}") if moments else None
    return Teacher(Actor(layers, **acts), task or named, card=card, critic=critic, normalization=statistics)


def _from_zip(path: Path, task: Task, normalize: str | os.PathLike | bool | None) -> Teacher:
    from . import agent_zip, normalization  # here: most teachers are no zips

    saved = agent_zip.read_zip(path)
    advice = (
        f". If its own library loads it: vsp.agent(PPO.load({path.name!r}), {task.name!r}), with the class of its "
        "algorithm; where the zip names gym, with custom_objects={'observation_space': ..., 'action_space': ...}"
    )
    try:
        actors.check_spaces(saved.setting, task)
        actor = actors.actor_of(saved)
    except actors.Unknown as error:
        raise ValueError(f"{path}: {error}{'' if isinstance(error, actors.Unfit) else advice}") from error
    except Exception as error:  # of any kind: the content is not trusted
        raise atomic.DamagedFile(f"{path}: its tensors make no network: {error!r:.300}") from error
    why = "normalize is True" if normalize is True else normalization.sign(path, saved) if normalize is None else ""
    if why:
        raise ValueError(
            f"{path}: trained on normalised observations, as it seems: {why}. Pass their statistics, "
            'normalize="vecnormalize.pkl", or normalize=False if there are none'
        )
    if (other := normalization.trained_on(path)) not in ("", task.name):
        warnings.warn(f"{path.name} was trained on {other}, and acts on {task.name}: they may differ", stacklevel=4)
    given = not (normalize is None or isinstance(normalize, bool))
    statistics = normalization.statistics_of(normalize, len(task.low)) if given else None
    card = {"recipe": {"steps": saved.settings.get("num_timesteps")}}  # `studies` reads it
    return Teacher(actor, task, card=card, critic=part_of(saved.tensors, "critic"), normalization=statistics)


def further_teachers(task: str) -> dict[str, Path]:
    """Return the files of a task's other teachers, from shorter trainings than the shipped one's, by training seed."""
    others = sorted((SHIPPED / "short").glob(f"{task}-*.safetensors"))
    return {f"seed {path.stem.split('-')[-1]}": path for path in others}
