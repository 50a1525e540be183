import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, CurvedTeacher, PumpingTeacher

from vsp import evaluate, rollout, start_states
from vsp.tasks import OUTCOMES


def test_start_states_repeat_and_the_first_ones_stay():
    assert np.array_equal(start_states(SIMPLEGOAL, 50, 1), start_states(SIMPLEGOAL, 50, 1))
    assert not np.array_equal(start_states(SIMPLEGOAL, 50, 1), start_states(SIMPLEGOAL, 50, 2))
    assert np.array_equal(start_states(SIMPLEGOAL, 10, 1), start_states(SIMPLEGOAL, 50, 1)[:10])


@pytest.mark.parametrize(("task", "player"), [(SIMPLEGOAL, CurvedTeacher()), (MOUNTAINCAR, PumpingTeacher())])
def test_evaluate_is_a_row_per_episode(task, player):
    frame, result = evaluate(player, task, n_episodes=60, seed=3), rollout(player, task, start_states(task, 60, 3))
    assert frame.columns.tolist() == ["return", "length", "outcome"] and frame.index.tolist() == list(range(60))
    assert np.array_equal(frame["return"], result.returns) and np.array_equal(frame["length"], result.lengths)
    assert frame["outcome"].tolist() == [OUTCOMES[code] for code in result.outcomes]
    assert frame.equals(evaluate(player, task, n_episodes=60, seed=3))
