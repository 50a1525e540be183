"""Collect what an explorer shows, as plain data for its script: task, policies, replay, teacher, starts."""

from __future__ import annotations

import json
from itertools import permutations

import numpy as np

from ...checks import check_array
from ...evaluation import start_states
from ...history import History
from ...policy import VoronoiPolicy
from ...rollouts import Policy, collect_episodes, rollout
from ...tasks import PIT, RUNNING
from ...tasks.base import Task

# For each task that the script can simulate: lower and upper limits of the plane, and its axis labels
PLANES: dict[str, tuple[list, list, list[str]]] = {
    "SimpleGoal-v0": ([0.0, 0.0], [1.0, 1.0], ["x", "y"]),
    "MountainCarContinuous-v0": ([-1.2, -0.07], [0.6, 0.07], ["position", "velocity (per step)"]),
    "Pendulum-v1": ([-np.pi, -8.0], [np.pi, 8.0], ["angle (rad)", "angular velocity (rad/s)"]),
}
N_STARTS = 400
TEACHER_POINTS, N_ERRORS = 61, 20_000  # of the teacher's grid, per axis; states to measure the grid's error at
N_EPISODES, N_STEPS = 8, 250  # stored for a task that the script cannot simulate: episodes, and most steps of each
EPISODE_SEED = 0
N_NUMBERS = 45_000  # stored in all: some ten bytes each
N_MOMENTS = 80  # of a replay, in addition to those with a split or merge


def scene_of(
    policies: dict[str, VoronoiPolicy],
    task: Task,
    teacher: Policy | None = None,
    history: History | None = None,
    axes: tuple[str, str] | None = None,
) -> dict:
    """Return the scene of some policies; `history` replays the first.

    Keys: task (names and limits), plane (low, high, labels), policies. A task that the script can simulate also has
    starts (n, 2), lost (which outcomes are failures) and teacher: its actions on a grid, the largest error of
    interpolating them, and its mean return. Other tasks have stored episodes instead, drawn over the two inputs `axes`
    (by default the first two), with fewer steps where there are many inputs or policies. Raises ValueError for `axes`
    that are not inputs, for a teacher whose actions have another shape, and as `collect_episodes` does.
    """
    scene: dict = {"task": _task(task), "policies": [_numbers(policy, name) for name, policy in policies.items()]}
    if history is not None:
        first = scene["policies"][0]
        first["replay"] = _replay(history)
        first["replay"][-1] |= {name: first[name] for name in ("codewords", "coefficients")}  # snapshots may be older
    if task.name in PLANES:
        if axes is not None:
            raise ValueError(f"axes are {axes!r}, expected None: the states of {task.name} are drawn as a whole")
        return scene | _played(task, teacher)
    return scene | _stored(policies, task, teacher, axes, scene["policies"])


def to_json(scene: object) -> str:
    """Return a scene, or a part of one, as JSON for the script."""
    return json.dumps(scene, separators=(",", ":"), allow_nan=False)


def _task(task: Task) -> dict:
    names = {"name": task.name, "inputs": list(task.inputs), "outputs": list(task.outputs), "maxSteps": task.max_steps}
    return names | {"actionLow": task.action_low.tolist(), "actionHigh": task.action_high.tolist()}


def _played(task: Task, teacher: Policy | None) -> dict:
    """Return what the script needs to simulate a task: plane, starts, failures, and a teacher's grid."""
    (low, high, labels), starts = PLANES[task.name], starts_of(task)
    lost = [] if task.name == "Pendulum-v1" else [RUNNING, PIT]
    scene = {"plane": {"low": low, "high": high, "labels": labels}, "starts": starts.tolist(), "lost": lost}
    if teacher is not None:
        mean = float(rollout(teacher, task, starts).returns.mean())
        scene["teacher"] = _teacher(teacher, task, np.array(low), np.array(high)) | {"mean": mean}
    return scene


