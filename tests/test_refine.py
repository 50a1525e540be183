import dataclasses
import importlib

import numpy as np
import pytest
from support import (
    LUNARLANDER,
    MOUNTAINCAR,
    PENDULUM,
    SIMPLEGOAL,
    CurvedTeacher,
    PumpingTeacher,
    RandomPolicy,
    network_teacher,
)

import vsp
from vsp import paper
from vsp.config import Refinement
from vsp.envs import GOAL, PIT, TRUNCATED, get_task
from vsp.evaluate import outcomes
from vsp.policy import VoronoiPolicy
from vsp.refine import (
    SNAPSHOTS,
    Aim,
    Cells,
    Frame,
    Labelled,
    Trials,
    anneal,
    beginning,
    expected_loss,
    refine,
    squared_error,
    tune,
    worth,
)
from vsp.rollouts import Outcomes

module = importlib.import_module("vsp.refine")
SMALL = Refinement(
    n_cells=3, n_episodes=60, n_restarts=2, n_steps=300, batch_size=128, n_corrections=1, n_correction_episodes=30,
    n_generations=3, n_tuning_episodes=50, failure_price=100.0, n_validation=100,
)  # fmt: skip


def some(k=3, d=2, m=2, n=40, seed=0):
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.normal(size=(n, d)), np.ones(n)])
    return Cells(rng.normal(size=(k, d)), rng.normal(size=(k, d + 1, m))), inputs, rng.uniform(-1, 1, size=(n, m))


def hard_actions(cells, inputs):
    nearest = np.square(inputs[:, None, :-1] - cells.codewords).sum(axis=2).argmin(axis=1)
    return np.einsum("nd,ndm->nm", inputs, cells.maps[nearest])


# Units


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR, PENDULUM, LUNARLANDER])
def test_a_policy_acts_as_its_cells_do_in_scaled_units(task):
    task, rng = get_task(task), np.random.default_rng(1)
    d, m = len(task.low), len(task.action_low)
    states = rng.normal(2.0, 3.0, size=(500, d)) * np.arange(1, d + 1)
    frame, (cells, _, _) = Frame.of(task, states), some(4, d, m)
    inputs, policy = frame.inputs(states), frame.policy(cells)
    assert inputs[:, :-1].mean(axis=0) == pytest.approx(0) and inputs[:, :-1].std(axis=0) == pytest.approx(1)
    assert np.allclose(frame.outputs(policy.linear(states)), hard_actions(cells, inputs))
    assert (frame.outputs(task.action_low) == -1).all() and (frame.outputs(task.action_high) == 1).all()


def test_the_way_to_a_policy_and_back_leads_home():
    frame, (cells, _, _) = Frame.of(get_task(PENDULUM), some(d=3, n=99)[1][:, :3]), some(k=3, d=3, m=1)
    back = frame.cells(frame.policy(cells))
    assert np.allclose(back.vector, cells.vector) and cells.like(cells.vector).maps.tolist() == cells.maps.tolist()


def test_a_variable_that_never_varies_keeps_its_unit():
    frame = Frame.of(get_task(SIMPLEGOAL), np.array([[0.5, 0.1], [0.5, 0.3]]))
    assert frame.scale.tolist() == [1.0, 0.1] or frame.scale == pytest.approx([1.0, 0.1])


# The loss


