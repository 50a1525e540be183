import dataclasses
import functools
import importlib
import types

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS, CurvedTeacher, PumpingTeacher, examples, tiny

from vsp import baselines, paper
from vsp.baselines import (
    LEAVES,
    Heuristic,
    PumpAndBalance,
    Still,
    compare,
    dagger,
    fit,
    kept_comparison,
    kmeans_cells,
    linear_map,
    refit,
    rule_of_thumb,
    teacher_data,
)
from vsp.config import Refinement
from vsp.distill import distill
from vsp.envs import GOAL, get_task
from vsp.evaluate import evaluate, interval, outcomes
from vsp.experiments import EVALUATION_SEED, Experiment, Results, make_runs
from vsp.partition import Partition
from vsp.policy import VoronoiPolicy
from vsp.rollouts import record
from vsp.trees import Tree

module = importlib.import_module("vsp.distill")  # `vsp.distill` is the function
CONFIG = tiny(n_epochs=30, n_freeze=5)
TEACHERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}


def experiment(task=SIMPLEGOAL, **changes):
    return Experiment(task, dataclasses.replace(CONFIG, **changes), TEACHERS[task], n_episodes=50)


# One linear map


@pytest.mark.parametrize("task", TASKS)
def test_a_linear_teacher_is_found_exactly(task):
    states, _ = examples(task)
    m = len(get_task(task).action_low)
    coefficients = np.arange(1.0, 1 + 3 * m).reshape(3, m) / 10
    policy = linear_map(states, states @ coefficients[:-1] + coefficients[-1], task)
    assert len(policy) == 1 and policy.codewords[0] == pytest.approx(states.mean(axis=0))
    assert np.allclose(policy.coefficients[0], coefficients, atol=1e-10)


@pytest.mark.parametrize("task", TASKS)
def test_the_linear_map_is_that_of_least_squares(task):
    states, actions = examples(task)
    policy, model = linear_map(states, actions, task), LinearRegression().fit(states, actions)
    assert np.allclose(policy.coefficients[0, :-1], model.coef_.T) and np.allclose(
        policy.coefficients[0, -1], model.intercept_
    )
    error = np.sum((policy.linear(states) - actions) ** 2)
    for change in np.eye(3 * actions.shape[1]) * 1e-3:  # no step in any direction does better
        moved = policy.coefficients[0] + change.reshape(policy.coefficients[0].shape)
        assert np.sum((states @ moved[:-1] + moved[-1] - actions) ** 2) > error


def test_the_linear_map_acts_within_the_limits():
    states, _ = examples(SIMPLEGOAL)
    policy = linear_map(states, np.column_stack([6 * states[:, 0] - 3, np.full(300, -2.0)]), SIMPLEGOAL)
    actions, _ = policy.predict(np.array([[0.0, 0.5], [0.6, 0.5], [1.0, 0.1]]))
    assert np.allclose(actions, [[-1, -1], [0.6, -1], [1, -1]])


# Cells of k-means, and DAgger


def test_cells_of_kmeans_stand_where_the_states_are():
    rng = np.random.default_rng(0)
    groups = np.array([[0.2, 0.2], [0.8, 0.2], [0.5, 0.9]])
    states = np.concatenate([group + 0.02 * rng.normal(size=(100, 2)) for group in groups])
    actions = np.repeat([[0.1, -0.5], [0.7, 0.2], [-0.3, 0.9]], 100, axis=0)
    policy = kmeans_cells(states, actions, cells=3, task=SIMPLEGOAL, seed=0)
    near = policy.codewords[np.square(groups[:, None] - policy.codewords).sum(axis=2).argmin(axis=1)]
    assert np.abs(near - groups).max() < 0.01 and np.allclose(policy.predict(states)[0], actions)
    again, other = (kmeans_cells(*examples(SIMPLEGOAL), cells=9, task=SIMPLEGOAL, seed=seed) for seed in (1, 2))
    assert not np.array_equal(again.codewords, other.codewords)


BUDGET = Refinement(n_cells=1, n_episodes=20, n_corrections=2, n_correction_episodes=10, n_validation=50)


