import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, tiny

from studies.make_teachers import SHORT_SEEDS
from studies.reproduction import teachers as teachers_module
from studies.reproduction.simpler import teacher_data
from studies.reproduction.teachers import experiments, linear_error, study, teachers
from vsp.evaluation import rollout_from_seed
from vsp.paper import runs
from vsp.paper.runs import EVALUATION_SEED, Experiment, load_runs, paper_experiment
from vsp.paper.summaries import teacher_summary
from vsp.tasks import base
from vsp.teachers.teacher import SHIPPED, load_teacher

# Teachers


@pytest.mark.parametrize("task", TASKS)
def test_teachers_are_the_shipped_one_and_the_short_ones(task):
    found = teachers(task)
    assert list(found) == ["shipped", *(f"seed {seed}" for seed in SHORT_SEEDS[task])]
    assert found["shipped"] == SHIPPED / f"{task}.safetensors"
    for seed in SHORT_SEEDS[task]:
        card = load_teacher(found[f"seed {seed}"]).card
        assert (card["task"], card["seed"]) == (task, seed)
    assert len({load_teacher(path).digest for path in found.values()}) == len(found)


def test_every_teacher_has_the_papers_experiment():
    found = experiments()
    assert set(found) == {(task, name) for task in TASKS for name in teachers(task)}
    for (task, name), experiment in found.items():
        usual = paper_experiment(task)
        assert (experiment.task, experiment.config, experiment.n_episodes) == (task, usual.config, usual.n_episodes)
        assert experiment.teacher.digest == load_teacher(teachers(task)[name]).digest
        assert (experiment.provenance == usual.provenance) == (name == "shipped")
    assert list(experiments([MOUNTAINCAR])) == [key for key in found if key[0] == MOUNTAINCAR]


def test_the_error_of_a_linear_map_is_that_of_the_regression():
    experiment = Experiment(SIMPLEGOAL, tiny(n_epochs=30, n_freeze=5), load_teacher(SIMPLEGOAL), n_episodes=20)
    states, actions = teacher_data(experiment, 1000)
    errors = LinearRegression().fit(states, actions).predict(states) - actions
    assert linear_error(experiment) == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert 0 < linear_error(experiment) < np.sqrt(np.mean((actions - actions.mean(axis=0)) ** 2))


# The study

TINY = tiny(n_epochs=30, n_freeze=5)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(teachers_module, "SEEDS", range(2))
    monkeypatch.setattr(
        teachers_module, "paper_experiment", lambda task: Experiment(task, TINY, load_teacher(task), n_episodes=20)
    )


def test_the_study_has_a_row_per_run(small, tmp_path, monkeypatch):
    frame = study(tmp_path, tasks=[SIMPLEGOAL])
    names = ["shipped", *(f"seed {seed}" for seed in SHORT_SEEDS[SIMPLEGOAL])]
    assert frame["teacher"].tolist() == [name for name in names for _ in range(2)]
    assert frame["seed"].tolist() == [0, 1] * len(names)
    for (task, name), experiment in experiments([SIMPLEGOAL]).items():
        own = rollout_from_seed(experiment.teacher, task, 1000, seed=EVALUATION_SEED).returns
        rows = frame[frame["teacher"] == name]
        for row, run in zip(rows.to_dict("records"), load_runs(experiment, range(2), runs=tmp_path), strict=True):
            assert (row["task"], row["seed"], row["cells"]) == (task, run.seed, len(run.policy))
            assert teachers_module.provenance_of(experiment) == {
                "settings": row["settings"], "teacher": row["checksum"], "version": row["version"]
            }  # fmt: skip
            steps, error = experiment.teacher.card["recipe"]["steps"], linear_error(experiment)
            assert (row["steps"], row["linear_error"]) == (steps, error)
            returns = run.outcomes.returns
            assert (row["mean"], row["std"]) == pytest.approx((returns.mean(), np.std(returns, ddof=1)))
            assert (row["teacher_mean"], row["teacher_std"]) == pytest.approx((own.mean(), np.std(own, ddof=1)))
            assert row["goal"] + row["pit"] + row["truncated"] == pytest.approx(1)
            assert row["goal"] == np.mean(run.outcomes.outcomes == base.GOAL)
    assert frame["mean"].nunique() == len(frame)

    def never(*args):
        raise AssertionError("made again")

    monkeypatch.setattr(runs.Distillation, "make", never)
    assert study(tmp_path, tasks=[SIMPLEGOAL]).equals(frame)


def test_the_summary_by_hand():
    frame = pd.DataFrame(
        {
            "task": "t", "teacher": ["b", "b", "a", "a"], "steps": [9, 9, 8, 8], "linear_error": [0.5, 0.5, 0.3, 0.3],
            "teacher_mean": [5.0, 5, 7, 7], "teacher_std": [1.0, 1, 2, 2],
            "mean": [4.0, 6, 1, 1], "cells": [10, 13, 4, 4], "goal": [0.5, 1, 1, 1],
        }
    )  # fmt: skip
    found = teacher_summary(frame).set_index("teacher")
    assert found.index.tolist() == ["b", "a"] and set(found["task"]) == {"t"}
    columns = ["steps", "linear_error", "teacher_mean", "teacher_std", "mean"]
    columns += ["deviation between runs", "cells", "failing"]
    assert found.columns.tolist() == ["task", *columns]
    assert found.loc["b", columns].tolist() == pytest.approx([9, 0.5, 5, 1, 5, 2**0.5, 11.5, 0.25])
    assert found.loc["a", columns].tolist() == [8, 0.3, 7, 2, 1, 0, 4, 0]