@pytest.mark.parametrize("temperature", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("leak", [0.01, 0.3])
def test_the_gradient_is_that_of_finite_differences(temperature, leak):
    cells, inputs, actions = some()
    _, gradient = expected_loss(cells, inputs, actions, temperature=temperature, leak=leak)
    steps = 1e-6 * np.eye(cells.vector.size)
    values = [
        [expected_loss(cells.like(cells.vector + sign * step), inputs, actions, temperature=temperature, leak=leak)[0]
         for sign in (1, -1)] for step in steps
    ]  # fmt: skip
    assert gradient == pytest.approx(-np.diff(values)[:, 0] / 2e-6, abs=1e-7) and np.abs(gradient).min() > 0


def test_one_cell_has_the_mean_squared_error():
    cells, inputs, actions = some(k=1)
    raw = inputs @ cells.maps[0]
    limited = np.clip(raw, -1, 1) + 0.01 * (raw - np.clip(raw, -1, 1))
    loss, _ = expected_loss(cells, inputs, actions, temperature=1.0, leak=0.01)
    assert loss == pytest.approx(np.mean((limited - actions) ** 2)) and (np.abs(raw) > 1).any()


def test_in_the_cold_each_state_belongs_to_its_nearest_codeword():
    cells, inputs, actions = some()
    loss, gradient = expected_loss(cells, inputs, actions, temperature=1e-9, leak=1e-9)
    assert loss == pytest.approx(np.mean((np.clip(hard_actions(cells, inputs), -1, 1) - actions) ** 2))
    assert np.abs(gradient[: cells.codewords.size]).max() == 0  # borders do not feel anything any more


def test_in_the_heat_all_cells_count_the_same():
    cells, inputs, actions = some()
    each = [
        expected_loss(
            Cells(cells.codewords[i : i + 1], cells.maps[i : i + 1]), inputs, actions, temperature=1, leak=0.1
        )
        for i in range(3)
    ]
    loss, _ = expected_loss(cells, inputs, actions, temperature=1e9, leak=0.1)
    assert loss == pytest.approx(np.mean([one[0] for one in each]))


# Its parts


def kinked(n=2000):
    """A teacher of two linear pieces, one on either side of x = 0.3."""
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, size=(n, 2))
    left = states[:, :1] < 0.3
    actions = np.where(left, 0.5 * states[:, :1] + 0.2, -0.7 * states[:, 1:] - 0.1)
    return Labelled(np.column_stack([states, np.ones(n)]), actions)


def test_annealing_finds_two_pieces_and_their_border():
    """The worst of five beginnings leaves less than a twentieth of the error of one linear map."""
    seen, config = kinked(), dataclasses.replace(SMALL, n_cells=2, n_steps=2000)
    common = np.linalg.lstsq(seen.inputs, seen.actions, rcond=None)[0]
    one = np.mean((seen.inputs @ common - seen.actions) ** 2)
    errors = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        cells = anneal(seen, beginning(seen, 2, rng), config, rng, hottest=1.0, n_steps=2000)
        errors.append(np.mean((hard_actions(cells, seen.inputs) - seen.actions) ** 2))
    assert max(errors) < one / 20
    middle, way = cells.codewords.mean(axis=0), np.diff(cells.codewords, axis=0)[0]
    assert abs(middle @ way / way[0] - 0.3) < 0.05 and abs(way[1] / way[0]) < 0.2  # where x = 0.3, upright


def test_a_beginning_stands_among_the_states_with_nearly_the_common_map():
    seen = kinked()
    cells = beginning(seen, 5, np.random.default_rng(0))
    gaps = np.abs(cells.codewords[:, None] - seen.inputs[:, :2]).max(axis=2).min(axis=1)
    common = np.linalg.lstsq(seen.inputs, seen.actions, rcond=None)[0]
    assert gaps.max() < 0.05 and np.abs(cells.maps - common).max() < 0.5 and len(np.unique(cells.codewords)) == 10


def ended(returns, codes):
    return Outcomes(np.array(returns, dtype=float), np.ones(len(returns)), np.array(codes))


def test_a_failure_costs_its_price():
    assert worth(ended([10, 20], [GOAL, GOAL]), 1000.0) == 15
    assert worth(ended([10, 20], [GOAL, PIT]), 4.0) == worth(ended([10, 20], [TRUNCATED, GOAL]), 4.0) == 13


def test_being_unlike_the_teacher_costs_its_price():
    cells, inputs, actions = some()
    seen, result = Labelled(inputs, actions), ended([10, 20], [GOAL, PIT])
    error = np.mean((np.clip(hard_actions(cells, inputs), -1, 1) - actions) ** 2)
    assert squared_error(seen, cells) == pytest.approx(error) and error > 0.1
    assert Aim(4.0, 7.0, seen).worth(result, cells) == pytest.approx(13 - 7 * error)
    assert Aim(4.0).worth(result, cells) == worth(result, 4.0)


