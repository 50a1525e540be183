"""HalfCheetah-v5: Gymnasium's environment on MuJoCo, with names for its variables."""

import warnings
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from vsp import Task
from vsp.tasks.gym_adapter import begin_live, live_task

NAME = "HalfCheetah-v5"
JOINTS = ("bt", "bs", "bf", "ft", "fs", "ff")  # thigh, shin and foot of the back leg, then of the front one
INPUTS = ("z", "θ", *JOINTS, "vx", "vz", "ω", *(f"v{joint}" for joint in JOINTS))


def _begin(starts: np.ndarray) -> np.ndarray:
    """Return a freshly reset environment per start. (n,) objects. Raises ValueError if MuJoCo is not installed."""
    if find_spec("mujoco") is None:
        advice = "run `make venv-mujoco`, or pip install 'gymnasium[mujoco]'"
        raise ValueError(f"{NAME} needs the package mujoco, which is not installed: {advice}")
    import mujoco

    mujoco.set_mju_user_warning(_warn)
    return begin_live(NAME, starts)


def make() -> Task:
    """Return the task. Episodes never end before the step limit, so none fails. Only episodes need MuJoCo."""
    high, force = np.full(len(INPUTS), np.inf), np.ones(len(JOINTS))
    task = live_task(NAME, -high, high, -force, force, max_steps=1000)
    torques = tuple(f"τ{joint}" for joint in JOINTS)
    return replace(task, inputs=INPUTS, outputs=torques, input_labels=INPUTS, slowness=50, begin=_begin)


def _warn(message: str) -> None:
    """Turn a warning of MuJoCo into one of Python, except the one that Gymnasium's model always causes."""
    if "settotalmass" not in message:
        warnings.warn(message, RuntimeWarning, stacklevel=2)
