"""Collect what an explorer shows, as plain data for its script: task, policies, replay, teacher, starts."""

import base64
import json
from collections import defaultdict
from typing import get_args

import numpy as np

from ...config import kinds_of, paper_preset
from ...geometry import METRICS
from ...history import History
from ...policy import VoronoiPolicy
from ...rollouts import Policy, rollout
from ...tasks import GOAL, PIT, RUNNING, Task, get_task
from ...teachers import Teacher, load_teacher

# The tasks that the script plays: lower and upper limits of the plane, and its axis labels
PLANES: dict[str, tuple[list, list, list[str]]] = {
    "SimpleGoal-v0": ([0.0, 0.0], [1.0, 1.0], ["x", "y"]),
    "MountainCarContinuous-v0": ([-1.2, -0.07], [0.6, 0.07], ["position", "velocity (per step)"]),
    "Pendulum-v1": ([-np.pi, -8.0], [np.pi, 8.0], ["angle (rad)", "angular velocity (rad/s)"]),
}
N_STARTS = 400
UNSHOWN = ("neighbours", "sub_policy")  # settings that the browser's method does not have
QUICK = 100  # steps of an episode
N_MOMENTS = 80  # of a replay, beside those with a split or merge


def scene_of(
    policies: dict[str, VoronoiPolicy], task: Task, teacher: Policy | None = None, history: History | None = None
) -> dict:
    """Return the scene of some policies; `history` replays the first. Keys: task (names and limits), plane (low, high,
    labels), starts (n, 2), lost (which outcomes are failures), policies, and teacher: its mean return. Raises
    ValueError for a task that the script does not play."""
    if task.name not in PLANES:
        raise ValueError(f"the browser plays {', '.join(PLANES)}, so {task.name} cannot be explored")
    (low, high, labels), starts = PLANES[task.name], starts_of(task)
    scene = {
        "task": task_of(task),
        "plane": {"low": low, "high": high, "labels": labels},
        "starts": starts.tolist(),
        "lost": [] if task.name == "Pendulum-v1" else [RUNNING, PIT],
        "policies": [numbers_of(policy, name) for name, policy in policies.items()],
    }
    if history is not None:
        scene["policies"][0]["replay"] = _replay(history, next(iter(policies.values())))
    if teacher is not None:
        played = rollout(teacher, task, starts)
        failing = int(np.isin(played.outcomes, scene["lost"]).sum())
        scene["teacher"] = {"mean": float(played.returns.mean()), "failures": failing}
    return scene


def bench_of(name: str) -> dict:
    """Return what the script needs to distil the teacher of a task: scene, network, settings that pictures can show."""
    preset, task, teacher = paper_preset(name), get_task(name), load_teacher(name)
    kinds = {what: kind for what, kind in kinds_of(type(preset)).items() if what not in UNSHOWN}
    words = {what: [False, True] if kind is bool else list(get_args(kind)) for what, kind in kinds.items()}
    words["metric"] = list(METRICS)
    return {
        "scene": scene_of({}, task, teacher),
        "network": network_of(teacher),
        "preset": {what: getattr(preset, what) for what in kinds},
        "choices": {what: values for what, values in words.items() if values},
    }


def network_of(teacher: Teacher) -> dict:
    """Return the sizes of a network's layers; of each the weights (outputs, inputs), row by row, then the biases."""
    layers = teacher.actor.layers
    sizes = [layers[0][0].shape[0], *(len(bias) for _, bias in layers)]
    return {"sizes": sizes, "weights": encoded([part for weight, bias in layers for part in (weight.T, bias)])}


def encoded(arrays: list[np.ndarray]) -> str:
    """Return the numbers of some arrays, one array after the other, as base64 of little-endian float32."""
    return base64.b64encode(b"".join(np.ascontiguousarray(each, "<f4").tobytes() for each in arrays)).decode()


def to_json(scene: object) -> str:
    """Return a scene, or a part of one, as JSON for the script."""
    return json.dumps(scene, separators=(",", ":"), allow_nan=False)


def task_of(task: Task) -> dict:
    """Return the names and limits of a task."""
    names = {"name": task.name, "inputs": list(task.inputs), "outputs": list(task.outputs), "maxSteps": task.max_steps}
    return names | {"actionLow": task.action_low.tolist(), "actionHigh": task.action_high.tolist()}


def starts_of(task: Task) -> np.ndarray:
    """Return starts in a regular grid over the range of the task's starts. (n, 2)"""
    drawn = task.start(np.random.default_rng(0), 10_000)
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    n = N_STARTS if (low == high).any() else round(N_STARTS**0.5)
    axes = [np.array([a]) if a == b else a + (np.arange(n) + 0.5) / n * (b - a) for a, b in zip(low, high)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes)).round(6)


def numbers_of(policy: VoronoiPolicy, name: str) -> dict:
    """Return the numbers of a policy, and how its distance is taken."""
    metric = policy.where.metric
    about = {"name": name, "metric": metric.name, "scale": policy.scale.tolist()}
    if METRICS.get(metric.name) != metric:  # the script knows these by name; JSON knows no infinity
        about["order"] = None if metric.order == np.inf else metric.order
    return about | {"codewords": policy.codewords.tolist(), "coefficients": policy.coefficients.tolist()}


def _replay(history: History, final: VoronoiPolicy) -> list[dict]:
    """Return the run at every change and at moments between, and `final`, because snapshots may be older: iteration,
    codewords, coefficients, what changed, and in a task of short episodes how many starts fail."""
    last, events, task = len(history.cells) - 1, defaultdict(list), final.task
    for event in history.events:
        about = {"kind": event.kind, "codeword": event.codeword.round(4).tolist(), "cause": event.cause}
        events[event.iteration].append(about)
    replay = []
    for n in sorted({*np.linspace(0, last, N_MOMENTS).astype(int).tolist(), *events}):
        policy = history.policy_at(n) if n < last else final
        maps = policy.coefficients.round(4) if n < last else policy.coefficients
        # Codewords are not rounded, because ties of Manhattan distances would end otherwise
        numbers = {"codewords": policy.codewords.tolist(), "coefficients": maps.tolist()}
        replay.append({"n": n, **numbers, "events": events[n]})
        if task.max_steps < QUICK:
            replay[-1]["failures"] = int((rollout(policy, task, starts_of(task)).outcomes != GOAL).sum())
    return replay
