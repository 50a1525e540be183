import dataclasses
import types

import numpy as np
import pytest
import support
from scipy.special import softmax
from support import LUNARLANDER, PENDULUM, SIMPLEGOAL, CurvedTeacher

import vsp_beyond
from vsp import VoronoiPolicy, load_teacher
from vsp.evaluation import rollout_from_seed
from vsp.paper import printed
from vsp.rollouts import Outcomes
from vsp.tasks import GOAL, PIT, TRUNCATED, get_task
from vsp_beyond.few_cells.tune import SNAPSHOTS, Candidates, is_snapshot, score, tune
from vsp_beyond.few_cells.tuned import anneal, distill_tuned, random_init
from vsp_beyond.few_cells.units import LabelledStates, ScaledCells, Scaling, expected_loss

SMALL = vsp_beyond.Tuned(
    n_cells=3, n_episodes=60, n_restarts=2, n_steps=300, batch_size=128, n_corrections=1, n_correction_episodes=30,
    n_generations=3, n_tuning_episodes=50, failure_penalty=100.0, n_validation=100,
)  # fmt: skip
PLAIN = dataclasses.replace(SMALL, n_restarts=1, failure_penalty=0.0)
UNSCALED = Scaling(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2))
# Walks to the goal, not at full speed
SLOW = ScaledCells(np.zeros((1, 2)), np.array([[[-0.3, 0], [0, -0.3], [-0.1, -0.1]]]))


def some(k=3, d=2, m=2, n=40, criticality=None):
    """Cells, and states with labels of no meaning."""
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(size=(n, d)), np.ones(n)])
    cells = ScaledCells(rng.normal(size=(k, d)), rng.normal(size=(k, d + 1, m)))
    return cells, LabelledStates(inputs, rng.uniform(-1, 1, size=(n, m)), criticality)


def hard_actions(cells, inputs):
    nearest = np.square(inputs[:, None, :-1] - cells.codewords).sum(axis=2).argmin(axis=1)
    return np.einsum("nd,ndm->nm", inputs, cells.coefficients[nearest])


# Units


@pytest.mark.parametrize("task", [SIMPLEGOAL, PENDULUM, LUNARLANDER])
def test_a_policy_acts_as_its_cells_do_in_scaled_units_and_back(task):
    task, rng = get_task(task), np.random.default_rng(1)
    d, m = len(task.low), len(task.action_low)
    states = rng.normal(2.0, 3.0, size=(500, d)) * np.arange(1, d + 1)
    scaling, (cells, _) = Scaling.of(task, states), some(4, d, m)
    inputs, policy = scaling.inputs(states), scaling.policy(cells)
    assert inputs[:, :-1].mean(axis=0) == pytest.approx(0) and inputs[:, :-1].std(axis=0) == pytest.approx(1)
    assert np.allclose(scaling.outputs(policy.linear(states)), hard_actions(cells, inputs))
    assert (scaling.outputs(task.action_low) == -1).all() and (scaling.outputs(task.action_high) == 1).all()
    assert np.allclose(scaling.cells(policy).vector, cells.vector)
    assert np.array_equal(cells.like(cells.vector).coefficients, cells.coefficients)


# The loss


@pytest.mark.parametrize(("temperature", "clip_slope"), [(0.05, 0.01), (1.0, 0.3), (20.0, 0.01)])
def test_the_loss_by_hand_and_its_gradient_by_finite_differences(temperature, clip_slope):
    cells, labelled = some()
    data, about = (labelled.inputs, labelled.actions), {"temperature": temperature, "clip_slope": clip_slope}
    loss, gradient = expected_loss(cells, *data, **about)
    raw = np.einsum("nd,kdm->nkm", labelled.inputs, cells.coefficients)
    limited = np.clip(raw, -1, 1) * (1 - clip_slope) + clip_slope * raw
    errors = np.square(limited - labelled.actions[:, None]).mean(axis=2)
    gaps = np.square(labelled.inputs[:, None, :-1] - cells.codewords).sum(axis=2)
    assert loss == pytest.approx((softmax(-gaps / temperature, axis=1) * errors).sum(axis=1).mean())
    expected = support.slopes(lambda vector: expected_loss(cells.like(vector), *data, **about)[0], cells.vector)
    assert gradient == pytest.approx(expected, abs=1e-7) and np.abs(gradient).min() > 0


def kinked(n=2000):
    """A teacher of two linear pieces, one on either side of x = 0.3."""
    states = np.random.default_rng(0).uniform(-1, 1, size=(n, 2))
    left, right = 0.5 * states[:, :1] + 0.2, -0.7 * states[:, 1:] - 0.1
    return LabelledStates(np.column_stack([states, np.ones(n)]), np.where(states[:, :1] < 0.3, left, right))


