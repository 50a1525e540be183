import dataclasses
import importlib

import numpy as np
import pytest
from support import PENDULUM, SIMPLEGOAL, CurvedTeacher, network_teacher

from studies.comparison.imitate import imitate, nearest_two, relocate
from studies.comparison.measure import action_error
from vsp.evaluation import start_states
from vsp.tasks.registry import get_task
from vsp_beyond.few_cells.anneal import squared_error, squared_errors
from vsp_beyond.few_cells.config import Tuned
from vsp_beyond.few_cells.units import Cells, LabelledStates

module = importlib.import_module("studies.comparison.imitate")  # not the function
SMALL = Tuned(n_cells=3, n_episodes=60, n_restarts=1, n_steps=200, batch_size=128)
LINE = np.array([[0.0], [1.0], [2.0], [9.0]])  # of codewords


def labelled(states, actions):
    states = np.asarray(states, dtype=np.float64)[:, None]
    return LabelledStates(np.column_stack([states, np.ones(len(states))]), np.array(actions, dtype=np.float64)[:, None])


def constants(codewords, values):
    maps = np.zeros((len(values), 2, 1))
    maps[:, 1, 0] = values
    return Cells(np.asarray(codewords, dtype=np.float64), maps)


def test_errors_are_of_limited_actions():
    seen, cells = labelled([0.5, 1.0], [1.0, -0.5]), Cells(LINE[:2], np.array([[[4.0], [0.0]], [[0.0], [-0.5]]]))
    assert squared_errors(seen, cells).tolist() == [[0.0, 2.25], [2.25, 0.0]]


def test_the_two_nearest_are_those_of_the_distances():
    rng = np.random.default_rng(0)
    states, cells = rng.normal(size=(200, 4)), Cells(rng.normal(size=(6, 4)), np.zeros((6, 5, 2)))
    seen = LabelledStates(np.column_stack([states, np.ones(200)]), np.zeros((200, 2)))
    order = np.square(states[:, None] - cells.codewords).sum(axis=2).argsort(axis=1)
    assert np.array_equal(nearest_two(seen, cells), order[:, :2].T)


def test_a_cell_that_is_not_needed_goes_to_where_another_errs(monkeypatch):
    """Cells 0 and 1 have the same map, which is right: neither is needed. Cell 3 is wrong at 9.5 alone."""
    monkeypatch.setattr(module, "SPARE", 1)
    seen = labelled([0.1, 0.9, 2.1, 9.0, 9.5], [0.5, 0.5, -0.5, 0.0, 1.0])
    cells = relocate(seen, constants(LINE, [0.5, 0.5, -0.5, 0.0]), np.random.default_rng(0))
    assert cells.codewords.ravel().tolist() == [9.5, 1.0, 2.0, 9.0]
    assert cells.coefficients[:, 1, 0].tolist() == [0.0, 0.5, -0.5, 0.0]  # and has the map of that one


def test_where_nothing_is_wrong_nothing_moves():
    seen, cells = labelled([0.1, 0.9], [0.5, 0.5]), constants(LINE[:2], [0.5, 0.5])
    assert relocate(seen, cells, np.random.default_rng(0)) is cells


def error(policy, teacher, task):
    return action_error(policy, teacher, task, start_states(task, 50, 1), by=teacher)


def test_relocations_lower_the_error(monkeypatch):
    teacher, task = CurvedTeacher(), get_task(SIMPLEGOAL)
    monkeypatch.setattr(module, "N_MOVES", 0)
    still = [error(imitate(teacher, task, SMALL, seed=seed), teacher, task) for seed in range(3)]
    monkeypatch.setattr(module, "N_MOVES", 15)
    close = [error(imitate(teacher, task, SMALL, seed=seed), teacher, task) for seed in range(3)]
    assert np.mean(close) < 0.9 * np.mean(still)


def test_more_restarts_are_never_worse_on_what_was_seen(monkeypatch):
    monkeypatch.setattr(module, "N_MOVES", 0)
    losses = []
    monkeypatch.setattr(module, "squared_error", lambda *given: losses.append(squared_error(*given)) or losses[-1])
    config = dataclasses.replace(SMALL, n_restarts=4)
    policy = imitate(CurvedTeacher(), SIMPLEGOAL, config, seed=0)
    assert len(set(losses)) == 4 and losses.index(min(losses)) > 0
    assert not np.array_equal(policy.codewords, imitate(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=0).codewords)


@pytest.mark.parametrize("change", [{"n_cells": 4}, {"n_episodes": 50}, {"n_steps": 250}, {"batch_size": 64}])
def test_settings_act(monkeypatch, change):
    monkeypatch.setattr(module, "N_MOVES", 1)
    settings = SMALL, dataclasses.replace(SMALL, **change)
    one, other = (imitate(CurvedTeacher(), SIMPLEGOAL, config, seed=0) for config in settings)
    assert not np.array_equal(one.coefficients, other.coefficients)


def test_the_same_arguments_give_the_same_policy_in_any_dimension(monkeypatch):
    monkeypatch.setattr(module, "N_MOVES", 2)
    teacher = network_teacher(PENDULUM)
    one, again, other = (imitate(teacher, PENDULUM, SMALL, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(one.coefficients, again.coefficients) and one.codewords.shape == (3, 3)
    assert not np.array_equal(one.coefficients, other.coefficients)


def test_one_cell_has_nowhere_to_go():
    with pytest.raises(ValueError, match="n_cells is 1, expected at least 2"):
        imitate(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, n_cells=1), seed=0)
