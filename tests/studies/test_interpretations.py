import dataclasses
import itertools
from functools import cache
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, TEACHERS, CurvedTeacher, tiny

from studies.reproduction import interpretations
from studies.reproduction.interpretations import distance, landmarks, ranking, study
from vsp.algorithms import distill
from vsp.config import EXTENSIONS, Config, paper_preset
from vsp.evaluation import fences, rollout_from_seed
from vsp.paper import printed
from vsp.paper.readings import ALTERNATIVES, Readings, defaults
from vsp.paper.results import read_results
from vsp.paper.runs import EVALUATION_SEED, N_RUNS, Experiment, load_runs, paper_experiment
from vsp.paper.statistics import resample, spread
from vsp.paper.summaries import LABELS, SHOWN, shown_variants
from vsp.tasks import base, get_task

CHOOSING, CONFIRMING = interpretations.CHOOSING, interpretations.CONFIRMING  # `small` makes them fewer

# What is tried

ALONE = [(number, change) for number, changes in ALTERNATIVES.items() for change in changes]
PRINTED = {*printed.printed_hyperparameters(SIMPLEGOAL)} - {"one_split"}  # T2 prints it, yet it is a reading (R4)


def forgotten(config, readings):
    """Fields of `config` that T2 does not settle and no reading changes, and values of theirs that are not tried."""
    tried = {(name, value) for changes in readings.values() for change in changes for name, value in change.items()}
    missing = []
    for field in dataclasses.fields(config):
        kind, default = get_type_hints(config)[field.name], field.default
        if field.name in PRINTED or field.name in EXTENSIONS:
            continue
        values = get_args(kind) if get_origin(kind) is Literal else (not default,) if kind is bool else ()
        others = [(field.name, value) for value in values if value != default]
        missing += [other for other in others if other not in tried]
        if field.name not in {name for name, _ in tried}:
            missing.append((field.name, "any"))
    return missing


def test_no_reading_is_forgotten():
    assert forgotten(Config, ALTERNATIVES) == forgotten(Readings, ALTERNATIVES) == []


@pytest.mark.parametrize("task", TASKS)
def test_variants_are_experiments_that_differ(task):
    tried = interpretations.variants()
    found = {name: one for (name, other), one in interpretations.experiments(tried).items() if other == task}
    assert list(found) == list(tried) and next(iter(tried)) == "default"
    ids = {one.provenance["settings"] for one in found.values()}
    assert len(ids) == len(found) == 1 + len(ALONE) + 1 + 18
    assert found["default"].provenance == paper_experiment(task).provenance
    for name, change in tried.items():
        answers = defaults(found[name].config) | dataclasses.asdict(found[name].readings or Readings())
        assert answers == defaults(paper_preset(task)) | change


def test_combinations_take_all_their_parts():
    tried = interpretations.variants()
    assert tried["R3 + R4 + R7 zeros"] == {"split_metric": "euclidean", "one_split": True, "initial": "zeros"}
    combined = {frozenset(name.split(" + ")) for name in tried if " + " in name}
    every = {frozenset(c) for size in range(2, 6) for c in itertools.combinations(interpretations.FACTORS, size)}
    assert combined == {chosen for chosen in every if not {"R2", "R4"} <= chosen} and len(every - combined) == 8
    assert all(any(change == factor for _, change in ALONE) for factor in interpretations.FACTORS.values())


def test_after_one_split_the_second_look_up_says_nothing(seed=0):
    """So R2 with R4 is R4 alone."""

    def policies(**changes):
        for lookup in ("kept", "refreshed"):
            config = tiny(n_epochs=60, n_freeze=5, max_pol_loss=1e-3, **changes)
            split = Readings(split_lookup=lookup).split
            policy, _ = distill(CurvedTeacher(), get_task(SIMPLEGOAL), config, seed=seed, split=split)
            yield policy.codewords.tobytes() + policy.coefficients.tobytes()

    kept, refreshed = policies(one_split=True)
    assert kept == refreshed


# How far from the paper


def test_distance_by_hand():
    one, other = {"mean": 1.0, "q1": 0.0, "q3": 2.0, "std": -1.0}, {"mean": 0.0, "q1": 0.0, "q3": 0.0, "std": 1.0}
    assert distance(one, other) == distance(other, one) == pytest.approx(np.sqrt((1 + 0 + 4 + 4) / 4))
    assert distance(one, one) == 0