def test_annealing_finds_two_pieces_and_their_border():
    """The worst of three restarts leaves less than a twentieth of the error of one linear map."""
    labelled, config, errors = kinked(), dataclasses.replace(SMALL, n_cells=2, n_steps=2000), []
    common = np.linalg.lstsq(labelled.inputs, labelled.actions, rcond=None)[0]
    of_one_map = np.mean((labelled.inputs @ common - labelled.actions) ** 2)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        first = random_init(labelled, 2, rng)
        gaps = np.abs(first.codewords[:, None] - labelled.inputs[:, :2]).max(axis=2).min(axis=1)
        assert gaps.max() < 0.05 and np.abs(first.coefficients - common).max() < 0.5
        cells = anneal(labelled, first, config, rng)
        errors.append(np.mean((hard_actions(cells, labelled.inputs) - labelled.actions) ** 2))
    assert max(errors) < of_one_map / 20
    middle, way = cells.codewords.mean(axis=0), np.diff(cells.codewords, axis=0)[0]
    assert abs(middle @ way / way[0] - 0.3) < 0.05 and abs(way[1] / way[0]) < 0.2  # where x = 0.3, upright


# Comparing and tuning


def ended(returns, outcomes):
    return Outcomes(np.array(returns, dtype=float), np.ones(len(returns)), np.array(outcomes))


def test_failures_cost_their_penalty():
    assert score(ended([10, 20], [GOAL, GOAL]), 1000.0) == 15
    assert score(ended([10, 20], [GOAL, PIT]), 4.0) == score(ended([10, 20], [TRUNCATED, GOAL]), 4.0) == 13


@pytest.mark.parametrize(("penalty", "best"), [(0.0, 0), (10.0, 1)])
def test_the_first_of_the_best_candidates_is_kept(monkeypatch, penalty, best):
    """The penalty decides between a higher mean and fewer failures."""
    results = iter([ended([9, 1], [GOAL, PIT]), *2 * [ended([3, 3], [GOAL, GOAL])]])
    monkeypatch.setattr("vsp_beyond.few_cells.tune.rollout", lambda *_: next(results))
    candidates = Candidates(UNSCALED.policy, UNSCALED.task, np.zeros((2, 2)), penalty)
    three = [SLOW.like(i * SLOW.vector) for i in range(3)]
    for restart, cells in enumerate(three):
        candidates.add("fit", restart, cells)
    assert candidates.best is three[best] and candidates.best_restart == best
    assert [(row["mean"], row["failing"]) for row in candidates.rows] == [(5, 0.5), (3, 0), (3, 0)]


def test_tuning_returns_more():
    """It pays to be faster."""
    config = dataclasses.replace(SMALL, n_cells=1, n_generations=20, tuning_step=0.2, failure_penalty=0.0)
    snapshots = list(tune(UNSCALED.policy, UNSCALED.task, SLOW, config, np.random.default_rng(0)))
    assert len(snapshots) == SNAPSHOTS
    policies = map(UNSCALED.policy, (SLOW, snapshots[-1]))
    before, after = (rollout_from_seed(policy, SIMPLEGOAL, 500, seed=9).returns.mean() for policy in policies)
    assert after > before + 1


@pytest.mark.parametrize("penalty", [0.0, 1000.0])
def test_a_failure_costs_a_tuning_its_penalty(monkeypatch, penalty):
    told, still = [], ScaledCells(np.zeros((1, 2)), np.zeros((1, 3, 2)))
    search = types.SimpleNamespace(ask=lambda: [still.vector], tell=lambda vectors, costs: told.extend(costs))
    monkeypatch.setattr("vsp_beyond.few_cells.tune.cma_es", lambda *_: search)
    monkeypatch.setattr("vsp_beyond.few_cells.tune.is_snapshot", lambda *_: False)
    config = dataclasses.replace(SMALL, n_generations=1, failure_penalty=penalty)
    assert not list(tune(UNSCALED.policy, UNSCALED.task, still, config, np.random.default_rng(0)))
    assert penalty - 100 < told[0] < penalty + 100


def test_snapshots_are_evenly_spread_and_the_last_generation_is_one():
    assert [i for i in range(7) if is_snapshot(i, 7, 3)] == [2, 4, 6]


# Criticality


@pytest.mark.parametrize(
    ("criticality", "shares"),
    [([0.0, 1.0, 3.0, 0.0], [0, 1 / 4, 3 / 4, 0]), (None, 4 * [1 / 4]), (np.zeros(4), 4 * [1 / 4])],
)
def test_states_are_drawn_in_proportion_to_their_criticality(criticality, shares):
    _, labelled = some(n=4, criticality=criticality if criticality is None else np.array(criticality))
    drawn = np.bincount(labelled.draw(4000, np.random.default_rng(0))(), minlength=4) / 4000
    assert drawn == pytest.approx(np.array(shares), abs=0.03)
    again = np.bincount(labelled.with_more(labelled).draw(4000, np.random.default_rng(0))(), minlength=8) / 4000
    assert again == pytest.approx(np.tile(shares, 2) / 2, abs=0.03)