def test_dagger_labels_the_states_that_the_policy_visits():
    seen = []

    def fit(states, actions):
        seen.append((states, actions))
        return Tree(states, actions, leaves=3)

    teacher = TEACHERS[SIMPLEGOAL]
    dagger([fit], teacher, SIMPLEGOAL, config=BUDGET, seed=0)
    assert len(seen) == 3 and all(np.array_equal(a, teacher.predict(s)[0]) for s, a in seen)
    for (fewer, _), (more, _) in zip(seen, seen[1:]):
        assert np.array_equal(more[: len(fewer)], fewer) and len(more) > len(fewer) + 10
    own = Tree(*seen[0], leaves=3)
    rng = np.random.default_rng(np.random.SeedSequence(0).spawn(2)[0])
    task = get_task(SIMPLEGOAL)
    task.start(rng, 20)
    on_its_way = [episode.states for episode in record(own, task, task.start(rng, 10))]
    assert np.array_equal(seen[1][0][len(seen[0][0]) :], np.concatenate(on_its_way))


def test_dagger_keeps_the_best_on_the_validation_starts():
    gains = iter([5.0, -40.0, 40.0])  # pumping, braking, pumping hard

    def fit(states, actions):
        return VoronoiPolicy(np.zeros((1, 2)), [[[0.0], [next(gains)], [0.0]]], task=MOUNTAINCAR)

    kept = dagger([fit], TEACHERS[MOUNTAINCAR], MOUNTAINCAR, config=BUDGET, seed=0)
    assert kept.coefficients[0, 1, 0] == 40.0
    gains = iter([12.0, -40.0, 40.0])
    assert dagger([fit], TEACHERS[MOUNTAINCAR], MOUNTAINCAR, config=BUDGET, seed=0).coefficients[0, 1, 0] == 12.0


def test_of_several_fits_the_one_with_the_best_beginning_goes_on():
    made = []

    def fit(states, actions, *, gain):
        made.append(gain)
        return VoronoiPolicy(np.zeros((1, 2)), [[[0.0], [gain], [0.0]]], task=MOUNTAINCAR)

    fits = [functools.partial(fit, gain=gain) for gain in (-40.0, 40.0, 0.0)]
    kept = dagger(fits, TEACHERS[MOUNTAINCAR], MOUNTAINCAR, config=BUDGET, seed=0)
    assert made == [-40.0, 40.0, 0.0, 40.0, 40.0] and kept.coefficients[0, 1, 0] == 40.0


# Rules of thumb


def test_the_rule_of_thumb_of_simplegoal_by_hand():
    name, policy = rule_of_thumb(SIMPLEGOAL)
    actions, _ = policy.predict(np.array([[0.0, 0.0], [0.9, 0.2], [0.5, 1.0]]))
    assert name == "always (−1, −1)" and (actions == -1).all() and len(policy) == 1


def test_the_pendulum_is_pumped_and_balanced_by_hand():
    """Hanging still it has 10 J too little and is pushed along; near upright it is pushed back; never beyond 2."""
    obs = np.array([[-1.0, 0.0, 0.1], [-1.0, 0.0, -0.1], [1.0, 0.05, 0.2], [0.0, 1.0, 5.5]])
    actions = PumpAndBalance().predict(obs)[0].ravel()
    assert actions[:2].tolist() == [2.0, -2.0]
    assert actions[2:] == pytest.approx([-10 * 0.05 - 2 * 0.2, -2 * (5.5**2 / 6 - 5)])


def test_the_pendulum_is_held_upright():
    frame = evaluate(PumpAndBalance(), PENDULUM, 500, seed=30)
    assert -160 < frame["return"].mean() < -140


def test_no_teacher_does_nothing():
    assert Still(get_task(SIMPLEGOAL)).predict(np.ones((3, 2)))[0].tolist() == [[0.0, 0.0]] * 3


def test_the_rule_of_thumb_of_mountaincar_by_hand():
    name, policy = rule_of_thumb(MOUNTAINCAR)
    actions, _ = policy.predict(np.array([[-0.5, 0.0], [0.3, 0.05], [-1.2, -0.07], [0.6, 0.07]]))
    assert name == "12 · velocity" and np.allclose(actions, [[0], [0.6], [-0.84], [0.84]])


