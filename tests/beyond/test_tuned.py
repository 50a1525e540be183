import dataclasses
import importlib

import numpy as np
import pytest
import support
from scipy.special import softmax
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, RandomPolicy

from vsp.evaluation import rollout_from_seed
from vsp.paper import printed
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Outcomes, score
from vsp.tasks.base import GOAL, PIT, TRUNCATED
from vsp.tasks.registry import get_task
from vsp_beyond import tuned
from vsp_beyond.few_cells.anneal import anneal, expected_loss, random_init, squared_error
from vsp_beyond.few_cells.config import Tuned
from vsp_beyond.few_cells.tune import SNAPSHOTS, Candidates, Objective, tune
from vsp_beyond.few_cells.tuned import distill_tuned
from vsp_beyond.few_cells.units import Cells, LabelledStates, Scaling

refine_module, tune_module = (importlib.import_module(f"vsp_beyond.few_cells.{name}") for name in ("tuned", "tune"))
SMALL = Tuned(
    n_cells=3, n_episodes=60, n_restarts=2, n_steps=300, batch_size=128, n_corrections=1, n_correction_episodes=30,
    n_generations=3, n_tuning_episodes=50, failure_penalty=100.0, n_validation=100,
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
    frame, (cells, _, _) = Scaling.of(task, states), some(4, d, m)
    inputs, policy = frame.inputs(states), frame.policy(cells)
    assert inputs[:, :-1].mean(axis=0) == pytest.approx(0) and inputs[:, :-1].std(axis=0) == pytest.approx(1)
    assert np.allclose(frame.outputs(policy.linear(states)), hard_actions(cells, inputs))
    assert (frame.outputs(task.action_low) == -1).all() and (frame.outputs(task.action_high) == 1).all()


def test_the_way_to_a_policy_and_back_leads_home():
    frame, (cells, _, _) = Scaling.of(get_task(PENDULUM), some(d=3, n=99)[1][:, :3]), some(k=3, d=3, m=1)
    back = frame.cells(frame.policy(cells))
    assert np.allclose(back.vector, cells.vector) and cells.like(cells.vector).maps.tolist() == cells.maps.tolist()


def test_a_variable_that_never_varies_keeps_its_unit():
    frame = Scaling.of(get_task(SIMPLEGOAL), np.array([[0.5, 0.1], [0.5, 0.3]]))
    assert frame.scale.tolist() == [1.0, 0.1] or frame.scale == pytest.approx([1.0, 0.1])


# The loss


@pytest.mark.parametrize("temperature", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("clip_slope", [0.01, 0.3])
def test_the_loss_by_hand_and_its_gradient_by_finite_differences(temperature, clip_slope):
    cells, inputs, actions = some()
    about = {"temperature": temperature, "clip_slope": clip_slope}
    loss, gradient = expected_loss(cells, inputs, actions, **about)
    raw = np.einsum("nd,kdm->nkm", inputs, cells.maps)
    errors = np.square(np.clip(raw, -1, 1) * (1 - clip_slope) + clip_slope * raw - actions[:, None]).mean(axis=2)
    gaps = np.square(inputs[:, None, :-1] - cells.codewords).sum(axis=2)
    assert loss == pytest.approx((softmax(-gaps / temperature, axis=1) * errors).sum(axis=1).mean())
    steps = 1e-6 * np.eye(cells.vector.size)
    values = [
        [expected_loss(cells.like(cells.vector + sign * step), inputs, actions, **about)[0] for sign in (1, -1)]
        for step in steps
    ]
    assert gradient == pytest.approx(-np.diff(values)[:, 0] / 2e-6, abs=1e-7) and np.abs(gradient).min() > 0


def test_in_the_cold_each_state_belongs_to_its_nearest_codeword():
    cells, inputs, actions = some()
    loss, gradient = expected_loss(cells, inputs, actions, temperature=1e-9, clip_slope=1e-9)
    assert loss == pytest.approx(np.mean((np.clip(hard_actions(cells, inputs), -1, 1) - actions) ** 2))
    assert np.abs(gradient[: cells.codewords.size]).max() == 0  # borders do not feel anything any more


# Its parts


def kinked(n=2000):
    """A teacher of two linear pieces, one on either side of x = 0.3."""
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, size=(n, 2))
    left = states[:, :1] < 0.3
    actions = np.where(left, 0.5 * states[:, :1] + 0.2, -0.7 * states[:, 1:] - 0.1)
    return LabelledStates(np.column_stack([states, np.ones(n)]), actions)


def test_annealing_finds_two_pieces_and_their_border():
    """The worst of five restarts leaves less than a twentieth of the error of one linear map."""
    seen, config = kinked(), dataclasses.replace(SMALL, n_cells=2, n_steps=2000)
    common = np.linalg.lstsq(seen.inputs, seen.actions, rcond=None)[0]
    one = np.mean((seen.inputs @ common - seen.actions) ** 2)
    errors = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        cells = anneal(seen, random_init(seen, 2, rng), config, rng)
        errors.append(np.mean((hard_actions(cells, seen.inputs) - seen.actions) ** 2))
    assert max(errors) < one / 20
    middle, way = cells.codewords.mean(axis=0), np.diff(cells.codewords, axis=0)[0]
    assert abs(middle @ way / way[0] - 0.3) < 0.05 and abs(way[1] / way[0]) < 0.2  # where x = 0.3, upright


def test_initial_codewords_lie_among_the_states_with_nearly_the_common_map():
    seen = kinked()
    cells = random_init(seen, 5, np.random.default_rng(0))
    gaps = np.abs(cells.codewords[:, None] - seen.inputs[:, :2]).max(axis=2).min(axis=1)
    common = np.linalg.lstsq(seen.inputs, seen.actions, rcond=None)[0]
    assert gaps.max() < 0.05 and np.abs(cells.maps - common).max() < 0.5 and len(np.unique(cells.codewords)) == 10


def ended(returns, codes):
    return Outcomes(np.array(returns, dtype=float), np.ones(len(returns)), np.array(codes))


def test_a_failure_costs_its_penalty():
    assert score(ended([10, 20], [GOAL, GOAL]), 1000.0) == 15
    assert score(ended([10, 20], [GOAL, PIT]), 4.0) == score(ended([10, 20], [TRUNCATED, GOAL]), 4.0) == 13


def test_differing_from_the_teacher_costs_its_penalty():
    cells, inputs, actions = some()
    seen, result = LabelledStates(inputs, actions), ended([10, 20], [GOAL, PIT])
    error = np.mean((np.clip(hard_actions(cells, inputs), -1, 1) - actions) ** 2)
    assert squared_error(seen, cells) == pytest.approx(error) and error > 0.1
    assert Objective(4.0, 7.0, seen).score(result, cells) == pytest.approx(13 - 7 * error)
    assert Objective(4.0).score(result, cells) == score(result, 4.0)


def test_tuning_stays_closer_where_errors_cost():
    """A teacher that goes slowly: for the return alone it pays to be faster than it."""
    frame, states = Scaling(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2)), np.random.default_rng(0).random((200, 2))
    slow = Cells(np.zeros((1, 2)), np.array([[[-0.3, 0], [0, -0.3], [-0.1, -0.1]]]))
    inputs = np.column_stack([states, np.ones(200)])
    seen = LabelledStates(inputs, inputs @ slow.maps[0])
    config = dataclasses.replace(SMALL, n_cells=1, n_generations=20, tuning_step=0.2)
    errors = []
    for penalty in (0.0, 10.0, 1000.0):
        *_, tuned = tune(frame, slow, config, Objective(0.0, penalty, seen), np.random.default_rng(0))
        errors.append(squared_error(seen, tuned))
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


