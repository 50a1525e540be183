"""Teachers: train a TD3 agent with Stable-Baselines3, export its networks, load them, act in batches.

torch and stable_baselines3 are imported where training happens and nowhere else: a shipped teacher acts by three
matrix products in NumPy.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import os
import pickle
import re
import sys
import zipfile
import zlib
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from . import store
from .checks import check_finite, check_observations
from .envs import GOAL, PIT, Task, get_task, tasks
from .evaluate import outcomes


@dataclass(frozen=True)
class Recipe:
    """Arguments of Stable-Baselines3's TD3 that make one teacher; the policy is MlpPolicy, [400, 300], ReLU."""

    steps: int  # environment steps
    batch_size: int = 256
    train_freq: tuple[int, str] = (1, "step")
    gradient_steps: int = 1  # per training phase; -1: as many as steps were taken
    learning_rate: float = 1e-3
    buffer_size: int = 1_000_000
    learning_starts: int = 100
    noise: str = "normal"  # exploration noise: "normal" or "ornstein-uhlenbeck"
    noise_std: float = 0.1  # its standard deviation, in units of the action

    @property
    def id(self) -> str:
        """Eight hexadecimal digits that stand for the recipe, so that no other recipe resumes its checkpoints."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:8]


RECIPES = {
    # "500.000 steps using the standard parameters": the library's, with the exploration noise of the TD3 article
    # (Fujimoto et al. 2018); without noise training never finds out that a short last step pays
    "SimpleGoal-v0": Recipe(steps=500_000),
    # RL Zoo's recipe with the library defaults of its day (batch 100, one training phase per episode)
    "MountainCarContinuous-v0": Recipe(
        steps=300_000,
        batch_size=100,
        train_freq=(1, "episode"),
        gradient_steps=-1,
        noise="ornstein-uhlenbeck",
        noise_std=0.5,
    ),
}

# Trainings with another recipe, given up after their score was seen (over SCORE_EPISODES)
EARLIER_TRIALS = {
    "SimpleGoal-v0": [{"noise_std": 0.0, "seed": 0, "steps": 140_000, "mean": 16.0875, "std": 2.9943, "pit": 0.001}],
}

# What a teacher has to reach to be shipped, over SCORE_EPISODES episodes: mean return, share of failed episodes.
BARS = {"SimpleGoal-v0": (16.3, 0.01), "MountainCarContinuous-v0": (93.3, 0.0)}

MOST_SEEDS = 5  # tried before giving up
CHUNK = 10_000  # steps between two checkpoints
SCORE_EPISODES = 10_000
SELECTION_SEED, SCORE_SEED = 101, 102  # start states to choose a training seed on, and to report on
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
    return Teacher(_actor(tensors), task or card.get("task"), card=card)


def _actor(tensors: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
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
        actor = {name: tensor.numpy() for name, tensor in _actor(tensors).items()}
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


# Training


def train(task: str, *, seed: int, cache: str | os.PathLike, report=print) -> Path:
    """Train a TD3 teacher for `task` and return the path of its last checkpoint; resume from `cache` if it was begun.

    Training goes in chunks of `CHUNK` steps. Each chunk begins a fresh episode and takes fresh random streams from
    (seed, steps so far), so that a run killed at any moment and resumed ends with the same weights as one left alone.
    """
    import torch

    torch.set_num_threads(1)
    torch.set_flush_denormal(True)  # Adam's moments of idle weights decay into denormal numbers, which are slow
    recipe = RECIPES[task]
    path = Path(cache) / f"{task}-{recipe.id}-{seed}.pt"
    model, curve = _new_model(task, recipe, seed), []
    if path.exists():
        curve = _restore(model, torch.load(path, weights_only=True))
    while model.num_timesteps < recipe.steps:
        chunk_seed = np.random.SeedSequence([seed, model.num_timesteps]).generate_state(1)[0]
        model.set_random_seed(int(chunk_seed))
        model._last_obs = None  # begin a fresh episode
        model.action_noise.reset()
        model.learn(min(CHUNK, recipe.steps - model.num_timesteps), reset_num_timesteps=False, log_interval=None)
        curve.append(_score(model, task))
        report(f"{task} seed {seed}: {curve[-1]}")
        with store.atomic_path(path) as temporary:
            torch.save(_snapshot(model, curve), temporary)
    return path


def _new_model(task: str, recipe: Recipe, seed: int):
    import gymnasium
    from stable_baselines3 import TD3
    from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise

    arguments = asdict(recipe)
    arguments.pop("steps")
    kind = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}[arguments.pop("noise")]
    m = len(get_task(task).action_low)
    noise = kind(np.zeros(m), arguments.pop("noise_std") * np.ones(m))
    return TD3("MlpPolicy", gymnasium.make(task), action_noise=noise, seed=seed, device="cpu", **arguments)


_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def _snapshot(model, curve: list[dict]) -> dict:
    """Everything training depends on at the border of two chunks, in types that `weights_only` loading admits."""
    import torch

    buffer = model.replay_buffer
    n = buffer.buffer_size if buffer.full else buffer.pos
    return {
        "policy": model.policy.state_dict(),
        "actor_optimizer": model.actor.optimizer.state_dict(),
        "critic_optimizer": model.critic.optimizer.state_dict(),
        "buffer": {name: torch.from_numpy(getattr(buffer, name)[:n].copy()) for name in _BUFFER},
        "buffer_at": [buffer.pos, buffer.full],
        "counters": [model.num_timesteps, model._n_updates, model._episode_num],
        "curve": curve,
    }


def _restore(model, snapshot: dict) -> list[dict]:
    """Put a snapshot back into a fresh model; returns the learning curve so far."""
    model.policy.load_state_dict(snapshot["policy"])
    model.actor.optimizer.load_state_dict(snapshot["actor_optimizer"])
    model.critic.optimizer.load_state_dict(snapshot["critic_optimizer"])
    for name, rows in snapshot["buffer"].items():
        getattr(model.replay_buffer, name)[: len(rows)] = rows.numpy()
    model.replay_buffer.pos, model.replay_buffer.full = snapshot["buffer_at"]
    model.num_timesteps, model._n_updates, model._episode_num = snapshot["counters"]
    return snapshot["curve"]


def _score(model, task: str) -> dict:
    """One point of the learning curve, over 500 episodes from starts that stay the same."""
    weights = {name: tensor.numpy() for name, tensor in model.actor.state_dict().items()}
    return {"steps": model.num_timesteps, **score(Teacher(weights, task), task, 500, seed=SELECTION_SEED)}


def score(teacher: Teacher, task: str, n_episodes: int = SCORE_EPISODES, *, seed: int = SCORE_SEED) -> dict:
    """Mean and standard deviation of the return, and the shares of episodes that end in the goal and in the pit."""
    result = outcomes(teacher, task, n_episodes, seed=seed)
    return {
        "mean": round(float(result.returns.mean()), 4),
        "std": round(float(result.returns.std(ddof=1)), 4),
        "goal": float(np.mean(result.codes == GOAL)),
        "pit": float(np.mean(result.codes == PIT)),
    }


# Export


def export(task: str, checkpoints: dict[int, Path], folder: str | os.PathLike = SHIPPED) -> bool:
    """Write the teacher of the last seed in `checkpoints` as safetensors with its card, if it reaches the bar.

    Returns whether it does. All seeds in `checkpoints` go on the card; actor and critics are written, in float32.
    """
    import torch
    from safetensors.numpy import save

    tried = {seed: torch.load(path, weights_only=True) for seed, path in checkpoints.items()}
    seed, snapshot = list(tried.items())[-1]
    tensors = {
        name: tensor.numpy() for name, tensor in snapshot["policy"].items() if name.startswith(("actor.", "critic."))
    }
    teacher = Teacher(_actor(tensors), task)
    if not reaches_bar(score(teacher, task, seed=SELECTION_SEED), task):
        return False
    card = {
        "task": task,
        "algorithm": "TD3 of Stable-Baselines3, MlpPolicy, layers [400, 300], ReLU, tanh output",
        "recipe": asdict(RECIPES[task]),
        "seed": seed,
        "seeds_tried": [{"seed": s, **snap["curve"][-1]} for s, snap in tried.items()],
        "earlier_trials": EARLIER_TRIALS.get(task, []),
        "versions": {name: version(name) for name in ("torch", "stable-baselines3", "gymnasium", "numpy")},
        "score": {"episodes": SCORE_EPISODES, "start_seed": SCORE_SEED, **score(teacher, task)},
        "learning_curve": snapshot["curve"],
    }
    store.write_carded(Path(folder) / f"{task}.safetensors", save(tensors), card)
    return True


def reaches_bar(found: dict, task: str) -> bool:
    """Whether a score reaches the bar of the task."""
    mean, failures = BARS[task]
    return found["mean"] >= mean and 1.0 - found["goal"] <= failures


def main() -> None:
    """Train each task's teacher with seed 0, 1, ... until one reaches the bar, and export that one."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--cache", required=True, help="folder for checkpoints; training resumes from there")
    parser.add_argument("--out", default=SHIPPED, help="folder for the exported teachers")
    parser.add_argument("--task", choices=list(RECIPES), action="append", help="only this task")
    arguments = parser.parse_args()
    for task in arguments.task or RECIPES:
        checkpoints = {}
        for seed in range(MOST_SEEDS):
            checkpoints[seed] = train(task, seed=seed, cache=arguments.cache)
            if export(task, checkpoints, arguments.out):
                break
        else:
            sys.exit(f"{task}: none of the seeds 0 to {MOST_SEEDS - 1} reached the bar {BARS[task]}")


if __name__ == "__main__":
    main()
