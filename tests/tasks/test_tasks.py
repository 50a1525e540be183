import dataclasses
import warnings
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.classic_control import PendulumEnv
from gymnasium.utils.env_checker import check_env
from support import CHEETAH, LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS, WALKER, RandomPolicy

import vsp
from studies.robots import tasks as robots
from vsp.rollouts import collect_episodes, rollout
from vsp.tasks import GOAL, OUTCOMES, PIT, RUNNING, TRUNCATED, Task, simplegoal
from vsp.tasks.gym_adapter import gymnasium_task
from vsp.tasks.registry import BOX, get_task, task_names


def step(state, action):
    """As on arrays, so in Gymnasium."""
    (moved,), (reward,), (outcome,) = simplegoal.step(np.array([state]), np.array([action]))
    env = simplegoal.SimpleGoalEnv()
    env.state = np.array(state)
    seen, *others = env.step(np.array(action))
    assert others == [reward, outcome != RUNNING, False, {"outcome": OUTCOMES[outcome]}]
    assert seen.dtype == np.float32 and np.array_equal(seen, moved.astype(np.float32))
    return moved.tolist(), reward, outcome


# SimpleGoal by hand


def test_a_step_moves_by_a_tenth_and_pays_ten_times_the_distance_gained():
    moved, reward, outcome = step([0.3, 0.4], [0, 0.5])
    assert moved == pytest.approx([0.3, 0.45]) and outcome == RUNNING
    assert reward == pytest.approx(10 * (0.5 - np.hypot(0.3, 0.45)))
    assert step([0.8, 0.0], [-1, 0])[1] == pytest.approx(1.0) and step([0.8, 0.0], [1, 0])[1] == pytest.approx(-1.0)


def test_actions_are_limited_to_one_and_states_to_the_square():
    assert step([0.5, 0.9], [-7, 3])[0] == pytest.approx([0.4, 1.0])
    assert step([0.05, 0.7], [-1, 0])[0] == pytest.approx([0.0, 0.7])


@pytest.mark.parametrize(
    ("state", "action", "outcome", "bonus"),
    [([0.15, 0.05], [-1, 0], GOAL, 10), ([0.3, 0.5], [1.0, 0], RUNNING, 0), ([0.35, 0.5], [1, 0], PIT, -10)],
)
def test_the_reward_of_an_end_replaces_progress(state, action, outcome, bonus):
    moved, reward, found = step(state, action)
    progress = 10 * (np.hypot(*state) - np.hypot(*moved))
    assert found == outcome and reward == pytest.approx(bonus or progress)


@pytest.mark.parametrize(
    ("state", "outcome"),
    [
        ([0.0999, 0.0999], GOAL), ([0.1, 0.05], RUNNING), ([0.05, 0.1], RUNNING), ([0.4, 0.5], RUNNING),
        ([0.6, 0.5], RUNNING), ([0.5, 0.4], RUNNING), ([0.5, 0.6], RUNNING), ([0.4001, 0.5999], PIT),
    ],
)  # fmt: skip
def test_borders_of_goal_and_pit_are_outside(state, outcome):
    assert step(state, [0, 0])[2] == outcome


def test_starts_cover_the_whole_square_evenly():
    starts = simplegoal.start(np.random.default_rng(0), 20_000)
    counts, _, _ = np.histogram2d(*starts.T, bins=5, range=[[0, 1], [0, 1]])
    assert starts.shape == (20_000, 2) and counts.sum() == 20_000 and 680 < counts.min() and counts.max() < 920


# SimpleGoal for Gymnasium


def test_check_env_has_nothing_to_say():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for options in ({}, {"render_mode": "rgb_array"}):
            check_env(gymnasium.make(SIMPLEGOAL, **options).unwrapped)


