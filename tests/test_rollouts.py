import dataclasses

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, Constant, CurvedTeacher, PumpingTeacher, same_arrays

from vsp import paper
from vsp.envs import GOAL, PIT, TRUNCATED, get_task
from vsp.rollouts import play, record, visited

PLAYERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}


def test_three_episodes_by_hand():
    """Left by a tenth per step: into the goal after 2 steps, into the pit after 1, against the wall for 50."""
    starts = np.array([[0.25, 0.05], [0.65, 0.5], [0.25, 0.95]])
    result = play(Constant(-1.0, 0.0), get_task(SIMPLEGOAL), starts)
    assert result.lengths.tolist() == [2, 1, 50] and result.codes.tolist() == [GOAL, PIT, TRUNCATED]
    first_step = 10 * (np.hypot(0.25, 0.05) - np.hypot(0.15, 0.05))
    to_the_wall = 10 * (np.hypot(0.25, 0.95) - 0.95)
    assert result.returns == pytest.approx([first_step + 10, -10, to_the_wall])


def test_recorded_episodes_by_hand():
    starts = np.array([[0.25, 0.05], [0.65, 0.5]])
    first, second = record(Constant(-1.0, 0.125), get_task(SIMPLEGOAL), starts)
    assert np.allclose(first.states, [[0.25, 0.05], [0.15, 0.0625]]) and np.allclose(second.states, [[0.65, 0.5]])
    assert first.actions.tolist() == [[-1, 0.125]] * 2 and second.actions.tolist() == [[-1, 0.125]]
    assert first.states.dtype == first.actions.dtype == np.float64


def test_visited_states_by_hand():
    """Down the diagonal, episode by episode, the goal itself not acted in."""
    states = visited(Constant(-1.0, -1.0), get_task(SIMPLEGOAL), np.array([[0.25, 0.25], [0.15, 0.05]]))
    assert np.allclose(states, [[0.25, 0.25], [0.15, 0.15], [0.15, 0.05]])


@pytest.mark.parametrize("task", TASKS)
def test_playing_and_recording_agree_and_an_episode_is_the_same_alone(task):
    player, task = PLAYERS[task], get_task(task)
    starts = task.start(np.random.default_rng(0), 40)
    result, episodes = play(player, task, starts), record(player, task, starts)
    assert [len(e.states) for e in episodes] == [len(e.actions) for e in episodes] == result.lengths.tolist()
    assert np.allclose([e.states[0] for e in episodes], starts, atol=1e-7)
    for i in (0, 17, 39):
        alone, one = play(player, task, starts[i : i + 1]), record(player, task, starts[i : i + 1])[0]
        assert (alone.returns[0], alone.lengths[0]) == (result.returns[i], result.lengths[i])
        assert same_arrays((one.states, episodes[i].states), (one.actions, episodes[i].actions))


@pytest.mark.parametrize("task", TASKS)
def test_the_policy_sees_float32_and_the_state_stays_as_exact_as_the_environment_keeps_it(task):
    seen = []

    class Spy:
        def predict(self, obs):
            seen.append(obs.copy())
            return PLAYERS[task].predict(obs)

    starts = get_task(task).start(np.random.default_rng(0), 3)
    episodes = record(Spy(), get_task(task), starts)
    assert all(obs.dtype == np.float32 for obs in seen)
    assert np.array_equal(episodes[0].states[0], starts[0].astype(np.float32).astype(np.float64))


def test_finished_episodes_are_not_asked_again():
    asked = []

    class Spy(Constant):
        def predict(self, obs):
            asked.append(len(obs))
            return super().predict(obs)

    play(Spy(-1.0, 0.0), get_task(SIMPLEGOAL), np.array([[0.25, 0.05], [0.65, 0.5], [0.15, 0.05]]))
    assert asked == [3, 1]


def test_max_steps_truncates():
    short = dataclasses.replace(get_task(MOUNTAINCAR), max_steps=5)
    result = play(Constant(0.0), short, np.array([[-0.5, 0.0]]))
    assert result.lengths.tolist() == [5] and result.codes.tolist() == [TRUNCATED]


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ([[0.1, 0.2, 0.3]], r"start states have shape \(1, 3\), expected \(n, 2\)"),
        ([0.1, 0.2], r"start states have shape \(2,\), expected \(n, 2\)"),
        ([[0.1, np.nan]], r"start states hold nan at index \(0, 1\)"),
        ([[-np.inf, 0]], r"start states hold -inf"),
        ([["a", "b"]], "start states have type <U1, expected numbers"),
        (np.array([[0.1, None]]), "start states have type object"),
        (np.array([[1j, 0]]), "start states have type complex128"),
    ],
)
@pytest.mark.parametrize("run", [play, record])
def test_bad_starts_are_one_clear_error(run, starts, message):
    with pytest.raises(ValueError, match=message):
        run(Constant(0.0, 0.0), get_task(SIMPLEGOAL), starts)


@pytest.mark.parametrize(
    ("player", "message"),
    [
        (Constant(0.0), r"actions have shape \(1, 1\), expected \(1, 2\) for SimpleGoal-v0"),
        (Constant(0.0, np.nan), r"actions hold nan at index \(0, 1\)"),
        (Constant(np.inf, 0.0), r"actions hold inf at index \(0, 0\)"),
        (Constant("up", "down"), "actions have type <U4, expected numbers"),
    ],
)
def test_bad_actions_are_one_clear_error(player, message):
    with pytest.raises(ValueError, match=message):
        play(player, get_task(SIMPLEGOAL), np.array([[0.9, 0.9]]))


def test_a_policy_that_fails_is_named_with_the_task():
    class Failing:
        def predict(self, obs):
            raise ValueError("operands could not be broadcast")

    with pytest.raises(ValueError, match="the policy fails on the 2 inputs of SimpleGoal-v0: operands"):
        play(Failing(), get_task(SIMPLEGOAL), np.array([[0.9, 0.9]]))


@pytest.mark.parametrize("start", [[5.0, 0.5], [0.5, -0.01]])
def test_starts_outside_the_box_are_refused(start):
    task = get_task(SIMPLEGOAL)
    with pytest.raises(ValueError, match=r"start state \[.*\] lies outside the box of SimpleGoal-v0, \[0.0, 0.0\] to"):
        play(paper.published_policy(SIMPLEGOAL), task, np.array([[0.5, 0.5], start]))