def test_tuning_stays_closer_where_errors_cost():
    """A teacher that goes slowly: for the return alone it pays to be faster than it."""
    frame, states = Frame(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2)), np.random.default_rng(0).random((200, 2))
    slow = Cells(np.zeros((1, 2)), np.array([[[-0.3, 0], [0, -0.3], [-0.1, -0.1]]]))
    inputs = np.column_stack([states, np.ones(200)])
    seen = Labelled(inputs, inputs @ slow.maps[0])
    config = dataclasses.replace(SMALL, n_cells=1, n_generations=20, tuning_step=0.2)
    errors = []
    for price in (0.0, 10.0, 1000.0):
        *_, tuned = tune(frame, slow, config, Aim(0.0, price, seen), np.random.default_rng(0))
        errors.append(squared_error(seen, tuned))
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


def test_the_first_of_the_best_trials_is_kept():
    task = get_task(SIMPLEGOAL)
    frame = Frame(task, np.zeros(2), np.ones(2))
    trials = Trials(frame, np.array([[0.9, 0.05], [0.05, 0.9]]), Aim(1000.0))
    still, home = (Cells(np.zeros((1, 2)), np.array([[[0.0, 0], [0, 0], [step, step]]])) for step in (0.0, -1.0))
    again = Cells(home.codewords + 1, home.maps)
    for restart, cells in enumerate((still, home, again)):
        trials.add("fit", restart, cells)
    assert trials.best is home and trials.winner == 1
    assert [row["failing"] for row in trials.rows] == [1, 0, 0] and trials.rows[1]["mean"] > trials.rows[0]["mean"]


def test_tuning_finds_a_better_policy():
    """From a policy that walks to the goal at half its speed along both axes, on SimpleGoal."""
    frame = Frame(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2))
    slow = Cells(np.zeros((1, 2)), np.array([[[-0.3, 0], [0, -0.3], [-0.1, -0.1]]]))
    config = dataclasses.replace(SMALL, n_cells=1, n_generations=30, tuning_step=0.2)
    steps = list(tune(frame, slow, config, Aim(0.0), np.random.default_rng(0)))
    assert len(steps) == SNAPSHOTS
    tuned = steps[-1]
    before, after = (outcomes(frame.policy(cells), SIMPLEGOAL, 500, seed=9).returns.mean() for cells in (slow, tuned))
    assert after > before + 1


# What is at stake


def test_states_are_drawn_as_often_as_is_at_stake():
    _, inputs, actions = some(n=4)
    seen = Labelled(inputs, actions, np.array([0.0, 1.0, 3.0, 0.0]))
    drawn = np.bincount(seen.draw(4000, np.random.default_rng(0))(), minlength=4)
    assert drawn[0] == drawn[3] == 0 and drawn[2] / drawn[1] == pytest.approx(3, rel=0.15)
    both = seen.with_more(Labelled(inputs[:1], actions[:1], np.array([4.0])))
    assert np.bincount(both.draw(4000, np.random.default_rng(0))())[4] == pytest.approx(2000, rel=0.1)


@pytest.mark.parametrize("stakes", [None, np.zeros(3)])
def test_where_nothing_is_at_stake_all_states_are_drawn_alike(stakes):
    _, inputs, actions = some(n=3)
    drawn = np.bincount(Labelled(inputs, actions, stakes).draw(3000, np.random.default_rng(0))())
    assert drawn == pytest.approx([1000, 1000, 1000], rel=0.15)


