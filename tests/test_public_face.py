import dataclasses

import numpy as np
import pandas as pd
import pytest
from support import TASKS

import vsp
from vsp.run import listed
from vsp.teachers.teacher import SHIPPED


@pytest.mark.parametrize("task", TASKS)
def test_teacher_config_distill_evaluate(task, tmp_path):
    teacher, config = vsp.load_teacher(task), vsp.preset(task)
    obs = np.array([0.3, 0.05], np.float32)
    action, state = teacher.predict(obs)
    m = len(vsp.get_task(task).outputs)
    assert state is None and action.shape == (m,)
    short = dataclasses.replace(config.quick(), n_epochs=60, n_freeze=5)
    policy, history = vsp.distill(teacher, task, short, seed=0)
    assert policy.codewords.shape == (len(policy), 2) and policy.coefficients.shape == (len(policy), 3, m)
    assert policy.predict(obs)[0].shape == (m,) and policy.predict(np.tile(obs, (5, 1)))[0].shape == (5, m)
    policy.save(tmp_path / "policy")
    back = vsp.VoronoiPolicy.load(tmp_path / "policy")
    assert np.array_equal(back.predict(obs)[0], policy.predict(obs)[0])
    returns = vsp.evaluate(policy, task, n_episodes=20, seed=0)
    assert isinstance(returns, pd.DataFrame) and {"return", "length", "outcome"} <= set(returns) and len(returns) == 20
    assert len(history.to_frame()) == 60


def test_a_distilled_policy_earns_most_of_what_its_teacher_does():
    teacher = vsp.load_teacher("SimpleGoal-v0")
    policy, _ = vsp.distill(teacher, "SimpleGoal-v0", seed=0)
    target, mean = (vsp.evaluate(actor, "SimpleGoal-v0", 1000, seed=1)["return"].mean() for actor in (teacher, policy))
    assert target - 5 < mean < target + 1  # standing still earns 0


def test_a_path_to_a_teacher_may_be_relative(tmp_path, monkeypatch):
    for suffix in (".safetensors", ".json"):
        listed.write_listed(tmp_path / f"mine{suffix}", (SHIPPED / f"SimpleGoal-v0{suffix}").read_bytes())
    monkeypatch.chdir(tmp_path)
    assert vsp.load_teacher("mine.safetensors").digest == vsp.load_teacher("SimpleGoal-v0").digest
