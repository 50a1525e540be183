from dataclasses import replace

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.evaluation import start_states
from vsp.rollouts import rollout, visited_states
from vsp.tasks.base import GOAL, RUNNING
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import load_teacher
from vsp_beyond.optimum import best_policy, best_returns
from vsp_beyond.optimum.grid import Grid, GridPolicy, best_values
from vsp_beyond.optimum.references import TASKS


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
    grid, actions = Grid((0.0, 0.0), (1.0, 1.0), (6, 2)), np.array([-1.0, 0.0, 1.0])
    values = best_values(corridor, grid, actions)
    assert np.allclose(values.reshape(6, 2).T, [0.6, 0.7, 0.8, 0.9, 1.0, 1.0])
    dearer = best_values(corridor, grid, actions, price=0.1)
    assert np.allclose(dearer.reshape(6, 2)[:, 0], [0.1, 0.3, 0.5, 0.7, 0.9, 0.9])
    policy = GridPolicy(corridor, grid, values, actions, lambda seen: seen)
    lost = policy.lost(np.full((3, 2), 0.4), actions[:, None])
    assert np.allclose(lost, [0.2, 0.1, 0.0])


def test_the_shortest_way_earns_the_closed_form():
    starts = np.vstack([start_states(SIMPLEGOAL, 2000, 21), [[0.5, 0.5], [0.09, 0.09], [0.0, 0.0], [1.0, 1.0]]])
    result = rollout(best_policy(SIMPLEGOAL), SIMPLEGOAL, starts)
    assert (result.outcomes == GOAL).all() and result.lengths.max() < 20
    assert np.allclose(result.returns, best_returns(starts), rtol=0, atol=2e-5)


@pytest.mark.parametrize(("task", "gain"), [(MOUNTAINCAR, 5.0), (PENDULUM, 8.0)])
def test_the_best_policy_returns_more_than_the_teacher_by_what_its_actions_lose(task, gain):
    """On a coarse grid, by which some cars come too late."""
    starts, best, teacher = start_states(task, 50, 0), best_policy(task, finer=0.5), load_teacher(task)
    result, own = (rollout(one, task, starts) for one in (best, teacher))
    there = result.lengths < 999
    regret = (result.returns - own.returns)[there].mean()
    assert regret > gain and there.mean() > 0.8
    states = visited_states(teacher, task, starts[there])
    lost = best.lost(states, teacher.predict(states)[0])
    assert lost.min() > -1.0 and lost.sum() / there.sum() == pytest.approx(regret, rel=0.2)


def test_what_has_no_computed_optimum_is_refused():
    with pytest.raises(ValueError, match="not known, expected one of"):
        best_policy("LunarLanderContinuous-v3")
    assert TASKS == (SIMPLEGOAL, MOUNTAINCAR, PENDULUM)
