import dataclasses
import importlib

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, PumpingTeacher
from test_tuned import SMALL

from vsp import VoronoiPolicy, get_task, start_states
from vsp.rollouts import rollout
from vsp_beyond.few_cells.simplification import gathered, prune, rounded, simplify
from vsp_beyond.few_cells.tune import score

module = importlib.import_module("vsp_beyond.few_cells.simplification")
CONFIG = dataclasses.replace(SMALL, n_restarts=1, n_generations=2)


def some(codewords=((0.12345, 0.5), (0.75, 0.5))):
    coefficients = np.array([[[0.5, -2.0], [0.001, 3.0], [0.1, 0.0]], [[1.0, 1.0], [1.0, 1.0], [1.0, 0.25]]])
    return VoronoiPolicy(np.array(codewords), coefficients, task=SIMPLEGOAL, scale=np.array([0.1, 2.0]))


# Nearer codewords


def far(k, task):
    """k codewords far off whose borders run among the states."""
    task, rng = get_task(task), np.random.default_rng(0)
    d, m = len(task.low), len(task.action_low)
    around = rng.normal(size=(k, d))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    coefficients, scale = rng.normal(size=(k, d + 1, m)), np.linspace(0.5, 1.0, d)
    return VoronoiPolicy((0.1 + 50.0 * around) * scale, coefficients, task=task, metric="euclidean", scale=scale)


@pytest.mark.parametrize(("task", "k"), [(SIMPLEGOAL, 2), (PENDULUM, 3), (PENDULUM, 4)])
def test_codewords_come_nearer_and_no_border_moves(task, k):
    policy = far(k, task)
    states = np.random.default_rng(1).uniform(-1, 1, size=(5000, len(policy.scale)))
    near = gathered(policy, states)
    assert np.array_equal(near.cells(states), policy.cells(states)) and len(np.unique(near.cells(states))) > 1
    assert np.abs(near.codewords).max() < 0.1 * np.abs(policy.codewords).max()
    assert np.array_equal(near.coefficients, policy.coefficients) and np.array_equal(near.scale, policy.scale)
    gaps = near.codewords / near.scale
    assert np.linalg.norm(gaps - gaps[0], axis=1).max() > 0.3  # and do not meet
    assert (gathered(policy, states[:1]).cells(states) == policy.cells(states)).all()  # around a single state


def test_two_codewords_by_hand():
    """The border is x = 0.5; the states lie about (0.5, 0.5) with deviation 0.1."""
    states = np.array([[0.4, 0.4], [0.6, 0.6], [0.4, 0.6], [0.6, 0.4]])
    policy = VoronoiPolicy([[-9.5, 3.0], [10.5, 3.0]], np.zeros((2, 3, 2)), task=SIMPLEGOAL, metric="euclidean")
    assert gathered(policy, states).codewords == pytest.approx(np.array([[0.4, 0.5], [0.6, 0.5]]))


LINE = VoronoiPolicy([[0, 0], [1, 1], [3, 3]], np.zeros((3, 3, 2)), task=SIMPLEGOAL, metric="euclidean")


@pytest.mark.parametrize("policy", [far(4, SIMPLEGOAL), LINE])
def test_where_borders_have_no_common_point_nothing_moves(policy):
    assert gathered(policy, np.random.default_rng(0).random((50, 2))) is policy


# Pruning and rounding


def test_what_matters_least_goes_first():
    """In units of what an input does when it moves by one scale: 0.001 * 2 before 0.5 * 0.1 before 0.1 * 1."""
    asked = []
    prune(some(), lambda policy: asked.append(np.flatnonzero(policy.coefficients == 0).tolist()) or False)
    assert asked[:3] == [[2, 5], [0, 5], [4, 5]] and len(asked) == 11  # 5, which is zero, is not asked for


def test_pruning_keeps_what_is_needed():
    needed = {(0, 0, 1), (1, 1, 0)}
    bare = prune(some(), lambda policy: all(policy.coefficients[place] for place in needed))
    assert set(zip(*(axis.tolist() for axis in np.nonzero(bare.coefficients)))) == needed
    assert bare.coefficients[0, 0, 1] == -2.0 and np.array_equal(bare.codewords, some().codewords)