def test_landmarks_by_hand():
    """SimpleGoal from T5. On MountainCar the bounds 93.313 and 94.130 lie four interquartile ranges apart: 0.20425."""
    assert landmarks(SIMPLEGOAL) == pytest.approx({
        "mean": (12.657 - 16.599) / 3.117, "q1": (12.298 - 16.599) / 3.117, "q3": (17.646 - 16.599) / 3.117,
        "std": np.log(8.436 / 3.117),
    })  # fmt: skip
    found = landmarks(MOUNTAINCAR)
    q1, q3 = 93.313 + 1.5 * 0.20425, 94.130 - 1.5 * 0.20425
    assert fences(q1, q3) == pytest.approx((93.313, 94.130))
    assert found == pytest.approx({
        "mean": (93.534 - 93.481) / 0.075, "q1": (q1 - 93.481) / 0.075, "q3": (q3 - 93.481) / 0.075,
        "std": np.log(1.345 / 0.075),
    })  # fmt: skip
    assert found["q1"] > 0  # not T6's quartiles, which repeat the teacher's


# The study

TINY = tiny(n_epochs=30, n_freeze=5)
FEW = {"choosing": range(2), "confirming": range(10, 13)}  # seeds
TRIED = {"default": {}, "one split": {"one_split": True}, "zeros": {"initial": "zeros"}, "box": {"scale": "box"}}


@cache
def teacher_outcomes(task):
    return rollout_from_seed(TEACHERS[task], task, seed=EVALUATION_SEED)


def fewer_resamples(returns, *, n_resamples):
    assert n_resamples == interpretations.N_RESAMPLES == 1000
    return resample(returns, n_resamples=100)


