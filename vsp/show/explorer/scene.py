"""What an explorer shows, as plain data for its script: a task, policies, a replay, a teacher, starts."""

from __future__ import annotations

import numpy as np

from ...evaluation import start_states
from ...history import History
from ...policy import VoronoiPolicy
from ...rollouts import Policy, collect_episodes, rollout
from ...tasks import PIT, RUNNING
from ...tasks.base import Task

PLANES = {  # of each task that the script can play: the states that are drawn, and how their axes are called
    "SimpleGoal-v0": ([0.0, 0.0], [1.0, 1.0], ["x", "y"]),
    "MountainCarContinuous-v0": ([-1.2, -0.07], [0.6, 0.07], ["position", "velocity (per step)"]),
    "Pendulum-v1": ([-np.pi, -8.0], [np.pi, 8.0], ["angle (rad)", "angular velocity (rad/s)"]),
}
N_STARTS = 400
TEACHER_POINTS, N_ERRORS = 61, 20_000  # of the teacher's grid along an axis; states at which its error is measured
N_EPISODES, N_STEPS = 8, 250  # that are stored of a task that the script cannot play, and steps of each, at most
EPISODE_SEED = 0
N_MOMENTS = 80  # of a replay, in addition to those with a split or merge


def scene_of(
    policies: dict[str, VoronoiPolicy],
    task: Task,
    teacher: Policy | None = None,
    history: History | None = None,
    axes: tuple[str, str] | None = None,
) -> dict:
    """The scene of some policies, of which `history` replays the first.

    Keys: task (names and limits), plane (low, high, labels), policies; of a task that the script can play starts (n,
    2), lost (which outcomes are failures) and teacher: its actions on a grid, the largest error of reading them from
    there, and its mean return. Other tasks have stored episodes instead, drawn over two inputs, `axes`. Raises
    ValueError for names that are no inputs.
    """
    scene = _numbers_of_task(task) | {"policies": [_numbers(policy, name) for name, policy in policies.items()]}
    if task.name in PLANES:
        scene |= _played(task, teacher)
    else:
        scene |= _stored(policies, task, teacher, axes, scene["policies"])
    if history is not None:
        scene["policies"][0]["replay"] = _replay(history)
    return scene


def _numbers_of_task(task: Task) -> dict:
    return {
        "task": {
            "name": task.name, "inputs": list(task.inputs), "outputs": list(task.outputs), "maxSteps": task.max_steps,
            "actionLow": task.action_low.tolist(), "actionHigh": task.action_high.tolist(),
        },
    }  # fmt: skip


def _played(task: Task, teacher: Policy | None) -> dict:
    """What the script needs to play a task: plane, starts, failures, and a teacher's grid."""
    (low, high, labels), starts = PLANES[task.name], _starts(task)
    found = {
        "plane": {"low": low, "high": high, "labels": labels},
        "starts": starts.tolist(),
        "lost": [] if task.name == "Pendulum-v1" else [RUNNING, PIT],
    }
    if teacher is not None:
        mean = float(rollout(teacher, task, starts).returns.mean())
        found["teacher"] = _teacher(teacher, task, np.array(low), np.array(high)) | {"mean": mean}
    return found


