"""Train a TD3 teacher with Stable-Baselines3, resumably, and export it with its card.

`python -m studies.make_teachers --cache FOLDER` trains the shipped teachers again, also those of the robots. Only the
functions that train import torch and stable_baselines3.
"""

from __future__ import annotations

import argparse
import copy
import io
import json
import os
import sys
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..evaluation import rollout_from_seed
from ..run import listed, sealed
from ..tasks.base import GOAL, PIT
from ..tasks.registry import get_task
from .agent_zip import part_of
from .recipes import BARS, BEST_OF_CURVE, RECIPES, SHORT_SEEDS, SHORT_STEPS, Recipe
from .teacher import SHIPPED, Teacher, load_teacher

PACKAGES = ("torch", "stable-baselines3", "gymnasium", "numpy")  # a card names their versions
ENGINES = {"HalfCheetah-v5": ("mujoco",)}

MOST_SEEDS = 5  # seeds tried for one teacher
CHUNK = 10_000  # steps between two checkpoints
SCORE_EPISODES, CURVE_EPISODES = 10_000, 500
OFTEN = {"BipedalWalker-v3": 4}  # factor on CURVE_EPISODES where a rare fall decides
SELECTION_SEED, SCORE_SEED = 101, 102  # seeds of start states: to select a training seed, and to report scores


def train(task: str, *, seed: int, cache: str | os.PathLike, recipe: Recipe | None = None, report=print) -> Path:
    """Train a TD3 teacher for `task`, resuming from `cache`, and return the path of its last checkpoint.

    Training proceeds in chunks of `CHUNK` steps. Each chunk begins a new episode with new random streams from (seed,
    steps so far), so a run that was killed and resumed ends with the same weights as an uninterrupted one.
    """
    import torch

    torch.set_num_threads(1)
    torch.set_flush_denormal(True)  # Adam's moments of unused weights decay into denormal numbers, which are slow
    recipe = RECIPES[task] if recipe is None else recipe
    path = Path(cache) / f"{task}-{recipe.id}-{seed}.pt"
    model = _new_model(task, recipe, seed)
    snapshot: dict = {"curve": []}
    if path.exists():
        snapshot = read_checkpoint(path)
        _restore(model, snapshot)
    while model.num_timesteps < recipe.steps:
        chunk_seed = np.random.SeedSequence([seed, model.num_timesteps]).generate_state(1)[0]
        model.set_random_seed(int(chunk_seed))
        model._last_obs = None  # begin a fresh episode
        model.action_noise.reset()
        model.learn(min(CHUNK, recipe.steps - model.num_timesteps), reset_num_timesteps=False, log_interval=None)
        point = _score(model, task)
        report(f"{task} seed {seed}: {point}")
        snapshot |= _snapshot(model) | {"curve": [*snapshot["curve"], point]}
        if task in BEST_OF_CURVE and ("best" not in snapshot or point["mean"] > snapshot["best"]["point"]["mean"]):
            snapshot["best"] = {"point": point, "policy": copy.deepcopy(snapshot["policy"])}
        torch.save(snapshot, content := io.BytesIO())
        sealed.write_sealed(path, content.getvalue())
    return path


def read_checkpoint(path: str | os.PathLike) -> dict:
    """Read a checkpoint that `train` wrote. Raises FileNotFoundError or `run.atomic.DamagedFile`.

    torch's `weights_only` loading runs no code from the file.
    """
    import torch

    return torch.load(io.BytesIO(sealed.read_sealed(path)), weights_only=True)


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


def _snapshot(model) -> dict:
    """Return the state of training between two chunks, in types that `weights_only` loading accepts."""
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
    }


def _restore(model, snapshot: dict) -> None:
    """Restore a snapshot into a new model."""
    model.policy.load_state_dict(snapshot["policy"])
    model.actor.optimizer.load_state_dict(snapshot["actor_optimizer"])
    model.critic.optimizer.load_state_dict(snapshot["critic_optimizer"])
    for name, rows in snapshot["buffer"].items():
        getattr(model.replay_buffer, name)[: len(rows)] = rows.numpy()
    model.replay_buffer.pos, model.replay_buffer.full = snapshot["buffer_at"]
    model.num_timesteps, model._n_updates, model._episode_num = snapshot["counters"]


def _score(model, task: str) -> dict:
    """Return one point of the learning curve, over `CURVE_EPISODES` (fewer for slow tasks) from fixed starts."""
    n_episodes = CURVE_EPISODES * OFTEN.get(task, 1)
    weights = {name: tensor.numpy() for name, tensor in model.actor.state_dict().items()}
    return {"steps": model.num_timesteps, **score(Teacher(weights, task), task, n_episodes, seed=SELECTION_SEED)}


