import numpy as np
import pytest
from support import SIMPLEGOAL, CurvedTeacher

from studies.comparison import measure
from studies.comparison.measure import common_states, fidelity
from studies.comparison.sameness import sameness
from vsp.policy import VoronoiPolicy
from vsp.tasks.registry import get_task

TASK = get_task(SIMPLEGOAL)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(measure, "N_REPORTED", 200)
    monkeypatch.setattr(measure, "N_COMMON", 500)


def constants(codewords, actions):
    """A policy with one action per cell."""
    maps = np.zeros((len(codewords), 3, 2))
    maps[:, 2] = actions
    return VoronoiPolicy(codewords, maps, task=TASK)


def test_the_same_cells_in_another_order_are_the_same():
    left, right = [0.2, 0.5], [0.8, 0.5]
    one, turned = constants([left, right], [[0, 0], [1, 1]]), constants([right, left], [[1, 1], [0, 0]])
    (row,) = sameness({3: one, 5: turned}, CurvedTeacher(), TASK).to_dict("records")
    assert row == {"seed": 3, "other": 5, "index": 1.0, "ratio": 0.0}


def test_other_cells_and_actions_by_hand():
    left, right, below, above = [0.2, 0.5], [0.8, 0.5], [0.5, 0.2], [0.5, 0.8]
    one, other = constants([left, right], [[0, 0], [0, 0]]), constants([below, above], [[0, 0], [1, 0]])
    teacher = constants([[0.5, 0.5]], [[0.0, 1.0]])
    (row,) = sameness({0: one, 1: other}, teacher, TASK).to_dict("records")
    upper = (common_states(teacher, TASK)[:, 1] > 0.5).mean()
    # Squared differences, summed over both actions: 1 in the upper half between the two; 1, and 1 more there, to it
    assert row["ratio"] == pytest.approx(np.sqrt(upper) / (0.5 * (1 + np.sqrt(1 + upper)))) and row["index"] < 0.5


def test_one_cell_has_no_index():
    single = constants([[0.5, 0.5]], [[0, 0]])
    rows = sameness(
        {0: single, 1: constants([[0.2, 0.5], [0.8, 0.5]], [[0, 0], [1, 1]]), 2: single}, CurvedTeacher(), TASK
    )
    assert rows["index"].isna().all() and rows["ratio"].tolist()[1] == 0.0 and len(rows) == 3


def test_fidelity_by_hand():
    teacher = constants([[0.2, 0.5], [0.8, 0.5]], [[0.5, 0.4], [-0.5, 0.4]])
    states = common_states(teacher, TASK)
    wanted = teacher.predict(states)[0]
    assert fidelity(teacher, teacher, TASK)["r2"] == 1.0 and states.shape == (500, 2)
    mean = constants([[0.5, 0.5]], [wanted.mean(axis=0)])
    found = fidelity(mean, teacher, TASK)  # its second action never varies
    assert found["r2"] == pytest.approx(0.0) == found["r2_worst"] and found["off"] == 1.0


def test_the_worst_coordinate_is_told():
    teacher = constants([[0.2, 0.5], [0.8, 0.5]], [[0.8, 0.1], [-0.8, -0.1]])
    half = constants([[0.2, 0.5], [0.8, 0.5]], [[0.8, 0.0], [-0.8, 0.0]])
    found = fidelity(half, teacher, TASK)
    assert found["r2"] > 0.9 and found["r2_worst"] < 0.2 and found["off"] == 0.0


def test_the_common_states_are_fresh_and_the_same_for_all():
    one, again = (common_states(CurvedTeacher(), TASK) for _ in range(2))
    assert np.array_equal(one, again)
