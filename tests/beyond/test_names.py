import json
import types

import gymnasium
import pytest
from support import LUNARLANDER, MOUNTAINCAR

from vsp.tasks import get_task
from vsp.tasks.gym_adapter import gymnasium_task
from vsp_beyond import names


def test_names_of_gymnasium_are_those_it_documents_and_own_ones_stay(monkeypatch):
    monkeypatch.setattr(names, "task_names", lambda: [LUNARLANDER])  # studies name the walker themselves
    walker = names.named(gymnasium_task("BipedalWalker-v3"))
    assert list(walker.inputs) == names.BIPEDAL[0] and walker.inputs[8:10] == ("contact 1", "hip 2")
    assert walker.outputs == ("hip 1 torque", "knee 1 torque", "hip 2 torque", "knee 2 torque")
    assert names.named(get_task(LUNARLANDER)) is get_task(LUNARLANDER)


class Arm(gymnasium.Env):
    """As a MuJoCo environment names its numbers: a free body, a hinge and one contact force."""

    observation_space, action_space = gymnasium.spaces.Box(-1, 1, (13,)), gymnasium.spaces.Box(-1, 1, (1,))
    observation_structure = {"skipped_qpos": 2, "qpos": 6, "qvel": 7, "cfrc": 0}
    joints = types.SimpleNamespace(name="root", type=[0]), types.SimpleNamespace(name="elbow", type=[3])
    motor = types.SimpleNamespace(trnid=[1])
    model = types.SimpleNamespace(njnt=2, nu=1, joint=joints.__getitem__, actuator=lambda i: Arm.motor)


def test_mujocos_names_come_from_its_model(monkeypatch):
    gymnasium.register("Arm-v0", entry_point=Arm, max_episode_steps=5)
    assert names.named(get_task("Arm-v0")).inputs[0] == "s0"  # somebody else's numbers may mean something else
    spec = types.SimpleNamespace(entry_point="gymnasium.envs.mujoco:Arm")
    monkeypatch.setattr(gymnasium, "spec", lambda name: spec)
    task = names.named(get_task("Arm-v0"))
    assert task.inputs[:7] == ("root z", "root.w", "root.x", "root.y", "root.z", "elbow", "root x speed")
    assert task.inputs[-2:] == ("root turn z speed", "elbow speed") and task.outputs == ("elbow torque",)
    monkeypatch.setattr(Arm, "observation_structure", {"qpos": 3})
    assert names.named(get_task("Arm-v0")).inputs[0] == "s0"
    ball = [types.SimpleNamespace(name="b", type=[1])]
    assert list(names._numbers(ball, names.PLACES)) == ["b.w", "b.x", "b.y", "b.z"]


@pytest.mark.parametrize(
    ("text", "said"),
    [("[]", "holds no names"), ("{", "holds no names"), ('{"inputs": ["a", "b"]}', "holds no names"),
     ('{"inputs": ["a", "a"], "outputs": ["F"]}', "1 different inputs, expected 2")],
)  # fmt: skip
def test_a_file_names_all_or_is_refused(text, said, tmp_path):
    (tmp_path / "names.json").write_text(json.dumps({"inputs": ["place", "speed"], "outputs": ["push"]}))
    assert names.named(get_task(MOUNTAINCAR), tmp_path / "names.json").input_labels == ("place", "speed")
    (tmp_path / "names.json").write_text(text)
    with pytest.raises(ValueError, match=said):
        names.named(get_task(MOUNTAINCAR), tmp_path / "names.json")
