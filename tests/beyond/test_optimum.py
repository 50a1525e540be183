from dataclasses import replace

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp import load_teacher, start_states
from vsp.rollouts import rollout, visited_states
from vsp.tasks import GOAL, RUNNING, get_task
from vsp_beyond.optimum import PENDULUM_REGIONS, TASKS, best_policy, best_returns, losses
from vsp_beyond.optimum.grid import Grid, GridPolicy, best_values


def test_between_points_values_are_interpolated():
    """A bilinear function is met exactly, inside and at the ends; a circle has no ends."""
    rng, grid = np.random.default_rng(0), Grid((-1.0, 0.0), (2.0, 5.0), (7, 11))
    states = np.vstack([rng.uniform(grid.low, grid.high, (50, 2)), grid.low, grid.high])
    here, there = (2.0 + 3.0 * x[:, 0] - x[:, 1] + 0.5 * x.prod(axis=1) for x in (grid.points(), states))
    assert np.allclose(grid.interpolation(states) @ here, there, rtol=0, atol=1e-12)
    circle = Grid((0.0, 0.0), (8.0, 1.0), (8, 2), periodic=(True, False))
    assert circle.interpolation(np.array([[7.5, 0.0]])).toarray()[0, [14, 0]].tolist() == [0.5, 0.5]


def test_a_finer_grid_keeps_its_points():
    for grid in (Grid((0.0, 0.0), (1.0, 1.0), (5, 3)), Grid((0.0, 0.0), (1.0, 1.0), (4, 3), (True, False))):
        coarse, fine = ({tuple(point) for point in grid.finer(times).points()} for times in (1, 2))
        assert coarse < fine and grid.finer(1) == grid


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
    policy = GridPolicy(corridor, grid, values, actions, lambda obs: obs)
    assert np.allclose(policy.lost(np.full((3, 2), 0.4), actions[:, None]), [0.2, 0.1, 0.0])


def test_the_shortest_way_earns_the_closed_form():
    starts = np.vstack([start_states(SIMPLEGOAL, 2000, 21), [[0.5, 0.5], [0.09, 0.09], [0.0, 0.0], [1.0, 1.0]]])
    result = rollout(best_policy(SIMPLEGOAL), SIMPLEGOAL, starts)
    assert (result.outcomes == GOAL).all() and result.lengths.max() < 20
    assert np.allclose(result.returns, best_returns(starts), rtol=0, atol=2e-5)


def test_the_best_policy_returns_more_than_the_teacher_by_what_its_actions_lose():
    """On a coarse grid, by which some cars come too late."""
    best, teacher = best_policy(MOUNTAINCAR, finer=0.5), load_teacher(MOUNTAINCAR)
    starts = start_states(MOUNTAINCAR, 50, 0)
    of_best, of_teacher = (rollout(policy, MOUNTAINCAR, starts) for policy in (best, teacher))
    there = of_best.lengths < 999
    regret = (of_best.returns - of_teacher.returns)[there].mean()
    assert regret > 5.0 and there.mean() > 0.8
    states = visited_states(teacher, MOUNTAINCAR, starts[there])
    lost = best.lost(states, teacher.predict(states)[0])
    assert lost.min() > -1.0 and lost.sum() / there.sum() == pytest.approx(regret, rel=0.2)


def test_what_has_no_computed_optimum_is_refused():
    with pytest.raises(ValueError, match="the task is .*, expected one of"):
        best_policy("LunarLanderContinuous-v3")
    assert TASKS == (SIMPLEGOAL, MOUNTAINCAR, PENDULUM)


# Where Pendulum loses return


def test_regions_by_hand():
    angle = np.array([0.0, 0.4, 0.6, 0.0, np.pi])
    obs = np.column_stack([np.cos(angle), np.sin(angle), [0.0, 1.9, 0.0, 2.1, 0.0]])
    held, swung = (PENDULUM_REGIONS[name](obs) for name in ("hold", "swing-up"))
    assert held.tolist() == [True, True, False, False, False] == (~swung).tolist()


def test_losses_add_up_to_the_regret_and_the_best_loses_nothing():
    task, teacher, best = get_task(PENDULUM), load_teacher(PENDULUM), best_policy(PENDULUM, finer=0.4)
    starts = task.start(np.random.default_rng(0), 60)
    table = losses(teacher, best, task, starts, PENDULUM_REGIONS)
    regret = (rollout(best, task, starts).returns - rollout(teacher, task, starts).returns).mean()
    assert table.steps.sum() == pytest.approx(1) and table.steps["hold"] > 0.7 and regret > 8.0
    assert table.lost.sum() == pytest.approx(regret, abs=1.0) and (table.lost > -0.5).all()
    assert table.lost["swing-up"] > table.lost["hold"]
    assert losses(best, best, task, starts, PENDULUM_REGIONS).lost.sum() == pytest.approx(0, abs=1e-9)