def test_rules_of_thumb_do_what_is_said_of_them():
    frame = evaluate(rule_of_thumb(MOUNTAINCAR)[1], MOUNTAINCAR, 200, seed=30)
    assert frame["return"].mean() > 97 and (frame["outcome"] == "goal").all()
    frame = evaluate(rule_of_thumb(SIMPLEGOAL)[1], SIMPLEGOAL, 200, seed=30)
    assert set(frame["outcome"]) == {"goal", "pit"} and 0.05 < (frame["outcome"] == "pit").mean() < 0.3


def test_the_heuristic_is_that_of_gymnasium():
    lunar_lander = pytest.importorskip("gymnasium.envs.box2d.lunar_lander")
    observations = np.random.default_rng(0).normal(0, 0.5, size=(500, 8)).astype(np.float32)
    observations[:, 6:] = observations[:, 6:] > 0.4
    env = types.SimpleNamespace(unwrapped=types.SimpleNamespace(continuous=True))
    expected = np.array([lunar_lander.heuristic(env, one) for one in observations])
    actions, state = Heuristic().predict(observations)
    assert np.allclose(actions, expected, atol=1e-6) and state is None and actions.dtype == np.float64
    assert 0 < observations[:, 6:].any(axis=1).mean() < 1 and len(np.unique(actions)) > 100


def test_the_heuristic_by_hand():
    falling = [0.2, 1.0, 0.0, -0.1, 0.0, 0.1, 0.0, 0.0]
    actions, _ = Heuristic().predict(np.array([falling, [*falling[:6], 1.0, 0.0]]))
    lift, turn = 0.5 * (0.55 * 0.2 - 1.0) + 0.05, 0.5 * 0.1 - 0.1
    assert np.allclose(actions, [[max(-1, 20 * lift - 1), -20 * turn], [20 * 0.05 - 1, 0.0]])


# Their data


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("inclusive", [False, True])
def test_baselines_see_what_a_distillation_sees(task, inclusive, monkeypatch):
    monkeypatch.setattr(module, "EPISODES_AHEAD", 8)  # several batches, the last one cut
    one, seen, observe = experiment(task, inclusive=inclusive), [], Partition.observe
    monkeypatch.setattr(Partition, "observe", lambda self, episode: (seen.append(episode), observe(self, episode))[1])
    distill(one.teacher, task, one.config, seed=5)
    states, actions = teacher_data(one, 5)
    assert len(seen) == 30 + inclusive
    assert np.array_equal(states, np.concatenate([e.states for e in seen]))
    assert np.array_equal(actions, np.concatenate([e.actions for e in seen]))
    assert len(states) == len(actions) > 3 * len(seen)


def test_other_seeds_bring_other_data():
    (one, _), (same, _), (other, _) = (teacher_data(experiment(), seed) for seed in (1, 1, 2))
    assert np.array_equal(one, same) and not np.array_equal(one[:5], other[:5])


FITTED = [
    "one linear map", "tree, 13 leaves", "tree, 32 leaves", "same cells, least squares", "same cells, constants"
]  # fmt: skip


def test_the_baselines_of_a_run_are_fitted_on_its_data(tmp_path):
    (run,) = make_runs(experiment(), [3], runs=tmp_path)
    states, actions = teacher_data(experiment(), 3)
    found, asked = fit(experiment(), run), np.random.default_rng(0).random((50, 2))
    assert list(found) == FITTED and LEAVES == (13, 32)
    expected = [linear_map(states, actions, SIMPLEGOAL), *(Tree(states, actions, leaves=n) for n in LEAVES)]
    expected += [refit(run.policy, states, actions), refit(run.policy, states, actions, constant=True)]
    for policy, same in zip(found.values(), expected, strict=True):
        assert np.array_equal(policy.predict(asked)[0], same.predict(asked)[0])


def test_leaves_are_the_cells_of_the_printed_partitions():
    assert LEAVES == tuple(int(paper.value(f"{paper.PREFIX[task]}_cells")) for task in TASKS)


# The same cells with other maps


def three_cells(task=SIMPLEGOAL):
    m = len(get_task(task).action_low)
    codewords = np.array([[0.1, 0.1], [0.5, 0.5], [9.0, 9.0]])  # no state is near the last
    return VoronoiPolicy(codewords, np.random.default_rng(1).normal(size=(3, 3, m)), task=task)


