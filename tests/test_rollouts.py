import dataclasses

import numpy as np
import pytest
from support import SIMPLEGOAL, TASKS, TEACHERS, Constant, same_arrays

import vsp
from vsp import collect_episodes, get_task, rollout, rollouts, visited_states


def test_visited_states_by_hand():
    """Down the diagonal, episode by episode, the goal itself not acted in."""
    states = visited_states(Constant(-1.0, -1.0), SIMPLEGOAL, np.array([[0.25, 0.25], [0.15, 0.05]]))
    assert np.allclose(states, [[0.25, 0.25], [0.15, 0.15], [0.15, 0.05]])


@pytest.mark.parametrize("task", TASKS)
def test_playing_and_recording_agree_and_an_episode_is_the_same_by_itself(task):
    player, task = TEACHERS[task], get_task(task)
    starts = task.start(np.random.default_rng(0), 40)
    result, episodes = rollout(player, task, starts), collect_episodes(player, task, starts)
    assert [len(e.states) for e in episodes] == [len(e.actions) for e in episodes] == result.lengths.tolist()
    assert np.allclose([e.states[0] for e in episodes], starts, atol=1e-7)
    assert {array.dtype for e in episodes for array in (e.states, e.actions)} == {np.dtype(np.float64)}
    for i in (0, 17, 39):
        single, (episode,) = (call(player, task, starts[i : i + 1]) for call in (rollout, collect_episodes))
        assert (single.returns[0], single.lengths[0]) == (result.returns[i], result.lengths[i])
        assert same_arrays((episode.states, episodes[i].states), (episode.actions, episodes[i].actions))


def test_the_policy_gets_float32_of_the_episodes_that_still_run():
    batches, starts = [], np.array([[0.25, 0.05], [0.65, 0.5], [0.15, 0.05]])

    class Spy(Constant):
        def predict(self, obs):
            batches.append((obs.dtype, len(obs)))
            return super().predict(obs)

    episodes = rollouts.collect_episodes(Spy(-1.0, 0.0), SIMPLEGOAL, starts)
    assert batches == [(np.float32, 3), (np.float32, 1)]
    assert np.array_equal(episodes[0].states[0], starts[0].astype(np.float32).astype(np.float64))


def test_a_constant_variable_keeps_its_unit():
    """The standard deviation of a thousand times 0.1 is a rounding error above 0."""
    states = np.column_stack([np.full(1000, 0.1), np.arange(1000.0)])
    assert states[:, 0].std() > 0 and rollouts.standard(states)[1].tolist() == [1.0, states[:, 1].std()]


def test_rewards_that_are_no_numbers_are_one_clear_error():
    plain = get_task(SIMPLEGOAL)

    def step(states, actions):
        moved, rewards, outcomes = plain.step(states, actions)
        return moved, np.full_like(rewards, np.nan), outcomes

    task = dataclasses.replace(plain, name="Broken", step=step)
    with pytest.raises(ValueError, match="rewards of Broken .*nan.*expected finite"):
        vsp.evaluate(Constant(-1.0, -1.0), task, 3, seed=0)
