"""Pendulum-v1: Gymnasium's environment, with its dynamics on arrays."""

import numpy as np

from .base import RUNNING, Task


def start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw angle (rad, 0 is upright) uniform over the circle, angular velocity (rad/s) uniform in [-1, 1]. (n, 2)"""
    return rng.uniform([-np.pi, -1.0], [np.pi, 1.0], size=(n, 2))


def see(states: np.ndarray) -> np.ndarray:
    """Return the cosine and sine of the angle, and the angular velocity. (n, 3)"""
    angle, velocity = states.T
    return np.column_stack([np.cos(angle), np.sin(angle), velocity])


def step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gymnasium's `PendulumEnv.step`, for a batch: rod of 1 kg and 1 m, 10 m/s2, 0.05 s per step, no terminal state."""
    angle, velocity = states.T
    torque = np.clip(actions[:, 0], -2.0, 2.0)
    upright = (angle + np.pi) % (2 * np.pi) - np.pi
    rewards = -(upright**2 + 0.1 * velocity**2 + 0.001 * torque**2)
    velocity = np.clip(velocity + (15.0 * np.sin(angle) + 3.0 * torque) * 0.05, -8.0, 8.0)
    return np.column_stack([angle + velocity * 0.05, velocity]), rewards, np.full(len(states), RUNNING)


TASK = Task(
    name="Pendulum-v1",
    inputs=("cos θ", "sin θ", "ω"),
    outputs=("τ",),
    input_labels=("cos θ", "sin θ", "angular velocity (rad/s)"),
    low=np.array([-1.0, -1.0, -8.0]),
    high=np.array([1.0, 1.0, 8.0]),
    action_low=-2 * np.ones(1),
    action_high=2 * np.ones(1),
    max_steps=200,
    start=start,
    step=step,
    see=see,
    start_size=2,
)
