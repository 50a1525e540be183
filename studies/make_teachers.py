"""`make teachers`, `make short-teachers`: train the teachers, also those of robots, and write them with their cards."""

import argparse
import json
import os
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from vsp.run import command, listed
from vsp.tasks.registry import get_task
from vsp.teachers.actors import part_of
from vsp.teachers.teacher import SHIPPED, Teacher, load_teacher

from . import drone_teacher, robots, training  # noqa: F401  # robots' tasks are registered
from .training import RECIPES, Recipe

PACKAGES = ("torch", "stable-baselines3", "gymnasium", "numpy")  # a card names their versions
ENGINES = {"HalfCheetah-v5": ("mujoco",)}
SEED = 0  # of the shipped teachers

# Further trainings, to study the influence of the teacher; shorter if the shipped one took long. SimpleGoal's seed 1 is
# left out: its actor saturated within 10,000 steps at (-1, -1) for every state and stayed there.
SHORT_STEPS = {"SimpleGoal-v0": 60_000, "MountainCarContinuous-v0": 120_000, "Pendulum-v1": 20_000}
SHORT_SEEDS = {"SimpleGoal-v0": (2, 3), "MountainCarContinuous-v0": (1, 2), "Pendulum-v1": (1, 2)}

# Requirements for a shipped teacher, over SCORE_EPISODES episodes: least mean return, largest share of episodes that do
# not reach the goal (Pendulum and HalfCheetah have no goal; BipedalWalker reaches it unless it falls).
BARS = {
    "SimpleGoal-v0": (16.3, 0.01),
    "MountainCarContinuous-v0": (93.3, 0.0),
    "Pendulum-v1": (-155.0, 1.0),
    "LunarLanderContinuous-v3": (270.0, 0.05),
    "BipedalWalker-v3": (300.0, 0.03),
    "HalfCheetah-v5": (6000.0, 1.0),
}


def export(task: str, checkpoint: Path, folder: str | os.PathLike = SHIPPED) -> None:
    """Write the teacher as safetensors in float32 with its card, which lists the rejected trials that the shipped card
    lists. Raises `CommandError` if it does not meet the requirements."""
    snapshot = training.read_checkpoint(checkpoint)
    if not reaches_bar(training.score(_teacher(snapshot, task), task, seed=training.SELECTION_SEED), task):
        raise command.CommandError(f"{task}: seed {SEED} does not meet the requirements {BARS[task]}: set another SEED")
    about = {"seeds_tried": [{"seed": SEED, **snapshot["kept"]["point"]}]}
    about["earlier_trials"] = load_teacher(task).card["earlier_trials"]
    _write(task, snapshot, RECIPES[task], SEED, Path(folder) / f"{task}.safetensors", ("actor.", "critic."), about)


def export_short(task: str, seed: int, checkpoint: Path, folder: str | os.PathLike = SHIPPED) -> None:
    """Write the actor of a shorter training with its card, whatever its score."""
    snapshot = training.read_checkpoint(checkpoint)
    path = Path(folder) / "short" / f"{task}-{seed}.safetensors"
    _write(task, snapshot, short_recipe(task), seed, path, ("actor.",), {})


def short_recipe(task: str) -> Recipe:
    """Return the recipe of the shipped teacher with fewer steps."""
    return replace(RECIPES[task], steps=SHORT_STEPS[task])


def _teacher(snapshot: dict, task: str) -> Teacher:
    return Teacher(part_of(_tensors(snapshot), "actor"), task)


def _tensors(snapshot: dict) -> dict[str, np.ndarray]:
    return {name: tensor.numpy() for name, tensor in snapshot["kept"]["policy"].items()}


def _write(task: str, snapshot: dict, recipe: Recipe, seed: int, path: Path, parts: tuple, about: dict) -> None:
    """Write the tensors whose names begin with one of `parts`, and the card."""
    from safetensors.numpy import save

    tensors = {name: array for name, array in _tensors(snapshot).items() if name.startswith(parts)}
    card = {
        "task": task,
        "algorithm": "TD3 of Stable-Baselines3, MlpPolicy, layers [400, 300], ReLU, tanh output",
        "recipe": asdict(recipe),
        "seed": seed,
        **about,
        "versions": {name: version(name) for name in (*PACKAGES, *ENGINES.get(task, ()))},
        "score": {"episodes": training.SCORE_EPISODES // get_task(task).slowness, "start_seed": training.SCORE_SEED}
        | training.score(_teacher(snapshot, task), task),
        "learning_curve": snapshot["curve"],
    }
    listed.write_listed(path, save(tensors))
    listed.write_listed(path.with_suffix(".json"), json.dumps(card, indent=2, allow_nan=False) + "\n")


def reaches_bar(scores: dict, task: str) -> bool:
    """Whether a score meets the requirements of the task, `BARS`."""
    mean, failures = BARS[task]
    return scores["mean"] >= mean and 1.0 - scores["goal"] <= failures


def main() -> None:
    """Train each task's teacher and export it, or with --short the teachers of the shorter trainings."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--cache", required=True, help="folder for checkpoints; training resumes from there")
    parser.add_argument("--out", default=SHIPPED, help="folder for the exported teachers")
    parser.add_argument("--short", action="store_true", help="run the shorter trainings that a study compares")
    arguments = parser.parse_args()
    if arguments.short:
        for task, seeds in SHORT_SEEDS.items():
            for seed in seeds:
                checkpoint = training.train(task, seed=seed, cache=arguments.cache, recipe=short_recipe(task))
                export_short(task, seed, checkpoint, arguments.out)
    else:
        for task in RECIPES:
            export(task, training.train(task, seed=SEED, cache=arguments.cache), arguments.out)
        drone_teacher.export(drone_teacher.train(), Path(arguments.out))


if __name__ == "__main__":
    with command.in_one_line():
        main()
