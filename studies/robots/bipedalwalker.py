"""BipedalWalker-v3: Gymnasium's environment, stepped by its physics engine, with names for its variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsp import Task
from vsp.tasks.gym_adapter import gymnasium_task

NAME = "BipedalWalker-v3"
INPUTS = (
    "θ", "ω", "vx", "vy", "h1", "vh1", "k1", "vk1", "c1", "h2", "vh2", "k2", "vk2", "c2", *(f"l{i}" for i in range(10)),
)  # fmt: skip
LABELS = (
    "hull angle (rad)", "hull ω", "hull vx", "hull vy",
    "hip 1 angle", "hip 1 ω", "knee 1 angle", "knee 1 ω", "leg 1 down",
    "hip 2 angle", "hip 2 ω", "knee 2 angle", "knee 2 ω", "leg 2 down",
    *(f"lidar {i}" for i in range(10)),
)  # fmt: skip


def walked(observation: np.ndarray, reward: float, info: dict) -> bool:
    """Whether the episode ended at the end of the track, and not in a fall, for which the last reward is -100."""
    return reward > -100.0


def make() -> Task:
    """Return the task. Opens an environment."""
    torques = ("τh1", "τk1", "τh2", "τk2")
    return replace(gymnasium_task(NAME, walked), inputs=INPUTS, outputs=torques, input_labels=LABELS, slowness=20)
