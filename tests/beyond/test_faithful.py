import dataclasses

import numpy as np
import pytest
from support import PENDULUM, SIMPLEGOAL, Constant, CurvedTeacher

from vsp.evaluation import rollout_from_seed
from vsp.rollouts import rollout, visited_states
from vsp.tasks import GOAL, get_task
from vsp_beyond import Faithful
from vsp_beyond.few_cells import faithful as module
from vsp_beyond.few_cells.faithful import distill_faithfully, kept
from vsp_beyond.few_cells.units import LabelledStates, ScaledCells, Scaling, needed_only, squared_error, warn_outside

SMALL = Faithful(
    n_cells=3, tolerance=0.1, n_episodes=200, n_restarts=8, n_generations=8, n_tuning_episodes=60, n_validation=200
)
STILL = ScaledCells(np.zeros((1, 2)), np.zeros((1, 3, 2)))
UNTUNED = dataclasses.replace(SMALL, n_generations=0)

pytestmark = pytest.mark.filterwarnings("ignore:no policy of 3 cells")  # so little work finds less than was asked


def distilled_by(**changes):
    return distill_faithfully(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, **changes), seed=1)


@pytest.fixture(scope="module")
def distilled():
    return distilled_by()


def r2(policy, teacher):
    states = visited_states(teacher, SIMPLEGOAL, get_task(SIMPLEGOAL).start(np.random.default_rng(9), 300))
    actions = teacher.predict(states)[0]
    return 1 - np.square(policy.predict(states)[0] - actions).mean() / actions.var(axis=0).mean()


def test_it_acts_like_the_teacher_and_returns_what_it_returns(distilled):
    policy, history = distilled
    results = (rollout_from_seed(actor, SIMPLEGOAL, 2000, seed=5) for actor in (CurvedTeacher(), policy))
    teachers, ours = (result.returns.mean() for result in results)
    best = history[history["kept"]]
    assert ours > teachers - 0.1 and len(policy) <= 3 and len(best) == 1
    assert r2(policy, CurvedTeacher()) == pytest.approx(best["r2"].item(), abs=0.02) and best["r2"].item() > 0.95
    assert list(history["stage"].unique()) == ["fit", "tune"]


# The choice between candidates


@pytest.mark.parametrize(
    ("gaps", "r2s", "min_r2", "best"),
    [
        ([-1.0, 0.0, -0.04], [0.9, 0.7, 0.8], None, 2),  # the closest of those that return enough
        ([0.5, 0.1, 3.0], [0.7, 0.9, 0.8], None, 1),  # beyond the teacher's, the return earns nothing
        ([-1.0, -0.06, -0.5], [0.9, 0.7, 0.81], None, 2),  # none does: the highest return of those that are near
        ([-0.5, 0.2, 3.0], [0.95, 0.91, 0.7], 0.9, 1),  # the highest return of those with this R²
        ([-0.5, 0.2, 3.0], [0.7, 0.8, 0.6], 0.9, 1),  # none has it: the closest
    ],
)
def test_which_candidate_is_kept(gaps, r2s, min_r2, best):
    assert kept(np.array(r2s), np.array(gaps), least_gap=-0.05, min_r2=min_r2) == best


def test_a_shortfall_is_said_and_the_closest_imitation_kept():
    with pytest.warns(UserWarning, match=r"no policy of 3 cells acts like .* returns as much: .* expected \+99.95"):
        history = distilled_by(n_generations=0, margin=100.0)[1]
    assert history[["stage", "kept"]].to_numpy().tolist() == [["fit", True]]
    with pytest.warns(UserWarning, match=r"no policy of 3 cells with R² 1 was found: the closest is kept, R² 0.9\d\d"):
        distilled_by(n_generations=0, min_r2=1.0)
    starts = get_task(PENDULUM).start(np.random.default_rng(np.random.SeedSequence(1).spawn(4)[2]), 20)
    missed = 1e4 - 0.01 * abs(rollout(Constant(1.0), PENDULUM, starts).returns.mean())  # half of 2 % of the return
    config = Faithful(n_cells=1, n_episodes=5, n_states=500, n_restarts=1, n_generations=0, n_validation=20, margin=1e4)
    with pytest.warns(UserWarning, match=rf"expected \+{missed:.4g} or more"):
        distill_faithfully(Constant(1.0), PENDULUM, config, seed=1)


def test_a_lower_r2_buys_return(distilled):
    """On the way from the teacher's actions to the best return."""
    history = distilled_by(min_r2=0.7, n_generations=40)[1]
    best = history[history["kept"]].iloc[0]
    assert best["r2"] >= 0.7 and best["gap"] > distilled[1].loc[distilled[1]["kept"], "gap"].item() + 0.05


def test_nothing_is_tuned_where_the_closest_cells_return_enough():
    assert distilled_by(tolerance=1000.0)[1]["stage"].tolist() == ["fit"]
    assert "tune" in distilled_by(tolerance=1000.0, min_r2=0.5)[1]["stage"].tolist()  # for the highest return


def test_the_cost_by_hand():
    """A return above the teacher's earns nothing; with a least R², an error below it does not either."""
    cost = module._cost(np.array([0.1, 0.1]), np.array([-5.0, 2.0]), 1.0, None)
    assert cost == pytest.approx([0.1, 0.1 + 2 * module.PRICE])
    cost = module._cost(np.array([0.25, 0.5]), np.zeros(2), 1.0, 0.7)
    assert cost == pytest.approx([0.0, 0.2 / module.BEYOND])


