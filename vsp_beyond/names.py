"""Names of inputs and outputs for tasks that vsp does not name itself: from a file, or for Gymnasium's own tasks."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import gymnasium

from vsp.tasks import Task, task_names

LEG = "hip", "hip speed", "knee", "knee speed", "contact"
BIPEDAL = (  # its documentation names them; its leg 1 is drawn behind
    ["hull angle", "hull speed", "vx", "vy", *(f"{part} {leg}" for leg in (1, 2) for part in LEG),
     *(f"lidar {i}" for i in range(10))],
    ["hip 1 torque", "knee 1 torque", "hip 2 torque", "knee 2 torque"],
)  # fmt: skip
# Of a joint's numbers in MuJoCo: free, ball, slide, hinge
PLACES = " x, y, z,.w,.x,.y,.z", ".w,.x,.y,.z", "", ""
SPEEDS = " x, y, z, turn x, turn y, turn z", " turn x, turn y, turn z", "", ""


def named(task: Task, file: str | None = None) -> Task:
    """Return `task` with the names of a JSON file, {"inputs": [...], "outputs": [...]}; without one, with those of
    Gymnasium's own tasks where they are known. Raises ValueError for names that are too few, too many or not distinct.
    """
    if file is not None:
        try:
            given = json.loads(Path(file).read_text("utf-8"))
            inputs, outputs = ([str(name) for name in given[what]] for what in ("inputs", "outputs"))
        except (ValueError, TypeError, KeyError) as error:
            raise ValueError(f'{file} holds no names: expected {{"inputs": [...], "outputs": [...]}}') from error
    elif task.name in task_names() or "gymnasium.envs." not in str(gymnasium.spec(task.name).entry_point):
        return task
    else:
        inputs, outputs = BIPEDAL if task.name.startswith("BipedalWalker") else _of_model(task)
    for what, names, known in (("inputs", inputs, task.inputs), ("outputs", outputs, task.outputs)):
        if not len(set(names)) == len(names) == len(known):
            if file is None:
                return task
            raise ValueError(f"{file} has {len(set(names))} different {what}, expected {len(known)}")
    return replace(task, inputs=tuple(inputs), input_labels=tuple(inputs), outputs=tuple(outputs))


def _of_model(task: Task) -> tuple[list[str], list[str]]:
    """Return names by the joints and motors of MuJoCo's model, in the order that the environment states."""
    env = gymnasium.make(task.name).unwrapped
    model, parts = getattr(env, "model", None), dict(getattr(env, "observation_structure", None) or {})
    env.close()
    if model is None or not parts:
        return [], []
    joints = [model.joint(i) for i in range(model.njnt)]
    places, speeds = (list(_numbers(joints, kinds)) for kinds in (PLACES, SPEEDS))
    inputs = places[parts.pop("skipped_qpos", 0) :] + [f"{name} speed" for name in speeds]
    for name in ("qpos", "qvel"):
        parts.pop(name, None)
    inputs += [f"{name} {i}" for name, n in parts.items() for i in range(n)]
    motors = (model.joint(model.actuator(i).trnid[0]).name for i in range(model.nu))
    return inputs, [f"{name} torque" for name in motors]


def _numbers(joints: list, kinds: tuple[str, ...]) -> Iterator[str]:
    for joint in joints:
        for part in kinds[int(joint.type[0])].split(","):
            yield joint.name + part
