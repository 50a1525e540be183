"""BipedalWalker-v3: Gymnasium's environment, stepped by its physics engine, with names for its variables."""

from dataclasses import replace

import numpy as np

from vsp import Task
from vsp.tasks.gym_adapter import gymnasium_task

NAME = "BipedalWalker-v3"
INPUTS = (
    "θ", "ω", "vx", "vy", "h1", "vh1", "k1", "vk1", "c1", "h2", "vh2", "k2", "vk2", "c2", *(f"l{i}" for i in range(10)),
)  # fmt: skip


def walked(observation: np.ndarray, reward: float, info: dict) -> bool:
    """Whether the episode ended at the end of the track, and not in a fall, for which the last reward is -100."""
    return reward > -100.0


def make() -> Task:
    """Return the task. Opens an environment."""
    torques = ("τh1", "τk1", "τh2", "τk2")
    return replace(gymnasium_task(NAME, walked), inputs=INPUTS, outputs=torques, input_labels=INPUTS, slowness=20)