def test_refitted_maps_are_those_of_least_squares_in_each_cell():
    policy, (states, actions) = three_cells(), examples(SIMPLEGOAL)
    found, cells = refit(policy, states, actions), policy.cells(states)
    assert set(cells) == {0, 1} and np.array_equal(found.cells(states), cells)
    for i in (0, 1):
        model = LinearRegression().fit(states[cells == i], actions[cells == i])
        assert np.allclose(found.coefficients[i, :-1], model.coef_.T)
        assert np.allclose(found.coefficients[i, -1], model.intercept_)
    assert np.array_equal(found.coefficients[2], policy.coefficients[2])  # an empty cell keeps its map
    assert np.array_equal(policy.coefficients, three_cells().coefficients)  # and the policy is not touched


def test_constants_are_the_mean_action_of_each_cell():
    policy, (states, actions) = three_cells(), examples(SIMPLEGOAL)
    found, cells = refit(policy, states, actions, constant=True), policy.cells(states)
    for i in (0, 1):
        assert np.allclose(found.coefficients[i, :-1], 0)
        assert np.allclose(found.coefficients[i, -1], actions[cells == i].mean(axis=0))


def test_refitting_keeps_the_distance_of_the_lookup():
    policy = VoronoiPolicy(
        np.eye(2), np.zeros((2, 3, 2)), task=SIMPLEGOAL, metric="euclidean", scale=np.array([1.0, 2.0])
    )
    again = refit(policy, *examples(SIMPLEGOAL))
    assert again.metric == "euclidean" and np.array_equal(again.scale, policy.scale)


def test_one_cell_refitted_is_the_linear_map():
    states, actions = examples(MOUNTAINCAR)
    one = VoronoiPolicy(np.zeros((1, 2)), np.ones((1, 3, 1)), task=MOUNTAINCAR)
    same = linear_map(states, actions, MOUNTAINCAR)
    assert np.allclose(refit(one, states, actions).coefficients, same.coefficients)


# Intervals over policies and starts


def test_alike_policies_leave_the_interval_to_the_starts():
    gaps = np.tile(np.random.default_rng(0).normal(1, 2, 400), (20, 1))
    low, high = baselines._crossed_interval(gaps)
    expected = interval(gaps[0][:, None], np.mean, n_resamples=2000)  # the starts alone
    assert (low, high) == pytest.approx(expected, abs=0.03) and high - low > 0.3


def test_alike_starts_leave_the_interval_to_the_policies():
    gaps = np.tile(np.random.default_rng(0).normal(1, 2, (40, 1)), (1, 300))
    assert baselines._crossed_interval(gaps) == pytest.approx(interval(gaps, np.mean, n_resamples=2000), abs=0.1)


def test_the_crossed_interval_is_that_of_drawing_rows_and_columns():
    """The same by hand: an average over drawn policies of an average over drawn starts."""
    gaps, rng = np.random.default_rng(5).normal(size=(4, 30)), np.random.default_rng(1)
    means = [gaps[rng.integers(4, size=4)][:, rng.integers(30, size=30)].mean() for _ in range(4000)]
    assert baselines._crossed_interval(gaps) == pytest.approx(np.percentile(means, [2.5, 97.5]), abs=0.04)
    assert baselines._crossed_interval(gaps) == baselines._crossed_interval(gaps)


# All of them side by side


@pytest.fixture(scope="module", params=TASKS)
def compared(request, tmp_path_factory):
    one = experiment(request.param)
    runs = make_runs(one, range(3), runs=tmp_path_factory.mktemp("runs"))
    result = Results(one, runs, outcomes(one.teacher, one.task, 50, seed=EVALUATION_SEED))
    return result, compare(result, n_runs=2)


def test_kinds_and_how_many_there_are_of_each(compared):
    result, frame = compared
    assert frame["policies"].to_dict() == {
        "teacher (TD3)": 1, rule_of_thumb(result.experiment.task)[0]: 1, "published policy": 1,
        **dict.fromkeys(FITTED, 2), "distilled, all runs": 3, "distilled, best run": 1,
    }  # fmt: skip
    assert frame.columns.tolist() == ["policies", "cells", "mean", "gap", "low", "high", "std", "failing"]