def test_the_first_of_the_best_candidates_is_kept():
    task = get_task(SIMPLEGOAL)
    frame = Scaling(task, np.zeros(2), np.ones(2))
    candidates = Candidates(frame, np.array([[0.9, 0.05], [0.05, 0.9]]), Objective(1000.0))
    still, home = (Cells(np.zeros((1, 2)), np.array([[[0.0, 0], [0, 0], [step, step]]])) for step in (0.0, -1.0))
    again = Cells(home.codewords + 1, home.maps)
    for restart, cells in enumerate((still, home, again)):
        candidates.add("fit", restart, cells)
    assert candidates.best is home and candidates.best_restart == 1
    rows = candidates.rows
    assert [row["failing"] for row in rows] == [1, 0, 0] and rows[1]["mean"] > rows[0]["mean"]


def test_tuning_finds_a_better_policy():
    """From a policy that walks to the goal at half its speed along both axes, on SimpleGoal."""
    frame = Scaling(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2))
    slow = Cells(np.zeros((1, 2)), np.array([[[-0.3, 0], [0, -0.3], [-0.1, -0.1]]]))
    config = dataclasses.replace(SMALL, n_cells=1, n_generations=30, tuning_step=0.2)
    steps = list(tune(frame, slow, config, Objective(0.0), np.random.default_rng(0)))
    assert len(steps) == SNAPSHOTS
    tuned = steps[-1]
    policies = map(frame.policy, (slow, tuned))
    before, after = (rollout_from_seed(one, SIMPLEGOAL, 500, seed=9).returns.mean() for one in policies)
    assert after > before + 1


