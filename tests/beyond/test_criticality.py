import dataclasses

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, CurvedTeacher

from vsp import get_task
from vsp.teachers.teacher import Teacher
from vsp_beyond.few_cells.criticality import Critics


def teacher_with(task=SIMPLEGOAL, m=2, **critics):
    """An actor of m actions that are all 0, and critics that are linear in state and action."""
    actor = {"mu.0.weight": np.zeros((m, 2)), "mu.0.bias": np.zeros(m)}
    parts = {f"{name}.0.weight": np.array([row]) for name, row in critics.items()}
    return Teacher(actor, task, critic=parts | {f"{name}.0.bias": np.zeros(1) for name in critics})


def test_criticality_is_the_value_of_the_own_action_over_that_of_the_worst():
    states = np.array([[0.2, 0.4], [0.5, 0.5], [0.0, 0.0]])
    assert Critics(teacher_with(qf0=[1, 1, 2, -1])).criticality(states) == pytest.approx(3)  # 0 against -2 - 1
    lower = Critics(teacher_with(qf0=[0, 0, 2, -1], qf1=[1, 0, 0, 0]))  # min(0, x) against -3
    assert lower.criticality(states) == pytest.approx(3)
    flat = Critics(teacher_with(qf0=[1, 1, 0, 0]))
    assert np.array_equal(flat.criticality(states), np.zeros(3)) and flat.criticality(states).dtype == np.float64


def test_a_teacher_without_critics_is_refused():
    with pytest.raises(ValueError, match="no critics, expected qf0.0.weight"):
        Critics(teacher_with())
    with pytest.raises(ValueError, match="CurvedTeacher has no critics"):
        Critics(CurvedTeacher())


def test_critics_see_actions_in_units_of_the_action_box():
    task = dataclasses.replace(get_task(MOUNTAINCAR), action_low=np.array([2.0]), action_high=np.array([6.0]))
    assert Critics(teacher_with(task, 1, qf0=[0.0, 0, 1])).criticality(np.zeros((1, 2))).tolist() == [1]  # 0 against -1
