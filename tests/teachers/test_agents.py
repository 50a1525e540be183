from types import SimpleNamespace

import numpy as np
import pytest
from support import PENDULUM, SIMPLEGOAL, CurvedTeacher, tiny

import vsp
from vsp.teachers.agents import agent

STATES = np.random.default_rng(0).random((50, 2))


def straight(obs):
    return np.full((len(obs), 2), -0.5)


def test_a_function_is_a_teacher():
    actions, state = agent(straight).predict(STATES)
    assert state is None and np.array_equal(actions, np.full((50, 2), -0.5))
    plain = SimpleNamespace(predict=lambda obs: (straight(obs), None))
    policies = [vsp.distill(teacher, SIMPLEGOAL, tiny(), seed=0)[0] for teacher in (agent(straight), plain)]
    assert np.array_equal(*(policy.coefficients for policy in policies))


def test_what_predicts_is_asked_as_it_is():
    one = agent(CurvedTeacher())
    assert np.array_equal(one.predict(STATES)[0], CurvedTeacher().predict(STATES)[0]) and agent(one) is one


@pytest.mark.parametrize("algorithm", ["PPO", "TD3"])
def test_agents_of_stable_baselines_act_without_dice(algorithm):
    import stable_baselines3

    trained = getattr(stable_baselines3, algorithm)("MlpPolicy", PENDULUM, seed=0, policy_kwargs={"net_arch": [8]})
    states = np.random.default_rng(1).uniform(-1, 1, (20, 3)).astype(np.float32)
    expected = trained.predict(states, deterministic=True)[0]
    first, second = (agent(trained).predict(states)[0] for _ in range(2))
    assert np.array_equal(first, second) and np.array_equal(first, expected)
    if algorithm != "TD3":
        assert not np.array_equal(trained.predict(states)[0], expected)