def test_rounding_by_hand():
    short = rounded(some([[0.12345, 0.5], [0.75, 1234.5]]), 2)
    assert short.codewords.tolist() == [[0.12, 0.5], [0.75, 1200.0]] and short.scale.tolist() == [0.1, 2.0]
    assert short.coefficients[1, 2].tolist() == [1.0, 0.25] and rounded(some(), 1).coefficients[1, 2, 1] == 0.2
    close = some([[0.501, 0.5], [0.502, 0.5]])  # it does not make two cells one
    assert rounded(close, 2) is None and len(rounded(close, 3)) == 2


# All of it


def test_it_returns_within_the_tolerance_by_stages_in_order():
    teacher = PumpingTeacher()
    policy, tried = simplify(teacher, MOUNTAINCAR, CONFIG, tolerance=5.0, seed=1)
    starts = start_states(policy.task, 100, 1)
    result, of_teacher = (rollout(actor, policy.task, starts) for actor in (policy, teacher))
    assert score(result, 100.0) >= score(of_teacher, 100.0) - 5.0
    last = tried[tried["kept"]].iloc[-1]
    assert (last["cells"], last["nonzero"]) == (len(policy), np.count_nonzero(policy.coefficients))
    assert last["mean"] == pytest.approx(result.returns.mean())
    assert list(dict.fromkeys(tried["stage"])) == ["cells", "prune", "round"]
    for stage, column in (("cells", "cells"), ("round", "digits")):  # from the smallest on, to the first that suffices
        rows = tried[tried["stage"] == stage]
        assert rows[column].tolist() == list(range(1, len(rows) + 1)) and not rows["kept"][:-1].any()
    assert (tried.loc[tried["stage"] != "round", "digits"] == 0).all()
    for values in (policy.codewords, policy.coefficients, policy.scale):
        assert all(float(f"{value:.{tried['digits'].iloc[-1]}g}") == value for value in values.flat)


def gain(value, k=1):
    """Push so many times the velocity, in k cells that do not differ."""
    coefficients = np.tile([[[0.0], [value], [0.0]]], (k, 1, 1))
    return VoronoiPolicy(np.arange(2.0 * k).reshape(k, 2), coefficients, task=MOUNTAINCAR)


def simplified(monkeypatch, policies, tolerance):
    """Where tuning gives these policies, by the number of cells."""
    monkeypatch.setattr(module, "distill_tuned", lambda *given, seed: (policies[given[2].n_cells], None))
    return simplify(gain(12.0), MOUNTAINCAR, CONFIG, tolerance=tolerance, seed=0)


def test_where_no_number_of_cells_will_do_the_best_goes_on(monkeypatch):
    policy, tried = simplified(monkeypatch, {1: gain(100.0), 2: gain(40.0, 2), 3: gain(80.0, 3)}, tolerance=0.0)
    cells = tried[tried["stage"] == "cells"]
    assert not cells["kept"].any() and cells["mean"].idxmax() == 1 and len(cells) == 3
    assert len(policy) == 2 and np.count_nonzero(policy.coefficients) <= 2
    assert (tried.loc[tried["kept"], "mean"] >= cells["mean"][1]).all()


def test_the_tolerance_is_spent_once(monkeypatch):
    """The first size costs most of it. One digit, 20 for 16, would cost more than the rest."""
    policy, tried = simplified(monkeypatch, {1: gain(16.0)}, tolerance=1.5)
    starts = start_states(policy.task, CONFIG.n_validation, 0)
    teacher, size, digit = (rollout(gain(g), policy.task, starts).returns.mean() for g in (12.0, 16.0, 20.0))
    assert size - 1.5 < digit < teacher - 1.5 < size
    assert policy.coefficients[0, 1, 0] == 16.0 and tried["digits"].iloc[-1] == 2