def test_the_map_imitates_where_something_is_at_stake():
    """The action is |x|, and only what happens on the right matters."""
    x = np.random.default_rng(0).uniform(-1, 1, size=(400, 1))
    inputs, config = np.column_stack([x, np.ones(400)]), dataclasses.replace(SMALL, learning_rate=0.05)
    start = Cells(np.zeros((1, 1)), np.zeros((1, 2, 1)))
    for stakes, slope in ((None, 0.0), ((x[:, 0] > 0).astype(float), 1.0)):
        seen = Labelled(inputs, np.abs(x), stakes)
        cells = anneal(seen, start, config, np.random.default_rng(1), hottest=1.0, n_steps=600)
        assert cells.maps[0, 0, 0] == pytest.approx(slope, abs=0.1)


class Anxious(CurvedTeacher):
    """For whom all is at stake on the left."""

    def stakes(self, obs):
        return (np.asarray(obs)[:, 0] < 0.5).astype(float)


def test_the_setting_asks_the_teacher_for_its_stakes():
    one, other = (refine(Anxious(), SIMPLEGOAL, dataclasses.replace(SMALL, stakes=s), seed=0)[1] for s in (False, True))
    assert one["mean"][0] == other["mean"][0] and one["mean"][1] != other["mean"][1]
    with pytest.raises(ValueError, match="the teacher has no critics"):
        refine(network_teacher(SIMPLEGOAL), SIMPLEGOAL, dataclasses.replace(SMALL, stakes=True), seed=0)


# All of it


@pytest.fixture(scope="module")
def refined():
    return refine(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3)


def same(one, other):
    return np.array_equal(one.codewords, other.codewords) and np.array_equal(one.coefficients, other.coefficients)


def test_the_same_arguments_give_the_same_policy(refined):
    policy, trials = refined
    again, rows = refine(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3)
    assert same(policy, again) and trials.equals(rows)
    assert not same(policy, refine(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=4)[0])


def test_distill_hands_over_to_refine(refined):
    policy, rows = vsp.distill(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3)
    assert same(policy, refined[0]) and rows.equals(refined[1])


def test_the_trials_tell_how_it_came_about(refined):
    policy, trials = refined
    assert trials["stage"].tolist() == ["line", "fit", "fit", "correct"] + SMALL.n_generations * ["tune"]
    assert trials["restart"].tolist()[:3] == [0, 0, 1] and trials["failing"].between(0, 1).all()
    value = trials["mean"] - SMALL.failure_price * trials["failing"]
    assert len(policy) == 3 and trials["restart"][3] == trials["restart"][value[:3].idxmax()]
    assert (trials["restart"][4:] == trials["restart"][value[:4].idxmax()]).all()


PLAIN = dataclasses.replace(SMALL, n_restarts=1, failure_price=0.0)


@pytest.fixture(scope="module")
def plain():
    return refine(CurvedTeacher(), SIMPLEGOAL, PLAIN, seed=0)[1]


@pytest.mark.parametrize(
    "change",
    [{"n_cells": 2}, {"n_episodes": 30}, {"n_steps": 200}, {"batch_size": 64}, {"learning_rate": 0.01},
     {"hottest": 0.5}, {"coldest": 0.01}, {"leak": 0.2}, {"n_corrections": 2}, {"n_correction_episodes": 20},
     {"n_generations": 5}, {"n_tuning_episodes": 40}, {"tuning_step": 0.3}, {"error_price": 100.0}],
)  # fmt: skip
def test_every_setting_acts(plain, change):
    changed = refine(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(PLAIN, **change), seed=0)[1]
    assert not plain.equals(changed)


def test_the_same_settings_give_the_same_trials(plain):
    assert plain.equals(refine(CurvedTeacher(), SIMPLEGOAL, PLAIN, seed=0)[1])


@pytest.mark.parametrize(("change", "stages"), [({"n_restarts": 1}, "lfct"), ({"n_corrections": 0}, "lfft"),
                                                ({"n_generations": 0}, "lffc")])  # fmt: skip
def test_parts_can_be_switched_off(change, stages):
    rows = refine(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, **change), seed=0)[1]
    assert "".join(stage[0] for stage in rows["stage"]) == stages.replace("t", "t" * SMALL.n_generations)


