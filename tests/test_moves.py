import dataclasses

import numpy as np
import pytest
from support import PENDULUM, SIMPLEGOAL, CurvedTeacher, network_teacher

from vsp import moves
from vsp.config import Refinement
from vsp.envs import get_task
from vsp.evaluate import start_states
from vsp.measure import action_error
from vsp.moves import closest, moved, nearest_two
from vsp.refine import Cells, Labelled, squared_error, squared_errors

SMALL = Refinement(n_cells=3, n_episodes=60, n_restarts=1, n_steps=200, batch_size=128)
LINE = np.array([[0.0], [1.0], [2.0], [9.0]])  # of codewords


def labelled(states, actions):
    states = np.asarray(states, dtype=np.float64)[:, None]
    return Labelled(np.column_stack([states, np.ones(len(states))]), np.asarray(actions, dtype=np.float64)[:, None])


def constants(codewords, values):
    maps = np.zeros((len(values), 2, 1))
    maps[:, 1, 0] = values
    return Cells(np.asarray(codewords, dtype=np.float64), maps)


def test_errors_are_of_limited_actions():
    seen, cells = labelled([0.5, 1.0], [1.0, -0.5]), Cells(LINE[:2], np.array([[[4.0], [0.0]], [[0.0], [-0.5]]]))
    assert squared_errors(seen, cells).tolist() == [[0.0, 2.25], [2.25, 0.0]]


def test_the_two_nearest_by_hand():
    seen = labelled([0.4, 0.6, 6.0, 5.2], np.zeros(4))
    assert nearest_two(seen, constants(LINE, np.zeros(4))).tolist() == [[0, 1, 3, 2], [1, 0, 2, 3]]


def test_the_two_nearest_are_those_of_the_distances():
    rng = np.random.default_rng(0)
    states, cells = rng.normal(size=(200, 4)), Cells(rng.normal(size=(6, 4)), np.zeros((6, 5, 2)))
    seen = Labelled(np.column_stack([states, np.ones(200)]), np.zeros((200, 2)))
    order = np.square(states[:, None] - cells.codewords).sum(axis=2).argsort(axis=1)
    assert np.array_equal(nearest_two(seen, cells), order[:, :2].T)


def test_a_cell_that_is_not_missed_goes_to_where_another_errs(monkeypatch):
    """Cells 0 and 1 say the same, which is right: neither is missed. Cell 3 is wrong at 9.5 alone."""
    monkeypatch.setattr(moves, "SPARE", 1)
    seen = labelled([0.1, 0.9, 2.1, 9.0, 9.5], [0.5, 0.5, -0.5, 0.0, 1.0])
    cells = moved(seen, constants(LINE, [0.5, 0.5, -0.5, 0.0]), np.random.default_rng(0))
    assert cells.codewords.ravel().tolist() == [9.5, 1.0, 2.0, 9.0]
    assert cells.maps[:, 1, 0].tolist() == [0.0, 0.5, -0.5, 0.0]  # and has the map of that one


def test_where_nothing_is_wrong_nothing_moves():
    seen, cells = labelled([0.1, 0.9], [0.5, 0.5]), constants(LINE[:2], [0.5, 0.5])
    assert moved(seen, cells, np.random.default_rng(0)) is cells


def error(policy, teacher, task):
    return action_error(policy, teacher, task, start_states(task, 50, 1), by=teacher)


def test_moves_bring_it_closer(monkeypatch):
    teacher, task = CurvedTeacher(), get_task(SIMPLEGOAL)
    monkeypatch.setattr(moves, "N_MOVES", 0)
    still = [error(closest(teacher, task, SMALL, seed=seed), teacher, task) for seed in range(3)]
    monkeypatch.setattr(moves, "N_MOVES", 15)
    close = [error(closest(teacher, task, SMALL, seed=seed), teacher, task) for seed in range(3)]
    assert np.mean(close) < 0.9 * np.mean(still)


def test_more_beginnings_are_never_worse_on_what_was_seen(monkeypatch):
    monkeypatch.setattr(moves, "N_MOVES", 0)
    losses = []
    monkeypatch.setattr(
        moves, "squared_error", lambda seen, cells: losses.append(squared_error(seen, cells)) or losses[-1]
    )
    config = dataclasses.replace(SMALL, n_restarts=4)
    policy = closest(CurvedTeacher(), SIMPLEGOAL, config, seed=0)
    assert len(set(losses)) == 4 and losses.index(min(losses)) > 0
    assert not np.array_equal(policy.codewords, closest(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=0).codewords)


@pytest.mark.parametrize("change", [{"n_cells": 4}, {"n_episodes": 50}, {"n_steps": 250}, {"batch_size": 64}])
def test_settings_act(monkeypatch, change):
    monkeypatch.setattr(moves, "N_MOVES", 1)
    one, other = (
        closest(CurvedTeacher(), SIMPLEGOAL, config, seed=0) for config in (SMALL, dataclasses.replace(SMALL, **change))
    )
    assert not np.array_equal(one.coefficients, other.coefficients)


def test_the_same_arguments_give_the_same_policy_in_any_dimension(monkeypatch):
    monkeypatch.setattr(moves, "N_MOVES", 2)
    teacher = network_teacher(PENDULUM)
    one, again, other = (closest(teacher, PENDULUM, SMALL, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(one.coefficients, again.coefficients) and one.codewords.shape == (3, 3)
    assert not np.array_equal(one.coefficients, other.coefficients)


def test_one_cell_has_nowhere_to_go():
    with pytest.raises(ValueError, match="n_cells is 1, expected at least 2"):
        closest(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, n_cells=1), seed=0)


def test_bad_seeds_are_refused():
    with pytest.raises(ValueError, match="seed"):
        closest(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=-1)