@pytest.fixture(scope="module")
def small():
    """The study with tiny runs of a few seeds, 100 resamples, and one variant confirmed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interpretations, "CHOOSING", FEW["choosing"])
        patch.setattr(interpretations, "CONFIRMING", FEW["confirming"])
        patch.setattr(interpretations, "N_CONFIRMED", 1)
        patch.setattr(interpretations, "paper_experiment", lambda task: Experiment(task, TINY, TEACHERS[task], 20))
        patch.setattr(interpretations, "rollout_from_seed", lambda teacher, task, *, seed: teacher_outcomes(task))
        patch.setattr(interpretations, "resample", fewer_resamples)
        yield patch


@pytest.fixture(scope="module")
def made(small, tmp_path_factory):
    runs = tmp_path_factory.mktemp("study")
    return runs, study(runs, tried=TRIED)


def test_the_study_has_a_row_per_phase_variant_and_task(made):
    frame = made[1]
    chosen, confirmed = (frame[frame["phase"] == phase] for phase in ("choosing", "confirming"))
    assert len(chosen) + len(confirmed) == len(frame)
    assert not frame.duplicated(["phase", "variant", "task"]).any() and set(frame["task"]) == {*TASKS, "both"}
    assert list(dict.fromkeys(chosen["variant"])) == list(TRIED)
    first = next(name for name in ranking(chosen) if name != "default")
    nearest = {"default", first, *(ranking(chosen, task)[0] for task in TASKS)}
    assert set(confirmed["variant"]) == nearest and len(chosen) == 3 * 4 and len(confirmed) == 3 * len(nearest)
    single = frame[frame["task"] != "both"]
    assert single["runs"].tolist() == [2] * 8 + [3] * 2 * len(nearest)
    assert frame[frame["task"] == "both"][["settings", "teacher", "version"]].isna().all(axis=None)
    assert set(single["version"]) == {1} and single["settings"].nunique() == len(single)


@pytest.mark.parametrize("best", ["default", "box"])
def test_the_default_is_confirmed_whatever_its_rank(small, made, monkeypatch, best):
    order = [best, *(name for name in TRIED if name != best)]
    monkeypatch.setattr(interpretations, "ranking", lambda frame, task="both": order if task == "both" else order[::-1])
    frame = study(made[0], tried=TRIED)
    confirmed = frame[frame["phase"] == "confirming"]["variant"]
    first = next(name for name in order if name != "default")
    assert list(dict.fromkeys(confirmed)) == ["default", first, order[-1]]  # the nearest of each task too


def played(runs, task, change, seeds):
    experiment = Experiment(task, dataclasses.replace(TINY, **change), TEACHERS[task], 20)
    return experiment, load_runs(experiment, seeds, runs=runs)


@pytest.mark.parametrize(("phase", "seeds"), FEW.items())
@pytest.mark.parametrize("task", TASKS)
def test_a_row_says_what_its_runs_came_to(made, phase, seeds, task):
    runs, frame = made
    names = ["default", "box"] if phase == "choosing" else ["default"]
    rows = frame[(frame["phase"] == phase) & (frame["task"] == task)].set_index("variant")
    own = spread(teacher_outcomes(task).returns)
    for name in names:
        experiment, found = played(runs, task, TRIED[name], seeds)
        row, returns = rows.loc[name], np.stack([run.outcomes.returns for run in found])
        cells = [len(run.policy) for run in found]
        assert dict(row[["settings", "teacher", "version"]]) == interpretations.provenance_of(experiment, seeds)
        assert row["runs"] == len(seeds)
        assert (row["cells"], row["cells_min"], row["cells_max"]) == (np.mean(cells), min(cells), max(cells))
        facts = spread(returns)
        for name in ("mean", "std", "q1", "median", "q3"):
            assert row[name] == pytest.approx(facts[name])
        drawn = resample(returns, n_resamples=100)
        assert (row["mean_low"], row["mean_high"]) == pytest.approx(tuple(drawn["mean"].quantile([0.025, 0.975])))
        assert row[["goal", "pit", "truncated"]].sum() == pytest.approx(1)
        assert row["pit"] == np.mean([run.outcomes.outcomes == base.PIT for run in found])
        assert row["runs_above_teacher"] == np.mean(returns.mean(axis=1) > own["mean"])
        assert row["distance"] == pytest.approx(distance(interpretations.standing(facts, own), landmarks(task)))
        away = [distance(interpretations.standing(one, own), landmarks(task)) for one in drawn.to_dict("records")]
        assert (row["distance_low"], row["distance_high"]) == pytest.approx(np.percentile(away, [2.5, 97.5]))


def test_distances_of_both_tasks_are_averaged_and_gaps_are_to_the_default(made):
    for _, rows in made[1].groupby("phase"):
        joint = rows[rows["task"] == "both"].set_index("variant")
        each = rows[rows["task"] != "both"].groupby("variant")["distance"].mean()
        assert joint["distance"].to_dict() == pytest.approx(each.to_dict())
        assert joint["gap"].to_dict() == pytest.approx((each - each["default"]).to_dict())
        assert (joint.loc["default", ["gap", "gap_low", "gap_high"]] == 0).all()
        assert (joint["gap_low"] <= joint["gap_high"]).all()
        assert rows[rows["task"] != "both"]["gap"].isna().all()


def test_seeds_that_rank_are_not_those_that_check():
    seeds = [*CHOOSING, *CONFIRMING, *range(max(N_RUNS.values()))]
    assert len(set(seeds)) == len(seeds) and min(len(CHOOSING), len(CONFIRMING)) >= 10


# What is shown

FRAME = pd.DataFrame(
    [
        ("choosing", "default", "both", 2.0, 1.5, 2.5), ("choosing", "default", SIMPLEGOAL, 1.0, 0.9, 1.1),
        ("choosing", "a", "both", 3.0, 2.5, 3.5), ("choosing", "a", SIMPLEGOAL, 0.5, 0.4, 0.6),
        ("choosing", "b", "both", 1.0, 0.5, 1.5), ("choosing", "b", SIMPLEGOAL, 1.5, 1.4, 1.6),
        ("confirming", "default", "both", 7.0, 6.0, 9.0), ("confirming", "a", "both", 8.0, 7.0, 9.0),
    ],
    columns=["phase", "variant", "task", "distance", "distance_low", "distance_high"],
)  # fmt: skip


def test_the_ranking_goes_by_the_distance():
    chosen = FRAME[FRAME["phase"] == "choosing"]
    assert ranking(chosen) == ["b", "default", "a"] and ranking(chosen, SIMPLEGOAL) == ["a", "default", "b"]
    tied = chosen.assign(distance=1.0)
    assert ranking(tied) == ["default", "a", "b"]  # as they were tried


@pytest.fixture(scope="module")
def committed():
    return read_results("readings")


def test_what_is_shown_is_that_of_the_phase_and_has_names_in_words(committed):
    for task in TASKS:
        found = shown_variants(committed, task)
        assert found.columns.tolist() == ["here", "low", "high", "cells", "failed (%)"]
        assert found.index.tolist() == list(SHOWN.values())
        chosen = committed[(committed["phase"] == "choosing") & (committed["task"] == task)].set_index("variant")
        for variant, words in SHOWN.items():
            row = chosen.loc[variant]
            assert found.loc[words].tolist()[:4] == row[["mean", "mean_low", "mean_high", "cells"]].tolist()
            assert found.at[words, "failed (%)"] == pytest.approx(100 * (row["pit"] + row["truncated"]))
        assert shown_variants(committed, task, "confirming")["here"].isna().any()


def test_the_extremes_are_shown_and_all_that_ran_again_has_a_label(committed):
    alone = committed[(committed["phase"] == "choosing") & ~committed["variant"].str.contains(r" \+ ")]
    assert {alone[alone["task"] == task].set_index("variant")["mean"].idxmin() for task in TASKS} <= set(SHOWN)
    assert set(committed[committed["phase"] == "confirming"]["variant"]) <= set(LABELS)