def score(teacher: Teacher, task: str, n_episodes: int = SCORE_EPISODES, *, seed: int = SCORE_SEED) -> dict:
    """Return the mean and standard deviation of the return, and the shares of episodes that end in goal and pit.

    Slow tasks are scored over fewer episodes.
    """
    result = rollout_from_seed(teacher, task, n_episodes // get_task(task).slowness, seed=seed)
    return {
        "mean": round(float(result.returns.mean()), 4),
        "std": round(float(result.returns.std(ddof=1)), 4),
        "goal": float(np.mean(result.outcomes == GOAL)),
        "pit": float(np.mean(result.outcomes == PIT)),
    }


# Export


def export(task: str, checkpoints: dict[int, Path], folder: str | os.PathLike = SHIPPED) -> bool:
    """Write the teacher of the last seed in `checkpoints` as safetensors with its card, if it meets the requirements.

    Returns whether it does. The card lists all seeds in `checkpoints`, and the rejected trials with other recipes that
    the shipped card lists. Actor and critics are written in float32.
    """
    tried = {seed: read_checkpoint(path) for seed, path in checkpoints.items()}
    seed, snapshot = list(tried.items())[-1]
    if not reaches_bar(score(_teacher(snapshot, task), task, seed=SELECTION_SEED), task):
        return False
    about = {"seeds_tried": [{"seed": s, **_chosen(snap)[1]} for s, snap in tried.items()]}
    about["earlier_trials"] = load_teacher(task).card["earlier_trials"]
    _write(task, snapshot, RECIPES[task], seed, Path(folder) / f"{task}.safetensors", ("actor.", "critic."), about)
    return True


def export_short(task: str, seed: int, checkpoint: Path, folder: str | os.PathLike = SHIPPED) -> None:
    """Write the actor of a shorter training with its card, whatever its score."""
    snapshot = read_checkpoint(checkpoint)
    path = Path(folder) / "short" / f"{task}-{seed}.safetensors"
    _write(task, snapshot, short_recipe(task), seed, path, ("actor.",), {})


def short_recipe(task: str) -> Recipe:
    """Return the recipe of the shipped teacher with fewer steps."""
    return replace(RECIPES[task], steps=SHORT_STEPS[task])


def _chosen(snapshot: dict) -> tuple[dict, dict]:
    """Return the tensors to keep, the best or the last ones, and their point of the learning curve."""
    if "best" in snapshot:
        return snapshot["best"]["policy"], snapshot["best"]["point"]
    return snapshot["policy"], snapshot["curve"][-1]


def _teacher(snapshot: dict, task: str) -> Teacher:
    return Teacher(part_of({name: tensor.numpy() for name, tensor in _chosen(snapshot)[0].items()}, "actor"), task)


def _write(task: str, snapshot: dict, recipe: Recipe, seed: int, path: Path, parts: tuple, about: dict) -> None:
    """Write the tensors whose names begin with one of `parts`, and the card."""
    from safetensors.numpy import save

    tensors = {name: tensor.numpy() for name, tensor in _chosen(snapshot)[0].items() if name.startswith(parts)}
    card = {
        "task": task,
        "algorithm": "TD3 of Stable-Baselines3, MlpPolicy, layers [400, 300], ReLU, tanh output",
        "recipe": asdict(recipe),
        "seed": seed,
        **about,
        "versions": {name: version(name) for name in (*PACKAGES, *ENGINES.get(task, ()))},
        "score": {"episodes": SCORE_EPISODES // get_task(task).slowness, "start_seed": SCORE_SEED}
        | score(_teacher(snapshot, task), task),
        "learning_curve": snapshot["curve"],
    }
    listed.write_listed(path, save(tensors))
    listed.write_listed(path.with_suffix(".json"), json.dumps(card, indent=2, allow_nan=False) + "\n")


def reaches_bar(scores: dict, task: str) -> bool:
    """Whether a score meets the requirements of the task, `BARS`."""
    mean, failures = BARS[task]
    return scores["mean"] >= mean and 1.0 - scores["goal"] <= failures


def main() -> None:
    """Train each task's teacher with seeds 0, 1, ... until one meets the requirements, and export it.

    With --short, run the shorter trainings instead.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--cache", required=True, help="folder for checkpoints; training resumes from there")
    parser.add_argument("--out", default=SHIPPED, help="folder for the exported teachers")
    parser.add_argument("--task", choices=list(RECIPES), action="append", help="only this task")
    parser.add_argument("--short", action="store_true", help="run the shorter trainings that a study compares")
    arguments = parser.parse_args()
    known = SHORT_SEEDS if arguments.short else RECIPES
    for task in [task for task in known if task in (arguments.task or known)]:
        if arguments.short:
            for seed in SHORT_SEEDS[task]:
                checkpoint = train(task, seed=seed, cache=arguments.cache, recipe=short_recipe(task))
                export_short(task, seed, checkpoint, arguments.out)
            continue
        checkpoints = {}
        for seed in range(MOST_SEEDS):
            checkpoints[seed] = train(task, seed=seed, cache=arguments.cache)
            if export(task, checkpoints, arguments.out):
                break
        else:
            sys.exit(f"{task}: none of the seeds 0 to {MOST_SEEDS - 1} met the requirements {BARS[task]}")