# Criticality


def test_states_are_drawn_in_proportion_to_their_criticality():
    _, inputs, actions = some(n=4)
    seen = LabelledStates(inputs, actions, np.array([0.0, 1.0, 3.0, 0.0]))
    drawn = np.bincount(seen.draw(4000, np.random.default_rng(0))(), minlength=4)
    assert drawn[0] == drawn[3] == 0 and drawn[2] / drawn[1] == pytest.approx(3, rel=0.15)
    both = seen.with_more(LabelledStates(inputs[:1], actions[:1], np.array([4.0])))
    assert np.bincount(both.draw(4000, np.random.default_rng(0))())[4] == pytest.approx(2000, rel=0.1)


@pytest.mark.parametrize("criticality", [None, np.zeros(3)])
def test_without_criticality_all_states_are_drawn_alike(criticality):
    _, inputs, actions = some(n=3)
    drawn = np.bincount(LabelledStates(inputs, actions, criticality).draw(3000, np.random.default_rng(0))())
    assert drawn == pytest.approx([1000, 1000, 1000], rel=0.15)


class Anxious(CurvedTeacher):
    """Whose actions are critical on the left only."""

    def criticality(self, obs):
        return (np.asarray(obs)[:, 0] < 0.5).astype(float)


def test_the_setting_asks_the_teacher_for_its_criticality():
    settings = (dataclasses.replace(SMALL, criticality=asked) for asked in (False, True))
    one, other = (distill_tuned(Anxious(), SIMPLEGOAL, config, seed=0)[1] for config in settings)
    assert one["mean"][0] == other["mean"][0] and one["mean"][1] != other["mean"][1]
    for teacher in (support.network_teacher(SIMPLEGOAL), CurvedTeacher()):
        with pytest.raises(ValueError, match="has no critics"):
            distill_tuned(teacher, SIMPLEGOAL, dataclasses.replace(SMALL, criticality=True), seed=0)


# All of it


@pytest.fixture(scope="module")
def refined():
    return distill_tuned(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3)


def same(one, other):
    return np.array_equal(one.codewords, other.codewords) and np.array_equal(one.coefficients, other.coefficients)


def test_the_same_arguments_give_the_same_policy(refined):
    assert same(tuned(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3), refined[0])


def test_the_trials_tell_how_it_came_about(refined):
    policy, trials = refined
    assert trials["stage"].tolist() == ["line", "fit", "fit", "correct"] + SMALL.n_generations * ["tune"]
    assert trials["restart"].tolist()[:3] == [0, 0, 1] and trials["failing"].between(0, 1).all()
    value = trials["mean"] - SMALL.failure_penalty * trials["failing"]
    assert len(policy) == 3 and trials["restart"][3] == trials["restart"][value[:3].idxmax()]
    assert (trials["restart"][4:] == trials["restart"][value[:4].idxmax()]).all()


PLAIN = dataclasses.replace(SMALL, n_restarts=1, failure_penalty=0.0)


@pytest.fixture(scope="module")
def plain():
    return distill_tuned(CurvedTeacher(), SIMPLEGOAL, PLAIN, seed=0)[1]


@pytest.mark.parametrize(
    "change",
    [{"n_cells": 2}, {"n_episodes": 30}, {"n_steps": 200}, {"batch_size": 64}, {"learning_rate": 0.01},
     {"initial_temperature": 0.5}, {"final_temperature": 0.01}, {"clip_slope": 0.2}, {"n_corrections": 2},
     {"n_correction_episodes": 20},
     {"n_generations": 5}, {"n_tuning_episodes": 40}, {"tuning_step": 0.3}, {"error_penalty": 100.0},
     {"n_validation": 10}],
)  # fmt: skip
def test_every_setting_acts(plain, change):
    changed = distill_tuned(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(PLAIN, **change), seed=0)[1]
    assert not plain.equals(changed)