def test_the_setting_asks_the_teacher_for_its_criticality():
    critical = dataclasses.replace(SMALL, criticality=True)
    teacher = load_teacher(SIMPLEGOAL)
    without, with_it = (distill_tuned(teacher, SIMPLEGOAL, config, seed=0) for config in (SMALL, critical))
    assert without[1]["mean"][0] == with_it[1]["mean"][0] and without[1]["mean"][1] != with_it[1]["mean"][1]
    assert vsp_beyond.tuned(teacher, SIMPLEGOAL, critical, seed=0).to_json() == with_it[0].to_json()
    with pytest.raises(ValueError, match="has no critics"):
        distill_tuned(support.network_teacher(SIMPLEGOAL), SIMPLEGOAL, critical, seed=0)


# All of it


@pytest.fixture(scope="module")
def distilled():
    return distill_tuned(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3)


def test_the_same_arguments_give_the_same_policy(distilled):
    """And the global random numbers are left alone."""
    np.random.seed(5)
    expected = np.random.RandomState(5).random_sample()
    assert vsp_beyond.tuned(CurvedTeacher(), SIMPLEGOAL, SMALL, seed=3).to_json() == distilled[0].to_json()
    assert np.random.random_sample() == expected


def test_the_history_tells_how_it_came_about(distilled):
    policy, history = distilled
    assert history["stage"].tolist() == ["line", "fit", "fit", "correct"] + SMALL.n_generations * ["tune"]
    assert history["restart"].tolist()[:3] == [0, 0, 1] and history["failing"].between(0, 1).all()
    value = history["mean"] - SMALL.failure_penalty * history["failing"]
    assert len(policy) == 3 and history["restart"][3] == history["restart"][value[:3].idxmax()]
    assert (history["restart"][4:] == history["restart"][value[:4].idxmax()]).all()


@pytest.fixture(scope="module")
def plain():
    return distill_tuned(CurvedTeacher(), SIMPLEGOAL, PLAIN, seed=0)[1]


@pytest.mark.parametrize(
    "change",
    [{"n_cells": 2}, {"n_episodes": 30}, {"n_steps": 200}, {"batch_size": 64}, {"learning_rate": 0.01},
     {"initial_temperature": 0.5}, {"final_temperature": 0.01}, {"clip_slope": 0.2}, {"n_corrections": 0},
     {"n_correction_episodes": 20}, {"n_generations": 0}, {"n_tuning_episodes": 40}, {"tuning_step": 0.3},
     {"n_validation": 10}],
)  # fmt: skip
def test_every_setting_acts(plain, change):
    """And 0 switches corrections and tuning off."""
    changed = distill_tuned(CurvedTeacher(), SIMPLEGOAL, dataclasses.replace(PLAIN, **change), seed=0)[1]
    stages = {"n_corrections": ["line", "fit", "tune"], "n_generations": ["line", "fit", "correct"]}
    expected = stages.get(*change) or ["line", "fit", "correct", "tune"]
    assert not plain.equals(changed) and changed["stage"].unique().tolist() == expected


def test_it_works_from_a_policy_that_is_there():
    there = printed.published_policy(SIMPLEGOAL)
    start = VoronoiPolicy(there.codewords, there.coefficients, task=SIMPLEGOAL, metric="euclidean")
    config = dataclasses.replace(SMALL, n_cells=13, n_restarts=1)
    policy, _ = distill_tuned(CurvedTeacher(), SIMPLEGOAL, config, seed=0, start=start)
    near = np.abs(policy.codewords[:, None] - start.codewords).max(axis=2).min(axis=1)
    assert len(policy) == 13 and np.median(near) < 0.15  # codewords move, but not far


def test_the_start_is_a_candidate_and_never_lost(monkeypatch):
    """Every fit gives a policy that does nothing."""
    still = ScaledCells(np.arange(6.0).reshape(3, 2), np.zeros((3, 3, 2)))
    monkeypatch.setattr("vsp_beyond.few_cells.tuned.anneal", lambda *_: still)
    coefficients = np.random.default_rng(0).normal(-1, 0.1, size=(3, 3, 2)) * [[0.0], [0.0], [1.0]]
    codewords, states = np.random.default_rng(1).random((3, 2)), np.random.default_rng(2).random((1000, 2))
    start = VoronoiPolicy(codewords, coefficients, task=SIMPLEGOAL, metric="euclidean", scale=np.array([0.1, 2.0]))
    config = dataclasses.replace(SMALL, n_generations=0)
    policy, history = distill_tuned(CurvedTeacher(), SIMPLEGOAL, config, seed=0, start=start)
    assert history["stage"].tolist() == ["start", "fit", "fit", "correct"] and history["mean"].idxmax() == 0
    assert np.allclose(policy.codewords, start.codewords) and np.allclose(policy.coefficients, start.coefficients)
    assert (policy.cells(states) == start.cells(states)).all()  # borders do not move either


def test_a_task_of_one_start_state_is_no_trouble():
    """All initial codewords would coincide."""
    task = dataclasses.replace(get_task(SIMPLEGOAL), start=lambda rng, n: np.full((n, 2), 0.05))
    assert len(distill_tuned(CurvedTeacher(), task, SMALL, seed=0)[0]) == 3
