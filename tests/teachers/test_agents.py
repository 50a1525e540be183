from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from support import SIMPLEGOAL, CurvedTeacher, same_arrays, tiny
from zips import made

import vsp
from vsp.teachers.agents import agent, digest_of

STATES = np.random.default_rng(0).random((50, 2)).astype(np.float32)


def straight(obs):
    return np.full((len(obs), 2), -0.5)


def predicting(predict):
    return SimpleNamespace(predict=predict)


def told(obs, **options):
    return options["deterministic"] - 1.5 + 0 * obs, None


SOURCES = [straight, predicting(lambda obs: (straight(obs), None)), predicting(straight), predicting(told)]


@pytest.mark.parametrize("source", SOURCES)
def test_a_function_and_whatever_predicts_is_a_teacher(source):
    actions, state = agent(source).predict(STATES)
    assert state is None and np.array_equal(actions, np.full((50, 2), -0.5))
    policies = [vsp.distill(teacher, SIMPLEGOAL, tiny(), seed=0)[0] for teacher in (agent(straight), source)]
    assert np.array_equal(*(policy.coefficients for policy in policies))


def test_what_predicts_is_asked_as_it_is():
    one = agent(CurvedTeacher())
    assert np.array_equal(one.predict(STATES)[0], CurvedTeacher().predict(STATES)[0]) and agent(one) is one


def test_dice_and_memory_are_refused():
    dice, memory = np.random.default_rng(0).permutation, predicting(lambda obs: (straight(obs), obs))
    remedy = "keeps a state between steps, .* train one without memory"
    for source, message in ((dice, "same observations differently"), (memory, remedy)):
        with pytest.raises(ValueError, match=message):
            vsp.distill(source, SIMPLEGOAL, tiny(), seed=0)


@pytest.mark.parametrize("algorithm", ["PPO", "SAC", "TD3"])
def test_agents_of_stable_baselines_act_without_dice(algorithm):
    trained, starts = made(algorithm, net_arch=[8]), vsp.start_states(SIMPLEGOAL, 20, seed=0)
    first, second = (agent(trained).predict(STATES)[0] for _ in range(2))
    assert np.array_equal(first, second) and np.array_equal(first, trained.predict(STATES, deterministic=True)[0])
    returns = [vsp.rollout(source, SIMPLEGOAL, starts).returns for source in (trained, trained, agent(trained))]
    assert same_arrays(returns[:2], returns[1:])
    if algorithm != "TD3":
        assert not np.array_equal(trained.predict(STATES)[0], first)


def test_a_model_is_identified_by_its_weights():
    model = made("PPO", net_arch=[8])
    before = digest_of(agent(model))
    assert before == digest_of(agent(model)) != digest_of(agent(made("TD3", net_arch=[8])))
    model.policy.action_net.bias.data[0] += 1
    assert digest_of(agent(model)) != before
    with pytest.raises(ValueError, match='vsp.agent.function, name="mine"'):
        digest_of(agent(predicting(straight)))


def test_a_model_must_have_the_spaces_of_the_task():
    model = made("SAC", gymnasium.wrappers.RescaleAction(gymnasium.make("Pendulum-v1"), -1.0, 1.0), net_arch=[8])
    said = r"low of its action_space is .-1.0., Pendulum-v1 has .-2.0.: name the task"
    with pytest.raises(ValueError, match=said) as caught:
        agent(model, "Pendulum-v1")
    assert "vsp.agent" not in str(caught.value)
    with pytest.raises(ValueError, match="its observation_space has 3 numbers, SimpleGoal-v0 has 2"):
        vsp.distill(model, SIMPLEGOAL, tiny(), seed=0)
    with pytest.raises(ValueError, match="NoSuch-v9"):
        agent(made("SAC", net_arch=[8]), "NoSuch-v9")
    with pytest.raises(ValueError, match="its action_space is Discrete, expected a Box"):
        agent(made("DQN", "MountainCar-v0", net_arch=[8]), "MountainCarContinuous-v0")
    assert agent(made("SAC", net_arch=[8]), SIMPLEGOAL).predict(STATES)[0].shape == (50, 2)


@pytest.mark.parametrize(
    ("name", "said"), [("x.pt", "torch.as_tensor"), ("x.onnx", "session.run"), ("x.cleanrl_model", "torch")]
)
def test_files_of_other_libraries_are_refused_with_the_code_that_wraps_them(name, said):
    message = rf"{name}: expected a .safetensors file, .*vsp.agent.lambda obs: .*{said}.*name='{name}'"
    with pytest.raises(ValueError, match=message):
        agent(name, SIMPLEGOAL)
