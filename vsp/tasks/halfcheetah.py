"""HalfCheetah-v5: Gymnasium's environment on MuJoCo, with names for its variables."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

from .base import Task
from .gym_adapter import gymnasium_task

NAME = "HalfCheetah-v5"
JOINTS = ("bt", "bs", "bf", "ft", "fs", "ff")  # thigh, shin and foot of the back leg, then of the front one
INPUTS = ("z", "θ", *JOINTS, "vx", "vz", "ω", *(f"v{joint}" for joint in JOINTS))


def make() -> Task:
    """The task, whose episodes never end before the limit: nothing fails. Opens an environment.

    Raises ValueError where MuJoCo is not installed.
    """
    if find_spec("mujoco") is None:
        advice = "run `make venv-mujoco`, or pip install 'gymnasium[mujoco]'"
        raise ValueError(f"{NAME} needs the package mujoco, which is not installed: {advice}")
    torques = tuple(f"τ{joint}" for joint in JOINTS)
    return replace(gymnasium_task(NAME), inputs=INPUTS, outputs=torques, input_labels=INPUTS)
