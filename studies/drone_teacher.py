"""Train our own network that flies a quadrotor, by PPO of Stable-Baselines3: 5 to 10 minutes of `make teachers`."""

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save
from stable_baselines3 import PPO

from vsp.evaluation import rollout_from_seed
from vsp.run import listed
from vsp.tasks import PIT
from vsp.teachers.actors import Actor, layers_of
from vsp.teachers.teacher import Teacher
from vsp_beyond.drone.quadrotor import Starts, quadrotor

from .batched import Batched
from .training import SCORE_EPISODES, SCORE_SEED

STARTS = Starts(position=0.5, velocity=1.0, rates=1.0, tilt=120.0)
STEPS, ENVIRONMENTS, SEED = 4_000_000, 128, 0
RECIPE = {"n_steps": 64, "batch_size": 1024, "n_epochs": 5, "gamma": 0.98, "gae_lambda": 0.95}
RATE, WIDTHS, FIRST_STD = 1e-3, [64, 64], 0.5  # learning rate, which falls to 0; the first deviation of the commands
ACTS = {"activation": "Tanh", "squashed": False}  # as PPO's networks do


def train() -> PPO:
    """Train the network."""
    torch.set_num_threads(1)
    environments = Batched(quadrotor(STARTS), ENVIRONMENTS, np.random.default_rng(SEED))
    kwargs = {"net_arch": WIDTHS, "log_std_init": float(np.log(FIRST_STD))}
    model = PPO(
        "MlpPolicy", environments, **RECIPE, learning_rate=lambda left: RATE * left, policy_kwargs=kwargs, seed=SEED,
        device="cpu",
    )  # fmt: skip
    return model.learn(STEPS)


def export(model: PPO, folder: Path) -> None:
    """Write the actor as safetensors with its card."""
    state = {name: tensor.numpy() for name, tensor in model.policy.state_dict().items()}
    layers = layers_of(state, "mlp_extractor.policy_net", "action_net")
    tensors = {}
    for i, (weight, bias) in enumerate(layers):
        tensors |= {f"actor.mu.{2 * i}.weight": weight.T.copy(), f"actor.mu.{2 * i}.bias": bias}
    teacher = Teacher(Actor(layers, **ACTS), quadrotor())
    result = rollout_from_seed(teacher, quadrotor(), SCORE_EPISODES, seed=SCORE_SEED)
    card = {
        "task": "Quadrotor-v0",
        "algorithm": f"PPO of Stable-Baselines3, MlpPolicy, layers {WIDTHS}, tanh, limited output",
        "acts": ACTS,
        "recipe": RECIPE | {"steps": STEPS, "environments": ENVIRONMENTS, "learning_rate": RATE, "std": FIRST_STD},
        "starts": vars(STARTS),
        "seed": SEED,
        "versions": {name: version(name) for name in ("torch", "stable-baselines3", "gymnasium", "numpy")},
        "score": {
            "episodes": SCORE_EPISODES, "start_seed": SCORE_SEED, "mean": round(float(result.returns.mean()), 4),
            "lost": float(np.mean(result.outcomes == PIT)),
        },
    }  # fmt: skip
    path = folder / "Quadrotor-v0.safetensors"
    listed.write_listed(path, save(tensors))
    listed.write_listed(path.with_suffix(".json"), json.dumps(card, indent=2) + "\n")