def _stored(
    policies: dict[str, VoronoiPolicy], task: Task, teacher: Policy | None, axes: tuple[str, str] | None, into: list
) -> dict:
    """Add every policy's episodes and the teacher's actions to `into`; return the plane and the box of the states."""
    chosen = [0, min(1, len(task.inputs) - 1)]  # a single input counts twice
    if axes is not None:
        if axes not in permutations(task.inputs, 2):
            raise ValueError(f"axes are {axes!r}, expected two of the inputs {', '.join(task.inputs)}")
        chosen = [task.inputs.index(name) for name in axes]
    starts, numbers = start_states(task, N_EPISODES, EPISODE_SEED), len(task.inputs) + len(task.outputs)
    most = max(1, min(N_STEPS, N_NUMBERS // (len(policies) * N_EPISODES * numbers)))
    visited = []
    for policy, about in zip(policies.values(), into):
        played = [episode.states for episode in collect_episodes(policy, task, starts)]
        about["episodes"] = [_episode(states, teacher, task, most) for states in played]
        visited += played
    low, high = np.concatenate(visited).min(axis=0), np.concatenate(visited).max(axis=0)
    room = 0.03 * np.maximum(high - low, 1e-3 * np.maximum(1.0, np.abs(high)))
    plane = {
        "low": (low - room)[chosen].tolist(),
        "high": (high + room)[chosen].tolist(),
        "labels": [task.input_labels[i] for i in chosen],
    }
    return {"plane": plane, "stored": {"axes": chosen, "low": low.tolist(), "high": high.tolist()}}


def _episode(states: np.ndarray, teacher: Policy | None, task: Task, most: int) -> dict:
    """Return at most `most` evenly spaced states of an episode, and the teacher's actions there."""
    every = 1 + (len(states) - 1) // most
    kept = _rounded(states[::every])
    episode = {"states": kept.tolist(), "every": every, "steps": len(states)}
    if teacher is not None:
        actions = check_array("the teacher's actions", teacher.predict(kept)[0], (len(kept), len(task.outputs)))
        episode["teacher"] = _rounded(actions).tolist()
    return episode


def _rounded(values: np.ndarray) -> np.ndarray:
    """Round to six significant digits."""
    return np.array([float(f"{value:.6g}") for value in values.ravel()]).reshape(values.shape)


def starts_of(task: Task) -> np.ndarray:
    """Return starts in a regular grid over the range of the task's starts. (n, 2)"""
    drawn = task.start(np.random.default_rng(0), 10_000)
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    n = N_STARTS if (low == high).any() else round(N_STARTS**0.5)
    axes = [np.array([a]) if a == b else a + (np.arange(n) + 0.5) / n * (b - a) for a, b in zip(low, high)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes)).round(6)


def _numbers(policy: VoronoiPolicy, name: str) -> dict:
    about = {"name": name, "metric": policy.metric, "scale": policy.scale.tolist()}
    return about | {"codewords": policy.codewords.tolist(), "coefficients": policy.coefficients.tolist()}


def _teacher(teacher: Policy, task: Task, low: np.ndarray, high: np.ndarray) -> dict:
    """Return the teacher's actions on a grid, the first axis slowest, and how wrong interpolation is between them.

    Of `N_ERRORS` random states, "error" is the largest error in any action, and "usual" that of 90 % of them.
    """
    from scipy.interpolate import RegularGridInterpolator  # here: it takes long to import

    n = TEACHER_POINTS
    axes = [np.linspace(a, b, n) for a, b in zip(low, high)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    actions = np.round(teacher.predict(task.see(points))[0], 3)
    states = np.random.default_rng(0).uniform(low, high, size=(N_ERRORS, 2))
    between = RegularGridInterpolator(axes, actions.reshape(n, n, -1))(states)
    error = np.abs(between - teacher.predict(task.see(states))[0])
    usual = float(np.quantile(error.max(axis=1), 0.9))
    return {"n": n, "actions": actions.tolist(), "error": float(error.max()), "usual": usual}


def _replay(history: History) -> list[dict]:
    """Return the partition at every change and at moments between: iteration, codewords, coefficients and changes."""
    last = len(history.cells) - 1
    changes: dict[int, list[str]] = {}
    for event in history.events:
        changes.setdefault(event.iteration, []).append(event.kind)
    moments = {*np.linspace(0, last, N_MOMENTS).astype(int).tolist(), *changes}
    replay = []
    for n in sorted(moments):
        policy, kinds = history.policy_at(n), changes.get(n, [])
        words = ", ".join(f"{kinds.count(kind)} {kind}" for kind in ("split", "merge") if kind in kinds)
        numbers = {name: getattr(policy, name).round(4).tolist() for name in ("codewords", "coefficients")}
        replay.append({"n": n, **numbers, "change": words})
    return replay
