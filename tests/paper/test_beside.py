import dataclasses

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, CurvedTeacher, PumpingTeacher, tiny

from vsp import algorithms, distill
from vsp.evaluation import evaluate, rollout_from_seed
from vsp.paper import beside, printed
from vsp.paper.baselines import Tree, kmeans_cells, linear_map, refit, rule_of_thumb
from vsp.paper.beside import LEAVES, compare_simpler, fit, kept_comparison, teacher_data
from vsp.paper.runs import EVALUATION_SEED, Experiment, Results, make_runs
from vsp.paper.statistics import crossed_interval
from vsp.partition import Partition
from vsp.tasks.base import GOAL

CONFIG = tiny(n_epochs=30, n_freeze=5)
TEACHERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}


def experiment(task=SIMPLEGOAL, **changes):
    return Experiment(task, dataclasses.replace(CONFIG, **changes), TEACHERS[task], n_episodes=50)


# Their data


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("inclusive", [False, True])
def test_baselines_see_what_a_distillation_sees(task, inclusive, monkeypatch):
    monkeypatch.setattr(algorithms, "EPISODES_AHEAD", 8)  # several batches, the last one cut
    one, seen, observe = experiment(task, inclusive=inclusive), [], Partition.observe
    monkeypatch.setattr(Partition, "observe", lambda self, episode: (seen.append(episode), observe(self, episode))[1])
    distill(one.teacher, task, one.config, seed=5)
    states, actions = teacher_data(one, 5)
    assert len(seen) == 30 + inclusive
    assert np.array_equal(states, np.concatenate([e.states for e in seen]))
    assert np.array_equal(actions, np.concatenate([e.actions for e in seen]))
    assert len(states) == len(actions) > 3 * len(seen)


FITTED = [
    "one linear map", "tree, 13 leaves", "tree, 32 leaves", "same cells, least squares", "same cells, constants",
    "k-means cells",
]  # fmt: skip


def test_the_baselines_of_a_run_are_fitted_on_its_data(tmp_path):
    (run,) = make_runs(experiment(), [3], runs=tmp_path)
    states, actions = teacher_data(experiment(), 3)
    found, asked = fit(experiment(), run), np.random.default_rng(0).random((50, 2))
    assert list(found) == FITTED and LEAVES == (13, 32)
    expected = [linear_map(states, actions, SIMPLEGOAL), *(Tree(states, actions, leaves=n) for n in LEAVES)]
    expected += [refit(run.policy, states, actions), refit(run.policy, states, actions, constant=True)]
    expected += [kmeans_cells(states, actions, cells=len(run.policy), task=SIMPLEGOAL, seed=3)]
    for policy, same in zip(found.values(), expected, strict=True):
        assert np.array_equal(policy.predict(asked)[0], same.predict(asked)[0])


# All of them side by side


@pytest.fixture(scope="module", params=TASKS)
def compared(request, tmp_path_factory):
    one = experiment(request.param)
    runs = make_runs(one, range(3), runs=tmp_path_factory.mktemp("runs"))
    result = Results(one, runs, rollout_from_seed(one.teacher, one.task, 50, seed=EVALUATION_SEED))
    return result, compare_simpler(result, n_runs=2)


def test_kinds_and_how_many_there_are_of_each(compared):
    result, frame = compared
    assert frame["policies"].to_dict() == {
        "teacher (TD3)": 1, rule_of_thumb(result.experiment.task)[0]: 1, "published policy": 1,
        **dict.fromkeys(FITTED, 2), "distilled, all runs": 3, "distilled, best run": 1,
    }  # fmt: skip
    assert frame["mean"].is_monotonic_decreasing and frame["mean"].nunique() > 4  # the best first
    assert frame.columns.tolist() == ["policies", "cells", "mean", "gap", "low", "high", "std", "failing"]


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
    assert (row["low"], row["high"]) == pytest.approx(crossed_interval(gaps))


def test_numbers_of_single_policies_by_hand(compared):
    result, frame = compared
    task = result.experiment.task
    name, rule = rule_of_thumb(task)
    policies = {name: rule, "published policy": printed.published_policy(task), "teacher (TD3)": TEACHERS[task]}
    for kind, policy in {**policies, "distilled, best run": result.best.policy}.items():
        assert_row(frame.loc[kind], *by_hand([policy], task), result)
    assert (frame.loc["teacher (TD3)", ["gap", "low", "high"]] == 0).all()
    ends = np.where(result.outcomes == GOAL, "goal", "none")
    assert_row(frame.loc["distilled, all runs"], result.returns, ends, result)


def test_every_run_brings_one_policy_of_each_fitted_kind(compared, monkeypatch):
    result, _ = compared
    asked, rule = [], rule_of_thumb(result.experiment.task)[1]
    monkeypatch.setattr(beside, "fit", lambda experiment, run: asked.append(run.seed) or {"one linear map": rule})
    frame = compare_simpler(result, n_runs=2)
    assert asked == [0, 1] and frame.at["one linear map", "policies"] == 2 and "tree, 13 leaves" not in frame.index
    many = dataclasses.replace(result, runs=[dataclasses.replace(result.runs[0], seed=seed) for seed in range(25)])
    asked.clear()
    assert compare_simpler(many).at["one linear map", "policies"] == 20 and asked == list(range(20))


def test_a_comparison_is_kept_beside_the_runs(compared, tmp_path, monkeypatch):
    result, frame = compared
    pd.testing.assert_frame_equal(kept_comparison(result, 2, runs=tmp_path, jobs=1), frame)
    monkeypatch.setattr(beside, "compare_simpler", None)  # what is kept is not made again
    pd.testing.assert_frame_equal(kept_comparison(result, 2, runs=tmp_path, jobs=1), frame)
