import dataclasses
import importlib
import inspect
import pkgutil
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
import pytest
from support import TASKS

import vsp
from vsp.paper import printed
from vsp.teachers.teacher import SHIPPED


@pytest.fixture(scope="module")
def made():
    teacher = vsp.load_teacher("SimpleGoal-v0")
    config = dataclasses.replace(vsp.preset("SimpleGoal-v0").quick(), n_epochs=200, n_freeze=40)
    return teacher, config, *vsp.distill(teacher, "SimpleGoal-v0", config, seed=0)


def test_tasks():
    assert vsp.task_names()[:2] == list(TASKS)


@pytest.mark.parametrize("task", TASKS)
def test_gymnasium_knows_every_task(task):
    env = gymnasium.make(task)
    obs, _ = env.reset(seed=0)
    obs, reward, terminated, truncated, _ = env.step(env.action_space.sample())
    assert env.observation_space.contains(obs) and not terminated and not truncated and np.isfinite(reward)


@pytest.mark.parametrize("task", TASKS)
def test_teacher_config_distill_evaluate(task, tmp_path):
    teacher, config = vsp.load_teacher(task), vsp.preset(task)
    obs = np.array([0.3, 0.05], np.float32)
    action, state = teacher.predict(obs)
    assert state is None and action.shape == gymnasium.make(task).action_space.shape
    short = dataclasses.replace(config.quick(), n_epochs=60, n_freeze=5)
    policy, history = vsp.distill(teacher, task, short, seed=0)
    k, d, m = len(policy.codewords), 2, len(action)
    assert policy.codewords.shape == (k, d) and policy.coefficients.shape == (k, d + 1, m)
    assert policy.predict(obs)[0].shape == (m,) and policy.predict(np.tile(obs, (5, 1)))[0].shape == (5, m)
    policy.save(tmp_path / "policy")
    back = vsp.VoronoiPolicy.load(tmp_path / "policy")
    assert np.array_equal(back.predict(obs)[0], policy.predict(obs)[0])
    returns = vsp.evaluate(policy, task, n_episodes=20, seed=0)
    assert isinstance(returns, pd.DataFrame) and {"return", "length", "outcome"} <= set(returns) and len(returns) == 20
    assert len(history.to_frame()) == 60


def test_the_whole_face_from_a_fresh_prompt():
    """In a process of its own, so that no other test has imported a part for it."""
    code = """
import gymnasium, vsp
gymnasium.make("SimpleGoal-v0")
assert vsp.task_names()[:2] == ["SimpleGoal-v0", "MountainCarContinuous-v0"]
teacher, config = vsp.load_teacher("SimpleGoal-v0"), vsp.preset("SimpleGoal-v0").quick()
vsp.distill, vsp.evaluate, vsp.VoronoiPolicy, vsp.Config
import sys
print({"torch", "stable_baselines3", "matplotlib", "sklearn"} & set(sys.modules))
vsp.paper.published_policy("SimpleGoal-v0").predict([0.5, 0.5])
vsp.show.panels, vsp.paper.baselines.linear_map
import studies.comparison, vsp_beyond, vsp_course
print({"torch", "stable_baselines3"} & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["set()", "set()"]


def test_a_student_earns_most_of_what_its_teacher_does():
    teacher = vsp.load_teacher("SimpleGoal-v0")
    policy, _ = vsp.distill(teacher, "SimpleGoal-v0", seed=0)
    own, student = (vsp.evaluate(actor, "SimpleGoal-v0", 1000, seed=1)["return"].mean() for actor in (teacher, policy))
    assert own - 5 < student < own + 1  # standing still earns 0


PARTS = ("vsp", "vsp_beyond", "studies", "vsp_course")
PATHS = [Path(vsp.__file__).parents[1] / part for part in PARTS]
MODULES = sorted(one.name for part, path in zip(PARTS, PATHS) for one in pkgutil.walk_packages([str(path)], f"{part}."))


@pytest.mark.parametrize("name", MODULES)
def test_everything_public_says_what_it_does(name):
    module = importlib.import_module(name)
    assert module.__doc__
    public = [
        v for n, v in vars(module).items() if not n.startswith("_") and getattr(v, "__module__", "") == module.__name__
    ]
    for thing in public:
        if inspect.isfunction(thing) or inspect.isclass(thing):
            assert thing.__doc__, thing
        for n, member in vars(thing).items() if inspect.isclass(thing) else ():
            if inspect.isfunction(member) and not n.startswith("_") and not issubclass(thing, gymnasium.Env):
                assert member.__doc__ or thing.__name__ == "Policy", f"{thing}.{n}"


@pytest.mark.parametrize(
    "call",
    [
        lambda: vsp.load_teacher("Nowhere-v0"),
        lambda: vsp.preset("Nowhere-v0"),
        lambda: vsp.distill(None, "Nowhere-v0", seed=0),
        lambda: vsp.evaluate(None, "Nowhere-v0", seed=0),
        lambda: printed.published_policy("Nowhere-v0"),
        lambda: vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task="Nowhere-v0"),
    ],
)
def test_an_unknown_task_is_the_same_clear_error_everywhere(call):
    with pytest.raises(ValueError, match="unknown task 'Nowhere-v0', expected one of .*SimpleGoal-v0"):
        call()


def test_a_path_to_a_teacher_may_be_relative(tmp_path, monkeypatch):
    import shutil

    for suffix in (".safetensors", ".json"):
        shutil.copy(SHIPPED / f"SimpleGoal-v0{suffix}", tmp_path / f"own{suffix}")
    monkeypatch.chdir(tmp_path)
    assert vsp.load_teacher("own.safetensors").digest == vsp.load_teacher("SimpleGoal-v0").digest
