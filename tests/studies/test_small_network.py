import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, examples

from studies.rivals.small_network import SmallNetwork, units_for
from vsp import get_task


@pytest.mark.parametrize("task", TASKS)
def test_it_fits_what_a_linear_map_cannot(task):
    states, _ = examples(task)
    box = get_task(task)
    middle, width = 0.5 * (box.low + box.high), box.high - box.low
    actions = np.tanh(8 * ((states - middle) / width) @ np.ones((2, len(box.action_low))))
    network = SmallNetwork(states, actions, units=3, task=task, seed=0)
    assert np.abs(network.predict(states)[0] - actions).max() < 0.05
    assert [weights.shape for weights, _ in network.layers] == [(2, 3), (3, actions.shape[1])]


def test_actions_stay_in_the_box_and_the_seed_decides(monkeypatch):
    monkeypatch.setattr(SmallNetwork, "ITERATIONS", 20)
    states, actions = examples(SIMPLEGOAL)
    one, again, other = (SmallNetwork(states, 3 * actions, units=2, task=SIMPLEGOAL, seed=s) for s in (1, 1, 2))
    found = one.predict(states)[0]
    assert np.abs(found).max() == 1.0 and np.array_equal(found, again.predict(states)[0])
    assert not np.array_equal(found, other.predict(states)[0])


def test_as_many_units_as_numbers_allow():
    """A unit has two weights, a bias, and a weight to each action; each action has a bias. A cell has six numbers on
    SimpleGoal, three on MountainCar, and two of its codeword; two more scale the states."""
    assert [units_for(k, get_task(SIMPLEGOAL)) for k in (1, 2, 4)] == [1, 3, 6]  # of 6, 18 and 34 numbers
    assert units_for(3, get_task(MOUNTAINCAR)) == 4  # of 17
