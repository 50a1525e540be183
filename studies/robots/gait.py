"""Record HalfCheetah's gait step by step, as numbers: lines from joint to joint, the feet on the ground, and the cell.

A picture of the gait then needs neither a physics engine nor a renderer.
"""

import numpy as np
import pandas as pd

from vsp import Task, VoronoiPolicy, get_task
from vsp.tasks.base import RUNNING

DIGITS = 4  # decimals of a position in metres, and of an input


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
