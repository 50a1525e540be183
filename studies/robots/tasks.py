"""BipedalWalker-v3 and HalfCheetah-v5: Gymnasium's environments, stepped by their engines, with names for variables;
and a gait as numbers, whose picture needs neither a physics engine nor a renderer."""

import warnings
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pandas as pd

from vsp import Task, VoronoiPolicy, get_task
from vsp.tasks import RUNNING, register_maker
from vsp.tasks.gym_adapter import begin_live, gymnasium_task, live_task

WALKER, CHEETAH = "BipedalWalker-v3", "HalfCheetah-v5"
OF_WALKER = (
    "θ", "ω", "vx", "vy", "h1", "vh1", "k1", "vk1", "c1", "h2", "vh2", "k2", "vk2", "c2", *(f"l{i}" for i in range(10)),
)  # fmt: skip
JOINTS = ("bt", "bs", "bf", "ft", "fs", "ff")  # thigh, shin and foot of the back leg, then of the front one
OF_CHEETAH = ("z", "θ", *JOINTS, "vx", "vz", "ω", *(f"v{joint}" for joint in JOINTS))
DIGITS = 4  # decimals of a position in metres, and of an input


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


def record_gait(policy: VoronoiPolicy, task: str | Task, *, start: float, n_steps: int) -> pd.DataFrame:
    """Record an episode from the seed `start`, one row per step: step, cell, back and front (whether this foot touches
    the ground), for each line of the body x0, z0, x1 and z1 in metres, such as "torso x0", and what the policy sees of
    each input, such as "input θ"."""
    task = get_task(task)
    states, rows = task.begin(np.array([[float(start)]])), []
    for step in range(min(n_steps, task.max_steps)):
        observed, env = task.observe(states), states[0].env.unwrapped
        row: dict[str, float] = {"step": step, "cell": int(policy.cells(observed)[0]), **_feet(env)}
        inputs = {f"input {name}": value for name, value in zip(task.inputs, observed[0], strict=True)}
        rows.append(row | {name: round(float(value), DIGITS) for name, value in (_lines(env) | inputs).items()})
        states, _, outcomes = task.step(states, policy.predict(observed)[0])
        if outcomes[0] != RUNNING:
            break
    return pd.DataFrame(rows)


def _lines(env) -> dict[str, float]:
    """Return the capsules of MuJoCo's model, each as x, z of both ends of its axis."""
    lines = {}
    for i in range(env.model.ngeom):
        if (name := env.model.geom(i).name) != "floor":
            along = env.data.geom_xmat[i].reshape(3, 3)[:, 2] * env.model.geom_size[i, 1]
            start, end = env.data.geom_xpos[i] - along, env.data.geom_xpos[i] + along
            lines |= {f"{name} x0": start[0], f"{name} z0": start[2], f"{name} x1": end[0], f"{name} z1": end[2]}
    return lines


def _feet(env) -> dict[str, int]:
    touching = {env.model.geom(geom).name for contact in env.data.contact for geom in (contact.geom1, contact.geom2)}
    return {"back": int("bfoot" in touching), "front": int("ffoot" in touching)}


register_maker(WALKER, walker)
register_maker(CHEETAH, cheetah)