def test_the_picture_shows_agent_goal_and_pit_in_their_places():
    env = gymnasium.make(SIMPLEGOAL, render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = state = np.array([0.8, 0.9])
    image = env.render()
    height, width, _ = image.shape
    assert image.dtype == np.uint8

    def colour(x, y):
        return tuple(int(c) for c in image[int((1 - y) * height), int(x * width)])

    agent, goal, pit, free = colour(*state), colour(0.05, 0.05), colour(0.5, 0.5), colour(0.95, 0.05)
    assert len({agent, goal, pit, free}) == 4
    assert colour(0.09, 0.09) == goal and colour(0.12, 0.05) == free and colour(0.05, 0.12) == free
    assert colour(0.41, 0.59) == pit and colour(0.38, 0.5) == free and colour(0.5, 0.62) == free
    x, y = np.argwhere((image == agent).all(axis=2)).mean(axis=0)[::-1]
    assert [x / width, 1 - y / height] == pytest.approx(state, abs=0.005)


@pytest.mark.parametrize("action", [[np.nan, 0], [0, 0, 0], 0.5])
def test_a_bad_action_is_refused(action):
    env = simplegoal.SimpleGoalEnv()
    env.reset(seed=0)
    before = env.state.copy()
    with pytest.raises(ValueError, match="expected"):
        env.step(np.array(action))
    assert np.array_equal(env.state, before)


# Batched = Gymnasium


@pytest.mark.parametrize(
    ("name", "low", "high", "most", "ends"),
    [(MOUNTAINCAR, [-1.2, -0.07], [0.6, 0.07], 1e-6, {RUNNING, GOAL}), (PENDULUM, [-9, -8], [9, 8], 1e-12, {RUNNING})],
)
def test_batched_equals_gymnasium_from_anywhere(name, low, high, most, ends):
    """Single steps from all over the box, walls and limits of speed and action included."""
    task, env, rng = get_task(name), gymnasium.make(name).unwrapped, np.random.default_rng(8)
    states, actions = rng.uniform(low, high, size=(3000, 2)), rng.uniform(-3, 3, size=(3000, 1))
    states[:200, 0], states[200:400, 1], states[400:600, 1] = low[0], low[1], high[1]
    moved, rewards, outcomes = task.step(states, actions)
    env.reset(seed=0)
    for i in range(3000):
        env.state = states[i].copy()
        seen, reward, terminated, _, _ = env.step(actions[i])
        assert np.abs(env.state - moved[i]).max() < most and reward == pytest.approx(rewards[i], rel=1e-6, abs=most)
        assert np.abs(seen - task.observe(moved[i : i + 1])[0]).max() < most and terminated == (outcomes[i] == GOAL)
    assert set(outcomes) == ends and np.abs(moved[:, 1]).max() == pytest.approx(high[1])
    if name == MOUNTAINCAR:  # Gymnasium keeps its state in float32 from here on
        assert np.array_equal(moved, moved.astype(np.float32))


def test_pendulum_starts_as_in_gymnasium_and_always_plays_to_the_end():
    task = get_task(PENDULUM)
    starts = task.start(np.random.default_rng(0), 5000)
    assert np.abs(starts).max(axis=0) == pytest.approx([np.pi, 1], abs=2e-3)
    assert starts.mean(axis=0) == pytest.approx([0, 0], abs=0.1)
    result = rollout(RandomPolicy(1), task, starts[:20])
    assert (result.outcomes == TRUNCATED).all() and (result.lengths == 200).all() and (result.returns < -100).all()


# Any environment of Gymnasium


@pytest.mark.parametrize(("name", "failure"), [(LUNARLANDER, -100), (WALKER, -100)])
def test_a_task_with_a_physics_engine_is_gymnasium_step_by_step(name, failure):
    task = get_task(name)
    m = len(task.outputs)
    starts, policy = task.start(np.random.default_rng(0), 6), RandomPolicy(m, seed=3)
    episodes, result = collect_episodes(policy, task, starts), rollout(RandomPolicy(m, seed=3), task, starts)
    for i, episode in enumerate(episodes):
        env = gymnasium.make(name)  # a fresh one, as ours are: after a reset, an engine is not quite as new
        seen, total = [env.reset(seed=int(starts[i, 0]))[0]], 0.0
        for action in episode.actions.astype(np.float32):
            observation, reward, terminated, truncated, _ = env.step(action)
            seen.append(observation)
            total += reward
        assert terminated != truncated and len(episode.actions) == result.lengths[i]
        assert total == pytest.approx(result.returns[i])
        assert np.array_equal(episode.states, np.array(seen[:-1], dtype=np.float64))
        assert result.outcomes[i] == (TRUNCATED if truncated else PIT if reward == failure else GOAL)
    assert len({episode.states[0].tobytes() for episode in episodes}) == 6


class Rescaled(gymnasium.wrappers.RescaleAction):
    """Gymnasium's pendulum, pushed by -1 to 1, which gives up after ten steps."""

    def __init__(self):
        super().__init__(PendulumEnv(), np.float32(-1), np.float32(1))
        self.steps = 0

    def step(self, action):
        self.steps += 1
        seen, reward, ended, _, info = super().step(action)
        return seen, reward, ended, self.steps == 10, info


def test_wrappers_act_and_an_environment_may_cut_off_an_episode(monkeypatch):
    monkeypatch.setattr(gymnasium.envs.registration, "registry", dict(gymnasium.registry))
    gymnasium.register("Rescaled-v0", entry_point=Rescaled, max_episode_steps=100)
    task, own = gymnasium_task("Rescaled-v0"), get_task(PENDULUM)
    live = task.begin(task.start(np.random.default_rng(0), 1))
    moved, expected, _ = own.step(np.array([live[0].env.unwrapped.state]), np.array([[2.0]]))
    _, rewards, _ = task.step(live, np.array([[1.0]]))  # the wrapper makes 2 of it
    assert np.allclose(rewards, expected) and np.allclose(task.observe(live), own.observe(moved))
    found = rollout(RandomPolicy(1), task, task.start(np.random.default_rng(0), 3))
    assert found.lengths.tolist() == [10] * 3 and (found.outcomes == TRUNCATED).all()


def test_a_thousand_starts_of_an_engine_are_a_thousand_seeds():
    assert len(np.unique(vsp.start_states(LUNARLANDER, 1000, seed=0))) == 1000


def test_an_environment_without_a_limit_of_steps_is_refused(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, "Endless-v0", dataclasses.replace(gymnasium.spec(PENDULUM)))
    gymnasium.registry["Endless-v0"].max_episode_steps = None
    with pytest.raises(ValueError, match="Endless-v0 has no step limit, expected one: pass max_episode_steps to gym"):
        gymnasium_task("Endless-v0")


# Registry


@pytest.mark.parametrize("name", [*TASKS, PENDULUM, LUNARLANDER])
def test_the_task_agrees_with_gymnasium(name):
    task, env = get_task(name), gymnasium.make(name)
    assert np.allclose(env.observation_space.low, task.low) and np.allclose(env.observation_space.high, task.high)
    assert np.allclose(env.action_space.low, task.action_low) and np.allclose(env.action_space.high, task.action_high)
    assert env.spec.max_episode_steps == task.max_steps
    assert len(task.inputs) == len(task.input_labels) == len(task.low) and len(task.outputs) == len(task.action_low)
    starts = task.start(np.random.default_rng(0), 100)
    assert starts.shape == (100, task.start_size or len(task.low)) and starts.dtype == np.float64
    seen = task.see(task.begin(starts))
    assert (seen >= task.low).all() and (seen <= task.high).all() and seen.shape == (100, len(task.low))


def test_tasks_by_name():
    assert task_names() == [*TASKS, PENDULUM, LUNARLANDER, WALKER, CHEETAH] == vsp.task_names()
    for name in task_names():
        task = get_task(name)
        assert isinstance(task, Task) and task.name == name and get_task(name) is get_task(task) is task
        assert len({*task.inputs, *task.outputs}) == len(task.low) + len(task.action_low)


@pytest.mark.parametrize(
    ("typo", "near"), [("simplegoal", SIMPLEGOAL), ("MountainCar", MOUNTAINCAR), ("BipedalWalker-v2", WALKER)]
)
def test_an_unknown_task_is_answered_with_the_nearest(typo, near):
    with pytest.raises(ValueError, match=f"unknown task '{typo}', expected one of .*did you mean '{near}'"):
        get_task(typo)
    with pytest.raises(ValueError, match="task is a NoneType, expected a name or a Task"):
        get_task(None)


def test_without_mujoco_one_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(robots, "find_spec", lambda name: None)
    teacher = vsp.load_teacher(CHEETAH)  # acts, and can be read, without an engine
    assert teacher.predict(np.zeros(17))[0].shape == (6,)
    with pytest.raises(ValueError, match="HalfCheetah-v5 needs the package mujoco, which is not inst.*: run `make "):
        vsp.evaluate(teacher, CHEETAH, n_episodes=1, seed=0)


@pytest.mark.skipif(not find_spec("mujoco"), reason="needs mujoco")
def test_the_cheetah_has_the_boxes_of_gymnasium():
    ours = get_task(CHEETAH)
    ours.begin(np.zeros((1, 1)))  # from then on a warning of MuJoCo's writes no file
    theirs = gymnasium_task(CHEETAH)
    for limit in (*BOX, "max_steps"):
        assert np.array_equal(getattr(ours, limit), getattr(theirs, limit))


def test_mujocos_warnings_are_pythons_but_for_the_one_of_every_environment(recwarn):
    robots._warn("compiler attribute 'settotalmass' is deprecated")
    assert not recwarn
    with pytest.warns(RuntimeWarning, match="Nan, Inf or huge value"):
        robots._warn("Nan, Inf or huge value in QACC at DOF 0.")