def test_the_goals_of_a_tuning_are_the_teachers_returns_less_its_failures_and_the_margin(monkeypatch):
    class Often(CurvedTeacher):
        def predict(self, obs):
            return np.column_stack([-np.ones(len(obs)), -0.5 * np.asarray(obs)[:, 1]]), None

    asked, missed, tune = [], [], module._tune
    monkeypatch.setattr(module, "_cost", lambda errors, those, *_: missed.append(those) or errors)
    monkeypatch.setattr(module, "_tune", lambda *given: asked.append(given[3:5]) or tune(*given))
    config = dataclasses.replace(SMALL, failure_penalty=100.0, min_r2=0.5, n_generations=1, margin=1000.0)
    distill_faithfully(Often(), SIMPLEGOAL, config, seed=1)
    pool, goals = asked[0]
    result = rollout(Often(), SIMPLEGOAL, pool)
    assert goals == pytest.approx(result.returns - 100 * (result.outcomes != GOAL)) and missed[0].min() > 800
    assert (result.outcomes != GOAL).any()


def test_a_candidate_pays_for_its_failures_and_need_not_return_more_than_the_best(monkeypatch):
    unscaled = Scaling(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2))
    configs = [dataclasses.replace(SMALL, failure_penalty=penalty) for penalty in (0.0, 1000.0)]
    starts = np.array([[0.9, 0.9], [0.05, 0.05]])
    free, dear = (module._Candidates(config, unscaled, None, starts, 0.0, 0.1) for config in configs)
    assert dear._gap(STILL) == pytest.approx(free._gap(STILL) - 500)
    monkeypatch.setattr(module._Candidates, "_gap", lambda *_: -5.0)
    free.rows.append({"cells": None, "r2": 0.9, "gap": -5.0})
    assert free.returns_enough(STILL)


def test_observations_beyond_the_declared_box_are_counted():
    start, low = lambda rng, n: rng.uniform(0.5, 1.0, size=(n, 2)), np.array([0.2, 0.0])
    narrow = dataclasses.replace(get_task(SIMPLEGOAL), start=start, low=low)
    with pytest.warns(UserWarning, match=r"[\d,]+ of [\d,]+ observations leave the box of SimpleGoal-v0, such as x = "):
        distill_faithfully(CurvedTeacher(), narrow, dataclasses.replace(UNTUNED, n_restarts=1), seed=0)
    with pytest.warns(UserWarning, match="1 of 2 observations leave the box"):
        warn_outside(get_task(SIMPLEGOAL), np.array([[0.5, 0.5], [1.001, 0.5]]))


# What is made of the cells at the end


def test_a_cell_that_the_return_needs_stays(monkeypatch, distilled):
    """Though the error does not."""
    monkeypatch.setattr("vsp_beyond.few_cells.faithful.needed_only", lambda cells, labelled: STILL)
    assert len(distilled_by(n_generations=1)[0]) > 1 == len(distilled_by(tolerance=1000.0)[0])


def on_a_line(codewords, values, states):
    """Cells of constant values, and the states with the values of their cells."""
    coefficients = np.stack([np.zeros(len(values)), values], axis=1)[..., None]
    cells, states = ScaledCells(np.array(codewords, dtype=float)[:, None], coefficients), np.asarray(states)[:, None]
    inputs = np.column_stack([states, np.ones(len(states))])
    return cells, LabelledStates(inputs, coefficients[cells.nearest(states), 1])


@pytest.mark.parametrize(
    ("codewords", "values", "needed"),
    [
        ([0, 1, 3], [0.5, 0.5, -0.5], [1, 3]),
        ([0, 1, 3], [0.5, 0.5, 0.5], [3]),
        ([0, 1.5, 3], [0, 0.4, 0.8], [0, 1.5, 3]),
    ],
)
def test_of_neighbours_with_one_map_one_is_left(codewords, values, needed):
    cells, labelled = on_a_line(codewords, values, np.linspace(0, 3, 31))
    left = needed_only(cells, labelled)
    assert left.codewords.ravel().tolist() == needed and squared_error(labelled, left) == 0.0


@pytest.mark.parametrize("sign", [1, -1])
def test_two_codewords_come_among_the_states_and_draw_the_same_border(sign):
    rng = np.random.default_rng(0)
    states = rng.normal(size=(500, 3))
    cells = ScaledCells(np.array([[9.0, -7.0, 3.0], [-8.5, 7.5, -3.2]])[::sign], np.zeros((2, 4, 1)))
    moved = cells.among(states)
    assert (moved.nearest(states) == cells.nearest(states)).all() and len(set(cells.nearest(states).tolist())) == 2
    shift, across = moved.codewords.mean(axis=0) - cells.codewords.mean(axis=0), cells.codewords[1] - cells.codewords[0]
    assert np.abs(moved.codewords).max() < 4 and shift @ across == pytest.approx(0)
    three = ScaledCells(rng.normal(size=(3, 3)), np.zeros((3, 4, 1)))
    assert three.among(states) is three


def test_the_most_visited_cell_comes_first():
    cells, labelled = on_a_line([0, 5, 9], [0.1, 0.2, 0.3], [0.0, 9.0, 9.1, 9.2, 5.0, 5.1])
    assert cells.by_visits(labelled.states).codewords.ravel().tolist() == [9.0, 5.0, 0.0]


def test_a_teacher_that_never_varies_is_imitated():
    """Its actions have no variance that the error could be measured in."""
    history = distill_faithfully(Constant(0.7, 0.7), SIMPLEGOAL, dataclasses.replace(UNTUNED, n_restarts=1), seed=0)[1]
    assert history["r2"].item() == pytest.approx(1.0)
