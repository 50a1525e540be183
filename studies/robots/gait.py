"""Record a robot's gait step by step, as numbers: lines from joint to joint, the feet on the ground, and the cell.

A picture of the gait then needs neither a physics engine nor a renderer.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from vsp.checks import check_count
from vsp.policy import VoronoiPolicy
from vsp.tasks.base import RUNNING, Task
from vsp.tasks.registry import get_task

DIGITS = 4  # decimals of a position in metres, and of an input
Body = tuple[dict[str, np.ndarray], tuple[bool, bool]]  # lines (4,): x, z of both ends; back foot down, front foot


def record_gait(policy: VoronoiPolicy, task: str | Task, *, start: float, n_steps: int) -> pd.DataFrame:
    """Record an episode from the seed `start`: one row per step with cell, feet, and the lines that make up the body.

    Columns step, cell, back and front (whether this foot touches the ground), for each line of the body x0, z0, x1
    and z1 in metres, such as "torso x0", and for each input what the policy sees, such as "input θ".
    Raises ValueError for a robot whose body is not known here.
    """
    task = get_task(task)
    check_count("n_steps", n_steps)
    if task.name not in _BODIES:
        raise ValueError(f"task is {task.name}, expected one of {list(_BODIES)}: no other body is known")
    body, states, rows = _BODIES[task.name], task.begin(np.array([[float(start)]])), []
    for step in range(min(n_steps, task.max_steps)):
        seen = task.observe(states)
        lines, (back, front) = body(states[0].env.unwrapped)
        row = {"step": step, "cell": int(policy.cells(seen)[0]), "back": int(back), "front": int(front)}
        for name, ends in lines.items():
            row |= {f"{name} {end}": round(float(value), DIGITS) for end, value in zip(("x0", "z0", "x1", "z1"), ends)}
        row |= {f"input {name}": round(float(value), DIGITS) for name, value in zip(task.inputs, seen[0], strict=True)}
        rows.append(row)
        states, _, outcomes = task.step(states, policy.predict(seen)[0])
        if outcomes[0] != RUNNING:
            break
    return pd.DataFrame(rows)


def phases(gait: pd.DataFrame) -> pd.DataFrame:
    """Return for each cell its share of the steps, and the shares of these with the back foot down, the front foot
    down, both, or none."""
    feet = pd.DataFrame(
        {
            "back down": gait.back == 1, "front down": gait.front == 1,
            "both": (gait.back == 1) & (gait.front == 1), "in the air": (gait.back == 0) & (gait.front == 0),
        }
    )  # fmt: skip
    found = feet.groupby(gait.cell).mean()
    found.insert(0, "steps", gait.cell.value_counts(normalize=True))
    return found


def _cheetah(env) -> Body:
    """The capsules of MuJoCo's model, each as the line along its axis."""
    model, data, lines = env.model, env.data, {}
    names = [model.geom(i).name for i in range(model.ngeom)]
    for i, name in enumerate(names):
        if name != "floor":
            along = data.geom_xmat[i].reshape(3, 3)[:, 2] * model.geom_size[i, 1]
            one, other = data.geom_xpos[i] - along, data.geom_xpos[i] + along
            lines[name] = np.array([one[0], one[2], other[0], other[2]])
    touching = {names[geom] for contact in data.contact for geom in (contact.geom1, contact.geom2)}
    return lines, ("bfoot" in touching, "ffoot" in touching)


def _walker(env) -> Body:
    """The edges of the hull and the axes of the four parts of the legs, relative to the height where the ground
    begins."""
    from gymnasium.envs.box2d.bipedal_walker import LEG_H, TERRAIN_HEIGHT

    ground = np.array([0.0, TERRAIN_HEIGHT])
    corners = [np.array(env.hull.transform * vertex) - ground for vertex in env.hull.fixtures[0].shape.vertices]
    lines = {
        f"hull {i}": np.array([*one, *other]) for i, (one, other) in enumerate(zip(corners, corners[1:] + corners[:1]))
    }
    for name, leg in zip(("thigh 1", "shin 1", "thigh 2", "shin 2"), env.legs):
        along = 0.5 * LEG_H * np.array([-np.sin(leg.angle), np.cos(leg.angle)])
        middle = np.array(leg.position) - ground
        lines[name] = np.concatenate([middle - along, middle + along])
    return lines, (env.legs[1].ground_contact, env.legs[3].ground_contact)


_BODIES: dict[str, Callable[..., Body]] = {"HalfCheetah-v5": _cheetah, "BipedalWalker-v3": _walker}
