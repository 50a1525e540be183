"""MountainCarContinuous-v0: Gymnasium's environment, with its dynamics on arrays."""

import numpy as np

from .base import GOAL, RUNNING, Task

FLAG = 0.45  # position of the goal


def start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw starts: position uniform in [-0.6, -0.4] (no unit), at rest. (n, 2)"""
    return np.column_stack([rng.uniform(-0.6, -0.4, size=n), np.zeros(n)])


def step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gymnasium's `Continuous_MountainCarEnv.step`, for a batch. As in Gymnasium, the cost uses the action *before* it
    is clipped to [-1, 1], and the state is float32 after the first step."""
    position, velocity = states.T
    force = np.clip(actions[:, 0], -1.0, 1.0)
    velocity = np.clip(velocity + 0.0015 * force - 0.0025 * np.cos(3 * position), -0.07, 0.07)
    position = np.clip(position + velocity, -1.2, 0.6)
    velocity = np.where((position == -1.2) & (velocity < 0), 0.0, velocity)  # the wall on the left stops the car
    at_goal = (position >= FLAG) & (velocity >= 0)
    rewards = 100.0 * at_goal - 0.1 * actions[:, 0] ** 2
    moved = np.column_stack([position, velocity]).astype(np.float32).astype(np.float64)
    return moved, rewards, np.where(at_goal, GOAL, RUNNING)


TASK = Task(
    name="MountainCarContinuous-v0",
    inputs=("x", "v"),
    outputs=("F",),
    input_labels=("position", "velocity (per step)"),
    low=np.array([-1.2, -0.07]),
    high=np.array([0.6, 0.07]),
    action_low=-np.ones(1),
    action_high=np.ones(1),
    max_steps=999,
    start=start,
    step=step,
)