def test_the_best_kind_comes_first_and_lies_in_its_interval(compared):
    _, frame = compared
    assert frame["mean"].is_monotonic_decreasing and frame["mean"].nunique() > 4
    assert (frame["low"] <= frame["gap"]).all() and (frame["gap"] <= frame["high"]).all()


def test_cells_of_all_kinds(compared):
    result, frame = compared
    cells = frame["cells"].to_dict()
    published = {SIMPLEGOAL: 13, MOUNTAINCAR: 32}[result.experiment.task]
    assert np.isnan(cells["teacher (TD3)"]) and cells["one linear map"] == 1 and cells["published policy"] == published
    assert cells["tree, 13 leaves"] <= 13 and cells["tree, 13 leaves"] < cells["tree, 32 leaves"] <= 32
    assert cells["distilled, all runs"] == np.mean([len(run.policy) for run in result.runs])
    assert cells["distilled, best run"] == len(result.best.policy)


def by_hand(policies, task, n=50):
    """Returns and outcomes of several policies from the shared starts, one row each."""
    played = [evaluate(policy, task, n, seed=EVALUATION_SEED) for policy in policies]
    return np.stack([frame["return"] for frame in played]), np.stack([frame["outcome"] for frame in played])


def test_numbers_of_the_fitted_kinds_by_hand(compared):
    result, frame = compared
    one = result.experiment
    fitted = [fit(one, run) for run in result.runs[:2]]
    for kind in FITTED:
        policies = [found[kind] for found in fitted]
        assert_row(frame.loc[kind], *by_hand(policies, one.task), result)
        assert frame.at[kind, "cells"] == np.mean([len(policy) for policy in policies])


def assert_row(row, returns, ends, result):
    gaps = returns - result.teacher_returns
    found = row["mean"], row["gap"], row["std"]
    assert found == pytest.approx((returns.mean(), gaps.mean(), np.std(returns, ddof=1)))
    assert row["failing"] == pytest.approx(1 - np.mean(ends == "goal"))
    assert (row["low"], row["high"]) == pytest.approx(baselines._crossed_interval(gaps))


def test_numbers_of_single_policies_by_hand(compared):
    result, frame = compared
    task = result.experiment.task
    name, rule = rule_of_thumb(task)
    policies = {name: rule, "published policy": paper.published_policy(task), "teacher (TD3)": TEACHERS[task]}
    for kind, policy in {**policies, "distilled, best run": result.best.policy}.items():
        assert_row(frame.loc[kind], *by_hand([policy], task), result)
    assert (frame.loc["teacher (TD3)", ["gap", "low", "high"]] == 0).all()


def test_numbers_of_the_distilled_policies_by_hand(compared):
    result, frame = compared
    row = frame.loc["distilled, all runs"]
    assert row["mean"] == pytest.approx(result.returns.mean())
    assert row["failing"] == pytest.approx(np.mean(result.codes != GOAL))
    gaps = result.returns - result.teacher_returns
    assert (row["low"], row["high"]) == pytest.approx(baselines._crossed_interval(gaps))


def test_every_run_brings_one_policy_of_each_fitted_kind(compared, monkeypatch):
    result, _ = compared
    asked, rule = [], rule_of_thumb(result.experiment.task)[1]
    monkeypatch.setattr(baselines, "fit", lambda experiment, run: asked.append(run.seed) or {"one linear map": rule})
    frame = compare(result, n_runs=2)
    assert asked == [0, 1] and frame.at["one linear map", "policies"] == 2 and "tree, 13 leaves" not in frame.index
    many = dataclasses.replace(result, runs=[dataclasses.replace(result.runs[0], seed=seed) for seed in range(25)])
    asked.clear()
    assert compare(many).at["one linear map", "policies"] == 20 and asked == list(range(20))


def test_a_comparison_is_kept_beside_the_runs(compared, tmp_path, monkeypatch):
    result, frame = compared
    pd.testing.assert_frame_equal(kept_comparison(result, 2, runs=tmp_path), frame)
    monkeypatch.setattr(baselines, "compare", None)  # what is kept is not made again
    pd.testing.assert_frame_equal(kept_comparison(result, 2, runs=tmp_path), frame)