@pytest.mark.parametrize(("change", "stages"), [({"n_restarts": 1}, "lfct"), ({"n_corrections": 0}, "lfft"),
                                                ({"n_generations": 0}, "lffc")])  # fmt: skip
def test_parts_can_be_switched_off(change, stages):
    rows = distill_tuned(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, **change), seed=0)[1]
    assert "".join(stage[0] for stage in rows["stage"]) == stages.replace("t", "t" * SMALL.n_generations)


@pytest.mark.parametrize(("penalty", "kept"), [(0.0, 0), (10.0, 1)])
def test_the_failure_penalty_decides_between_a_higher_mean_and_fewer_failures(monkeypatch, penalty, kept):
    results = iter([ended([9, 1], [GOAL, PIT]), ended([3, 3], [GOAL, GOAL])])
    monkeypatch.setattr(tune_module, "rollout", lambda *_: next(results))
    candidates = Candidates(Scaling(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2)), None, Objective(penalty))
    for restart in range(2):
        candidates.add("fit", restart, some(k=1)[0])
    assert candidates.best_restart == kept


def test_it_works_from_a_policy_that_is_there():
    start = printed.published_policy(SIMPLEGOAL)
    config = dataclasses.replace(SMALL, n_cells=13, n_restarts=1)
    policy, rows = distill_tuned(CurvedTeacher(), SIMPLEGOAL, config, seed=0, start=start)
    scratch, _ = distill_tuned(CurvedTeacher(), SIMPLEGOAL, config, seed=0)
    assert len(policy) == 13 and not same(policy, scratch)
    near = np.abs(policy.codewords[:, None] - start.codewords).max(axis=2).min(axis=1)
    assert np.median(near) < 0.15  # codewords move, but not far
    with pytest.raises(ValueError, match="start has 13 cells for SimpleGoal-v0, expected n_cells = 3 for SimpleGoal"):
        distill_tuned(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=0, start=start)
    with pytest.raises(ValueError, match="start has 13 cells for SimpleGoal-v0, expected .* for MountainCar"):
        distill_tuned(PumpingTeacher(), MOUNTAINCAR, config, seed=0, start=start)


def test_the_start_is_a_candidate_and_never_lost(monkeypatch):
    """Every fit gives a policy that does nothing."""
    still = Cells(np.arange(6.0).reshape(3, 2), np.zeros((3, 3, 2)))
    monkeypatch.setattr(refine_module, "anneal", lambda *_, **__: still)
    maps = np.random.default_rng(0).normal(-1, 0.1, size=(3, 3, 2)) * [[0.0], [0.0], [1.0]]
    codewords = np.random.default_rng(1).random((3, 2))
    start = VoronoiPolicy(codewords, maps, task=SIMPLEGOAL, metric="euclidean", scale=np.array([0.1, 2.0]))
    policy, rows = distill_tuned(
        CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(SMALL, n_generations=0), seed=0, start=start
    )
    assert rows["stage"].tolist() == ["start", "fit", "fit", "correct"] and rows["mean"].idxmax() == 0
    assert np.allclose(policy.codewords, start.codewords) and np.allclose(policy.coefficients, start.coefficients)
    states = np.random.default_rng(2).random((1000, 2))  # borders do not move either
    assert (policy.cells(states) == start.cells(states)).all()


def test_a_task_of_one_start_state_is_no_trouble():
    """All initial codewords would coincide."""
    task = dataclasses.replace(get_task(SIMPLEGOAL), start=lambda rng, n: np.full((n, 2), 0.05))
    policy, _ = distill_tuned(CurvedTeacher(), task, SMALL, seed=0)
    assert len(policy) == 3


def test_refining_leaves_the_global_random_numbers_alone():
    np.random.seed(5)
    expected = np.random.RandomState(5).random_sample()
    distill_tuned(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=0)
    assert np.random.random_sample() == expected


@pytest.mark.parametrize("task", [PENDULUM, LUNARLANDER])
def test_tasks_of_more_dimensions(task):
    tiny = dataclasses.replace(SMALL, n_episodes=4, n_correction_episodes=2, n_tuning_episodes=2, n_validation=3,
                               n_generations=1)  # fmt: skip
    policy, _ = distill_tuned(RandomPolicy(len(get_task(task).action_low)), task, tiny, seed=0)
    assert isinstance(policy, VoronoiPolicy) and policy.codewords.shape == (3, len(get_task(task).low))
