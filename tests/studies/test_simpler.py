import dataclasses

import numpy as np
import pandas as pd
import pytest
from support import SIMPLEGOAL, TASKS, TEACHERS, called, tiny

from studies import make_study
from studies.reproduction import simpler, verdicts
from studies.reproduction.simpler import LEAVES, compare_simpler, fit, teacher_data
from vsp import Partition, algorithms, distill
from vsp.evaluation import evaluate, rollout_from_seed
from vsp.paper import printed, read_results
from vsp.paper.baselines import Tree, kmeans_cells, linear_map, refit, rule_of_thumb
from vsp.paper.runs import EVALUATION_SEED, Experiment, Results, make_runs
from vsp.protocol import crossed_interval

CONFIG = tiny(n_epochs=30, n_freeze=5)
FITTED = [
    "one linear map", "tree, 13 leaves", "tree, 32 leaves", "same cells, least squares", "same cells, constants",
    "k-means cells",
]  # fmt: skip


def experiment(task=SIMPLEGOAL, **changes):
    return Experiment(task, dataclasses.replace(CONFIG, **changes), TEACHERS[task], n_episodes=50)


@pytest.mark.parametrize("inclusive", [False, True])
def test_simpler_policies_see_what_a_distillation_sees(inclusive, monkeypatch):
    monkeypatch.setattr(algorithms, "EPISODES_AHEAD", 8)  # several batches, the last one cut
    one, seen, observe = experiment(inclusive=inclusive), [], Partition.observe
    monkeypatch.setattr(Partition, "observe", lambda self, episode: (seen.append(episode), observe(self, episode))[1])
    distill(one.teacher, SIMPLEGOAL, one.config, seed=5)
    states, actions = teacher_data(one, 5)
    assert len(seen) == 30 + inclusive
    assert np.array_equal(states, np.concatenate([e.states for e in seen]))
    assert np.array_equal(actions, np.concatenate([e.actions for e in seen]))


def test_the_simpler_policies_of_a_run_are_fitted_on_its_data(tmp_path):
    (run,) = make_runs(experiment(), [3], runs=tmp_path)
    states, actions = teacher_data(experiment(), 3)
    fitted, asked = fit(experiment(), run), np.random.default_rng(0).random((50, 2))
    assert list(fitted) == FITTED and LEAVES == (13, 32)
    expected = [linear_map(states, actions, SIMPLEGOAL), *(Tree(states, actions, leaves=n) for n in LEAVES)]
    expected += [refit(run.policy, states, actions), refit(run.policy, states, actions, constant=True)]
    expected += [kmeans_cells(states, actions, cells=len(run.policy), task=SIMPLEGOAL, seed=3)]
    for policy, same in zip(fitted.values(), expected, strict=True):
        assert np.array_equal(policy.predict(asked)[0], same.predict(asked)[0])


@pytest.fixture(scope="module", params=TASKS)
def compared(request, tmp_path_factory):
    one = experiment(request.param)
    runs = make_runs(one, range(3), runs=tmp_path_factory.mktemp("runs"))
    result = Results(one, runs, rollout_from_seed(one.teacher, one.task, 50, seed=EVALUATION_SEED))
    return result, compare_simpler(result, n_runs=2)


def test_every_kind_of_policy_has_its_row_by_hand(compared):
    """Two routes: `evaluate` from the shared starts, one policy after the other."""
    result, frame = compared
    one, task = result.experiment, result.experiment.task
    name, rule = rule_of_thumb(task)
    policies = {name: [rule], "published policy": [printed.published_policy(task)], "teacher (TD3)": [one.teacher]}
    policies["distilled, best run"] = [result.best.policy]
    policies["distilled, all runs"] = [run.policy for run in result.runs]
    fitted = [fit(one, run) for run in result.runs[:2]]
    policies |= {kind: [of_run[kind] for of_run in fitted] for kind in FITTED}
    assert set(frame.index) == set(policies) and frame["mean"].is_monotonic_decreasing
    for kind, members in policies.items():
        played, row = [evaluate(policy, task, 50, seed=EVALUATION_SEED) for policy in members], frame.loc[kind]
        returns, ends = (np.stack([frame[column] for frame in played]) for column in ("return", "outcome"))
        gaps = returns - result.teacher_returns
        numbers = returns.mean(), gaps.mean(), np.std(returns, ddof=1), *crossed_interval(gaps)
        assert row[["mean", "gap", "std", "low", "high"]].tolist() == pytest.approx(numbers)
        assert row["failing"] == pytest.approx(1 - np.mean(ends == "goal")) and row["policies"] == len(members)
        if kind != "teacher (TD3)":
            assert row["cells"] == np.mean([len(policy) for policy in members])
    assert np.isnan(frame.at["teacher (TD3)", "cells"])


# The committed table, and the command that makes it


def test_make_study_writes_every_table_and_keeps_all_digits_of_the_comparison(tmp_path, monkeypatch):
    asked, frame = [], pd.DataFrame({"a": [0.1 + 0.2]})
    for study in (simpler, verdicts):
        monkeypatch.setattr(study, "study", lambda runs, *, jobs: asked.append((runs, jobs)) or frame)
    called(make_study.main, "--out", tmp_path, "--jobs", 3)
    assert asked == [(tmp_path / "data/runs", 3), (tmp_path / "build/study", 3)]
    folder = tmp_path / "data" / "results"
    written = [read_results(name, folder)["a"].item() for name in ("simpler", "verdicts")]
    assert written == [0.1 + 0.2, 0.3]
