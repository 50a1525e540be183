"""HalfCheetah-v5: Gymnasium's environment on MuJoCo, with names for its variables."""

from __future__ import annotations

import warnings
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from .base import Task
from .gym_adapter import begin_live, live_task

NAME = "HalfCheetah-v5"
JOINTS = ("bt", "bs", "bf", "ft", "fs", "ff")  # thigh, shin and foot of the back leg, then of the front one
INPUTS = ("z", "θ", *JOINTS, "vx", "vz", "ω", *(f"v{joint}" for joint in JOINTS))


def _begin(starts: np.ndarray) -> np.ndarray:
    """A freshly reset environment per start. (n,) objects. Raises ValueError where MuJoCo is not installed."""
    if find_spec("mujoco") is None:
        advice = "run `make venv-mujoco`, or pip install 'gymnasium[mujoco]'"
        raise ValueError(f"{NAME} is played by the package mujoco, which is not installed: {advice}")
    import mujoco

    mujoco.set_mju_user_warning(_warn)
    return begin_live(NAME, starts)


def make() -> Task:
    """The task, whose episodes never end before the limit: nothing fails. Only to play it needs MuJoCo."""
    high, force = np.full(len(INPUTS), np.inf), np.ones(len(JOINTS))
    task = live_task(NAME, -high, high, -force, force, max_steps=1000)
    torques = tuple(f"τ{joint}" for joint in JOINTS)
    return replace(task, inputs=INPUTS, outputs=torques, input_labels=INPUTS, begin=_begin)


def _warn(message: str) -> None:
    """A warning of MuJoCo's as one of Python's; not the one that every environment gives for Gymnasium's model."""
    if "settotalmass" not in message:
        warnings.warn(message, RuntimeWarning, stacklevel=2)