def test_other_validation_episodes_give_other_means(refined):
    fewer = refine(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, n_validation=10), seed=3)[1]
    assert fewer["mean"][0] != refined[1]["mean"][0]


@pytest.mark.parametrize(("price", "kept"), [(0.0, 0), (10.0, 1)])
def test_the_price_of_a_failure_decides_between_a_mean_and_a_safe_one(monkeypatch, price, kept):
    results = iter([ended([9, 1], [GOAL, PIT]), ended([3, 3], [GOAL, GOAL])])
    monkeypatch.setattr(module, "play", lambda *_: next(results))
    trials = Trials(Frame(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2)), None, Aim(price))
    for restart in range(2):
        trials.add("fit", restart, some(k=1)[0])
    assert trials.winner == kept


def test_it_works_from_a_policy_that_is_there():
    start = paper.published_policy(SIMPLEGOAL)
    config = dataclasses.replace(SMALL, n_cells=13, n_restarts=1)
    policy, rows = refine(CurvedTeacher(), SIMPLEGOAL, config, seed=0, start=start)
    scratch, _ = refine(CurvedTeacher(), SIMPLEGOAL, config, seed=0)
    assert len(policy) == 13 and not same(policy, scratch)
    near = np.abs(policy.codewords[:, None] - start.codewords).max(axis=2).min(axis=1)
    assert np.median(near) < 0.15  # codewords move, but not far
    with pytest.raises(ValueError, match="start has 13 cells for SimpleGoal-v0, expected n_cells = 3 for SimpleGoal"):
        refine(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=0, start=start)
    with pytest.raises(ValueError, match="start has 13 cells for SimpleGoal-v0, expected .* for MountainCar"):
        refine(PumpingTeacher(), MOUNTAINCAR, config, seed=0, start=start)


def test_what_there_is_already_is_a_trial_and_never_lost(monkeypatch):
    """All that comes of the fits stands still."""
    still = Cells(np.arange(6.0).reshape(3, 2), np.zeros((3, 3, 2)))
    monkeypatch.setattr(module, "anneal", lambda *_, **__: still)
    maps = np.random.default_rng(0).normal(-1, 0.1, size=(3, 3, 2)) * [[0.0], [0.0], [1.0]]
    start = VoronoiPolicy(np.random.default_rng(1).random((3, 2)), maps, task=SIMPLEGOAL, metric="euclidean")
    policy, rows = refine(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, n_generations=0), seed=0, start=start)
    assert rows["stage"].tolist() == ["start", "fit", "fit", "correct"] and rows["mean"].idxmax() == 0
    assert np.allclose(policy.codewords, start.codewords) and np.allclose(policy.coefficients, start.coefficients)


def test_a_task_of_one_start_state_is_no_trouble():
    """All codewords would begin at one place."""
    task = dataclasses.replace(get_task(SIMPLEGOAL), start=lambda rng, n: np.full((n, 2), 0.05))
    policy, _ = refine(CurvedTeacher(), task, SMALL, seed=0)
    assert len(policy) == 3


def test_refining_leaves_the_global_random_numbers_alone():
    np.random.seed(5)
    expected = np.random.RandomState(5).random_sample()
    refine(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=0)
    assert np.random.random_sample() == expected


def test_a_function_has_no_stakes():
    with pytest.raises(ValueError, match="stakes is True, but CurvedTeacher has no critics"):
        refine(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, stakes=True), seed=0)


@pytest.mark.parametrize("task", [PENDULUM, LUNARLANDER])
def test_tasks_of_more_dimensions(task):
    tiny = dataclasses.replace(SMALL, n_episodes=4, n_correction_episodes=2, n_tuning_episodes=2, n_validation=3,
                               n_generations=1)  # fmt: skip
    policy, _ = refine(RandomPolicy(len(get_task(task).action_low)), task, tiny, seed=0)
    assert isinstance(policy, VoronoiPolicy) and policy.codewords.shape == (3, len(get_task(task).low))


def test_bad_seeds_are_refused():
    with pytest.raises(ValueError, match="seed"):
        refine(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=-1)
