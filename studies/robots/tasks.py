"""BipedalWalker-v3 and HalfCheetah-v5: Gymnasium's environments, stepped by their engines, with names for variables."""

import warnings
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from vsp import Task
from vsp.tasks import register_maker
from vsp.tasks.gym_adapter import begin_live, gymnasium_task, live_task

WALKER, CHEETAH = "BipedalWalker-v3", "HalfCheetah-v5"
OF_WALKER = (
    "θ", "ω", "vx", "vy", "h1", "vh1", "k1", "vk1", "c1", "h2", "vh2", "k2", "vk2", "c2", *(f"l{i}" for i in range(10)),
)  # fmt: skip
JOINTS = ("bt", "bs", "bf", "ft", "fs", "ff")  # thigh, shin and foot of the back leg, then of the front one
OF_CHEETAH = ("z", "θ", *JOINTS, "vx", "vz", "ω", *(f"v{joint}" for joint in JOINTS))


def walked(observation: np.ndarray, reward: float, info: dict) -> bool:
    """Whether the episode ended at the end of the track, and not in a fall, for which the last reward is -100."""
    return reward > -100.0


def walker() -> Task:
    """Return BipedalWalker. Opens an environment."""
    task, torques = gymnasium_task(WALKER, walked), ("τh1", "τk1", "τh2", "τk2")
    return replace(task, inputs=OF_WALKER, outputs=torques, input_labels=OF_WALKER, slowness=20)


def _begin(starts: np.ndarray) -> np.ndarray:
    """Return a freshly reset environment per start. (n,) objects. Raises ValueError if MuJoCo is not installed."""
    if find_spec("mujoco") is None:
        advice = "run `make venv-mujoco`, or pip install 'gymnasium[mujoco]'"
        raise ValueError(f"{CHEETAH} needs the package mujoco, which is not installed: {advice}")
    import mujoco

    mujoco.set_mju_user_warning(_warn)
    return begin_live(CHEETAH, starts)


def cheetah() -> Task:
    """Return HalfCheetah. Episodes never end before the step limit, so none fails. Only episodes need MuJoCo."""
    high, force = np.full(len(OF_CHEETAH), np.inf), np.ones(len(JOINTS))
    task = live_task(CHEETAH, -high, high, -force, force, max_steps=1000)
    torques = tuple(f"τ{joint}" for joint in JOINTS)
    return replace(task, inputs=OF_CHEETAH, outputs=torques, input_labels=OF_CHEETAH, slowness=50, begin=_begin)


def _warn(message: str) -> None:
    """Turn a warning of MuJoCo into one of Python, except the one that Gymnasium's model always causes."""
    if "settotalmass" not in message:
        warnings.warn(message, RuntimeWarning, stacklevel=2)


register_maker(WALKER, walker)
register_maker(CHEETAH, cheetah)