def _stored(
    policies: dict[str, VoronoiPolicy], task: Task, teacher: Policy | None, axes: tuple[str, str] | None, into: list
) -> dict:
    """Episodes of every policy, with the teacher's actions, added to `into`; returns the plane and the box of the
    states."""
    starts, seen = start_states(task, N_EPISODES, EPISODE_SEED), []
    for policy, about in zip(policies.values(), into):
        about["episodes"] = []
        for episode in collect_episodes(policy, task, starts):
            states = episode.states[:: 1 + (len(episode.states) - 1) // N_STEPS].round(4)
            found = {"states": states.tolist()}
            if teacher is not None:
                found["teacher"] = np.round(teacher.predict(states)[0], 3).tolist()
            about["episodes"].append(found)
            seen.append(states)
    seen = np.concatenate(seen)
    low, high, chosen = seen.min(axis=0), seen.max(axis=0), _axes(task, seen, next(iter(policies.values())), axes)
    room = 0.03 * np.maximum(high - low, 1e-3)
    plane = {
        "low": (low - room)[chosen].tolist(),
        "high": (high + room)[chosen].tolist(),
        "labels": [task.input_labels[i] for i in chosen],
    }
    return {"plane": plane, "stored": {"axes": chosen, "low": low.tolist(), "high": high.tolist()}}


def _axes(task: Task, seen: np.ndarray, policy: VoronoiPolicy, names: tuple[str, str] | None) -> list[int]:
    """The two inputs to draw: those of these names, or where the states vary most in units of the look-up."""
    if names is None:
        return sorted(np.argsort(-(seen / policy.scale).std(axis=0), kind="stable")[:2].tolist())
    if len(names) != 2 or not set(names) <= set(task.inputs):
        raise ValueError(f"axes are {names!r}, expected two of the inputs {', '.join(task.inputs)}")
    return [task.inputs.index(name) for name in names]


def _starts(task: Task) -> np.ndarray:
    """Starts in a regular grid over those of the task. (n, 2)"""
    drawn = task.start(np.random.default_rng(0), 10_000)
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    sides = [1 if a == b else None for a, b in zip(low, high)]
    n = N_STARTS if 1 in sides else round(N_STARTS**0.5)
    axes = [np.array([a]) if one else a + (np.arange(n) + 0.5) / n * (b - a) for a, b, one in zip(low, high, sides)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes)).round(6)


def _numbers(policy: VoronoiPolicy, name: str) -> dict:
    about = {"name": name, "metric": policy.metric, "scale": policy.scale.tolist()}
    return about | {"codewords": policy.codewords.tolist(), "coefficients": policy.coefficients.tolist()}


def _teacher(teacher: Policy, task: Task, low: np.ndarray, high: np.ndarray) -> dict:
    """Its actions at the points of a grid, the first axis slowest, and how far off the others are, at most."""
    n, rng = TEACHER_POINTS, np.random.default_rng(0)
    axes = [np.linspace(a, b, n) for a, b in zip(low, high)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    actions = np.round(teacher.predict(task.see(points))[0], 3)
    states = rng.uniform(low, high, size=(N_ERRORS, 2))
    place = (states - low) / (high - low) * (n - 1)
    first = np.minimum(place.astype(int), n - 2)
    share = place - first
    read = np.zeros((N_ERRORS, actions.shape[1]))
    for i, j in np.ndindex(2, 2):  # the corners around each state
        weight = np.where(i, share[:, 0], 1 - share[:, 0]) * np.where(j, share[:, 1], 1 - share[:, 1])
        read += weight[:, None] * actions[(first[:, 0] + i) * n + first[:, 1] + j]
    error = np.abs(read - teacher.predict(task.see(states))[0])
    return {"n": n, "actions": actions.tolist(), "error": float(error.max()), "usual": float(np.quantile(error, 0.9))}


def _replay(history: History) -> list[dict]:
    """The partition at every change, and at moments between: iteration, codewords, coefficients, and what changed."""
    last = len(history.cells) - 1
    changes: dict[int, list[str]] = {}
    for event in history.events:
        changes.setdefault(event.iteration, []).append(event.kind)
    moments = {*np.linspace(0, last, N_MOMENTS).astype(int).tolist(), *changes}
    found = []
    for n in sorted(moments):
        policy = history.policy_at(n)
        rounded = (numbers.round(4).tolist() for numbers in (policy.codewords, policy.coefficients))
        numbers = dict(zip(("codewords", "coefficients"), rounded))
        kinds = changes.get(n, [])
        words = ", ".join(f"{kinds.count(kind)} {kind}" for kind in ("split", "merge") if kind in kinds)
        found.append({"n": n, **numbers, "change": words})
    return found
