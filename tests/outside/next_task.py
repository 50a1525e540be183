"""Another task, on arrays: push a cart to the middle and stop it there."""

import numpy as np

import vsp
from vsp.tasks import GOAL, RUNNING


def start(rng, n):
    return rng.uniform([-1, -0.2], [1, 0.2], size=(n, 2))


def step(states, actions):
    speed = np.clip(states[:, 1] + 0.05 * np.clip(actions[:, 0], -1, 1), -0.5, 0.5)
    place = np.clip(states[:, 0] + 0.2 * speed, -2, 2)
    there = (np.abs(place) < 0.05) & (np.abs(speed) < 0.05)
    return np.column_stack([place, speed]), np.where(there, 10.0, -np.abs(place)), np.where(there, GOAL, RUNNING)


CART = vsp.Task(
    "Cart-v0", ("x", "v"), ("F",), ("position", "velocity"), np.array([-2, -0.5]), np.array([2, 0.5]),
    np.array([-1.0]), np.array([1.0]), 100, start, step,
)  # fmt: skip


def pilot(states):
    return np.tanh(-3 * states[:, :1] - 4 * states[:, 1:])
