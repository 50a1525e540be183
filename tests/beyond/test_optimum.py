from dataclasses import replace

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.beyond.optimum import best_policy, best_returns
from vsp.beyond.optimum.grid import Grid, best_values, best_values_in
from vsp.beyond.optimum.references import _SOLVABLE, TASKS
from vsp.evaluation import start_states
from vsp.rollouts import rollout
from vsp.tasks.base import GOAL, RUNNING
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import load_teacher


def test_between_points_values_are_interpolated():
    """A bilinear function is met exactly, inside and at the ends; a circle has no ends."""
    rng, grid = np.random.default_rng(0), Grid((-1.0, 0.0), (2.0, 5.0), (7, 11))
    states = np.vstack([rng.uniform(grid.low, grid.high, (50, 2)), grid.low, grid.high])
    here, there = (2.0 + 3.0 * x[:, 0] - x[:, 1] + 0.5 * x.prod(axis=1) for x in (grid.points(), states))
    for found in (grid.interpolation(states) @ here, grid.at(states, here)):
        assert np.allclose(found, there, rtol=0, atol=1e-12)
    circle = Grid((0.0, 0.0), (8.0, 1.0), (8, 2), periodic=(True, False))
    assert circle.interpolation(np.array([[7.5, 0.0]])).toarray()[0, [14, 0]].tolist() == [0.5, 0.5]


def test_a_finer_grid_keeps_its_points():
    for grid in (Grid((0.0, 0.0), (1.0, 1.0), (5, 3)), Grid((0.0, 0.0), (1.0, 1.0), (4, 3), (True, False))):
        fine = grid.finer(2)
        assert {tuple(point) for point in grid.points()} < {tuple(point) for point in fine.points()}
        assert grid.finer(1) == grid


def test_values_by_hand():
    """A corridor of steps of a fifth, at a tenth each, with 1 at its end."""

    def step(states, actions):
        moved = states + np.column_stack([0.2 * actions[:, 0], np.zeros(len(states))])
        there = moved[:, 0] > 0.99
        return np.clip(moved, 0.0, 1.0), np.where(there, 1.0, -0.1), np.where(there, GOAL, RUNNING)

    corridor = replace(get_task(MOUNTAINCAR), step=step)
    values = best_values(corridor, Grid((0.0, 0.0), (1.0, 1.0), (6, 2)), np.array([-1.0, 0.0, 1.0]))
    assert np.allclose(values.reshape(6, 2).T, [0.6, 0.7, 0.8, 0.9, 1.0, 1.0])
    soon = best_values_in(2, corridor, Grid((0.0, 0.0), (1.0, 1.0), (6, 2)), np.array([-1.0, 0.0, 1.0]))
    assert np.allclose(soon.reshape(6, 2)[:, 1], [-0.2, -0.2, -0.2, 0.9, 1.0, 1.0])
    dearer = best_values(corridor, Grid((0.0, 0.0), (1.0, 1.0), (6, 2)), np.array([-1.0, 0.0, 1.0]), price=0.1)
    assert np.allclose(dearer.reshape(6, 2)[:, 0], [0.1, 0.3, 0.5, 0.7, 0.9, 0.9])


def test_the_shortest_way_earns_the_closed_form():
    starts = np.vstack([start_states(SIMPLEGOAL, 2000, 21), [[0.5, 0.5], [0.09, 0.09], [0.0, 0.0], [1.0, 1.0]]])
    result = rollout(best_policy(SIMPLEGOAL), SIMPLEGOAL, starts)
    assert (result.outcomes == GOAL).all() and result.lengths.max() < 20
    assert np.allclose(result.returns, best_returns(starts), rtol=0, atol=2e-5)


@pytest.mark.parametrize(("task", "gain"), [(MOUNTAINCAR, 5.0), (PENDULUM, 8.0)])
def test_the_best_policy_returns_what_its_values_say_and_more_than_the_teacher(task, gain):
    """On a coarse grid, by which some cars come too late."""
    starts, best, about = start_states(task, 50, 0), best_policy(task, finer=0.5), _SOLVABLE[task]
    result, own = (rollout(one, task, starts) for one in (best, load_teacher(task)))
    said = best._grid.at(starts, best._values) + about.price * result.lengths
    there = result.lengths < 999
    assert abs((result.returns - said)[there].mean()) < 0.02 * abs(said.mean()) and there.mean() > 0.8
    assert result.returns[there].mean() > own.returns[there].mean() + gain


def test_what_has_no_computed_optimum_is_refused():
    with pytest.raises(ValueError, match="not known, expected one of"):
        best_policy("LunarLanderContinuous-v3")
    assert TASKS == (SIMPLEGOAL, MOUNTAINCAR, PENDULUM)
