"""LunarLanderContinuous-v3: Gymnasium's environment, stepped by its physics engine, with names for its variables."""

from dataclasses import replace

import numpy as np

from .base import Task
from .gym_adapter import gymnasium_task

NAME = "LunarLanderContinuous-v3"
LABELS = ("x (half widths)", "height above the pad", "vx", "vy", "angle (rad)", "ω", "left leg down", "right leg down")


def landed(observation: np.ndarray, reward: float, info: dict) -> bool:
    """Whether the episode ended at rest (last reward 100) and not in a crash (last reward -100)."""
    return reward > 0


def make() -> Task:
    """Return the task. Opens an environment."""
    inputs, outputs = ("x", "y", "vx", "vy", "θ", "ω", "l", "r"), ("main", "side")
    task = gymnasium_task(NAME, landed)
    return replace(task, inputs=inputs, outputs=outputs, input_labels=LABELS, slowness=10)
