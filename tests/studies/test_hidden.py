"""The search for hidden settings: the prior, what is near, rows that are kept, and the whole search with tiny runs."""

import dataclasses
from functools import cache, partial
from types import SimpleNamespace
from typing import get_args, get_type_hints

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS

from studies.reproduction import hidden
from vsp import VoronoiPolicy, get_task
from vsp.algorithms import distill
from vsp.config import EXTENSIONS, Config, paper_preset
from vsp.paper import ledger_table, printed, read_results
from vsp.paper.readings import OPEN, Readings, defaults
from vsp.paper.runs import paper_experiment


def test_settings_are_drawn_from_the_prior_with_its_weights():
    assert hidden.setting(0) == {} and hidden.setting(7) == hidden.setting(7) != hidden.setting(8)
    drawn = pd.DataFrame([hidden.setting(k) for k in range(1, 2001)])
    for name, weights in hidden.PRIOR.items():
        shares = drawn[name].value_counts(normalize=True)
        wanted = pd.Series(weights) / sum(weights.values())
        assert shares.to_dict() == pytest.approx(wanted.to_dict(), abs=0.05)


def test_every_answer_of_the_prior_acts(monkeypatch):
    """Each changes the experiment, the default changes nothing, and all of them together are settings of a run."""
    usual = {task: paper_experiment(task).provenance for task in TASKS}
    for task in TASKS:
        assert hidden.experiment({}, task).provenance == usual[task]
        for name, weights in hidden.PRIOR.items():
            found = {tuple(hidden.experiment({name: answer}, task).provenance.values()) for answer in weights}
            assert len(found) == len(weights), name
    assert hidden.experiment({"teacher": 2}, MOUNTAINCAR).teacher.card["score"]["mean"] == 93.512


def test_no_reading_is_forgotten():
    """Every field that T2 does not settle is asked for, and each of its values can be drawn."""
    settled = {*printed.printed_hyperparameters(SIMPLEGOAL), *EXTENSIONS} - {"one_split"}  # T2 prints it; R4 doubts it
    asked = {}
    for settings in (Config, Readings):
        kinds = {name: kind for name, kind in get_type_hints(settings).items() if name not in settled}
        asked |= {name: get_args(kind) or ((False, True) if kind is bool else ()) for name, kind in kinds.items()}
    assert {*asked} == {*OPEN} == {*hidden.PRIOR} - {"teacher"}
    assert all({*values} <= {*hidden.PRIOR[name]} for name, values in asked.items())
    usual = defaults(paper_preset(SIMPLEGOAL))
    assert all(usual[name] in hidden.PRIOR[name] and len(hidden.PRIOR[name]) > 1 for name in OPEN)


def test_a_teacher_that_remembers_gives_the_same_run(monkeypatch):
    one = hidden.experiment({"n_minibatches": 2}, SIMPLEGOAL)
    config, task = dataclasses.replace(one.config, n_epochs=60, n_freeze=10), get_task(SIMPLEGOAL)
    asked = []
    counting = SimpleNamespace(predict=lambda obs: (asked.append(obs), one.teacher.predict(obs))[1])
    monkeypatch.setattr(hidden, "experiment", lambda *_: SimpleNamespace(teacher=counting))
    teacher, digests, counts = hidden._remembered.__wrapped__(SIMPLEGOAL, 0, 3), [], []
    for actor in (one.teacher, teacher, teacher):
        digests.append(distill(actor, task, config, seed=3)[0].digest)
        counts.append(len(asked))
    assert len({*digests}) == 1 and counts[0] == 0 < counts[1] == counts[2]


def test_facts_of_the_paper_are_its_printed_values():
    goal, car = (hidden.printed_facts(task) for task in TASKS)
    of_text = [goal[name] for name in ("mean", "std", "min", "cells", "largest")]
    assert of_text == [12.657, 8.436, -11.79, 13, 5.328]
    assert goal["outliers"] == pytest.approx(100 * 11067 / 85000) and goal["close"] == pytest.approx(1 / 78)
    assert (car["q1"], car["q3"]) == pytest.approx((93.6194, 93.8236), abs=1e-4) and car["largest"] == 3.004
    assert car["close"] == pytest.approx(8 / (32 * 31 / 2)) and car["outliers_below_share"] == 73.19
    assert all(np.isfinite([*facts.values()]).all() for facts in (goal, car))


def test_facts_by_hand():
    policy = VoronoiPolicy([[0.1, 0.1], [0.2, 0.2], [0.9, 0.9]], np.arange(18.0).reshape(3, 3, 2) - 10, task=SIMPLEGOAL)
    returns = np.array([[1.0, 2, 3, 4, 5, 6, 7, 8, 9, -90]])
    found = hidden.facts(SIMPLEGOAL, [policy], returns)
    assert (found["outliers"], found["outliers_mean"], found["min"], found["max"]) == (10.0, -90.0, -90.0, 9.0)
    assert (found["cells"], found["largest"], found["close"]) == (3, 10, pytest.approx(1 / 3))
    assert found["middle"] == np.median(np.abs(np.arange(18.0) - 10))


def test_a_distance_counts_each_value_in_variations_and_caps_it():
    wanted = pd.Series(hidden.printed_facts(SIMPLEGOAL))
    spread = pd.DataFrame({name: np.linspace(-1, 1, 201) for name in wanted.index})  # 16 to 84 %: 0.68 to either side
    rows = pd.DataFrame([wanted, wanted + 0.68, wanted + 1000, wanted]).assign(k=[4, 5, 6, 7])
    rows.loc[3, "outliers_std"] = np.nan
    found = hidden.distances(SIMPLEGOAL, rows.reset_index(drop=True), spread)
    n = len(wanted) - len(hidden.EXTREMES)
    assert found.to_dict() == pytest.approx({4: 0.0, 5: 1.0, 6: hidden.CAP, 7: hidden.CAP / n})


def test_what_is_reached_by_hand():
    names = [*hidden.printed_facts(SIMPLEGOAL)]
    every, best = (pd.DataFrame({name: np.arange(n + 1.0) for name in names}) for n in (200, 40))
    fresh = pd.DataFrame([dict.fromkeys(names, 7.0)], index=["default"])
    found = hidden.reached(SIMPLEGOAL, every, best, fresh).loc["cells"]
    assert found.to_dict() == {
        "paper": 13, "least": 0, "low": 5, "high": 195, "most": 200, "nearest low": 1, "nearest high": 39, "default": 7
    }  # fmt: skip


@pytest.fixture
def small(monkeypatch, tmp_path):
    """Nine settings, runs of 30 iterations, few starts, no committed rows."""

    @cache
    def shorter(task):
        one = paper_experiment(task)
        config = dataclasses.replace(one.config, n_epochs=30, n_freeze=5)
        return dataclasses.replace(one, config=config, n_episodes=20)

    sizes = {"N_SETTINGS": 9, "N_NEAR": 3, "N_NEAR_BOTH": 2, "N_POSTERIOR": 4, "N_CONFIRMED": 1, "_usual": shorter}
    sizes |= {"RESULTS": tmp_path, "N_RUNS": dict.fromkeys(TASKS, 2)}
    sizes["ledger_table"] = partial(ledger_table, n_resamples=20)
    sizes["STAGES"] = {
        "variation": (range(4), 31, 20), "screening": (range(5, 6), 31, 20), "near": (range(6, 8), 32, 20),
        "confirming": (range(8, 10), 33, 20),
    }  # fmt: skip
    for name, value in sizes.items():
        monkeypatch.setattr(hidden, name, value)


def test_a_search_is_made_once_and_selects_on_other_seeds(small, tmp_path, monkeypatch):
    hidden.search(tmp_path, 1)
    results = tmp_path / "data" / "results"
    rows = {task: read_results(f"hidden_{task}", results) for task in TASKS}
    for frame in rows.values():
        assert frame["stage"].value_counts()[["variation", "screening"]].tolist() == [4, 9]
        assert 4 <= (frame["stage"] == "near").sum() <= 6 and frame["settings"].notna().all()
    questions, facts = (read_results(name, results) for name in ("hidden_questions", "hidden_facts"))
    assert len(questions) == sum(map(len, hidden.PRIOR.values()))
    assert questions.groupby("question")["prior"].sum().tolist() == pytest.approx([1.0] * len(hidden.PRIOR))
    reached = read_results("hidden_reached", results).set_index(["task", "name"])
    assert reached.at[(SIMPLEGOAL, "cells"), "paper"] == 13 and not (reached["scale"] <= 0).any()
    assert reached.columns[-3] == "nearest, both"
    assert facts["choice"].unique().tolist()[0] == "default" and len(facts["choice"].unique()) == 4
    before = (results / f"hidden_{SIMPLEGOAL}.csv").read_bytes()
    monkeypatch.setattr(hidden, "tried", None)  # nothing is made again
    hidden.search(tmp_path, 1)
    assert (results / f"hidden_{SIMPLEGOAL}.csv").read_bytes() == before


def test_an_interrupted_search_goes_on_and_other_settings_are_other_rows(small, tmp_path, monkeypatch):
    facts, asked = hidden.printed_facts(SIMPLEGOAL), []

    def tried(task, stage, k):
        asked.append(k)
        if len(asked) == 58:
            raise RuntimeError("stopped")
        return facts | {"mean": k}

    monkeypatch.setattr(hidden, "tried", tried)
    screened = partial(hidden.rows_of, SIMPLEGOAL, "screening", out=tmp_path, jobs=1)
    with pytest.raises(RuntimeError, match="stopped"):
        screened(range(60))
    assert len(read_results(f"hidden_{SIMPLEGOAL}", tmp_path / "data" / "results")) == 50
    rows = screened(range(60))
    assert asked[58:] == [*range(50, 60)] and rows["k"].tolist() == rows["mean"].tolist() == [*range(60)]
    assert screened(range(1, 3))["k"].tolist() == [1, 2]
    monkeypatch.setattr(hidden, "VERSION", 99)
    screened(range(2))
    assert asked[68:] == [0, 1]


def test_answers_are_counted_among_the_nearest(monkeypatch):
    monkeypatch.setattr(hidden, "N_POSTERIOR", 8)
    away = pd.Series(np.arange(20.0), index=np.arange(100, 120))
    found = hidden.questions({SIMPLEGOAL: away, "both": away}).set_index(["question", "answer"]).loc["initial"]
    zeros = [hidden.setting(k)["initial"] == "zeros" for k in away.index]
    assert found[SIMPLEGOAL].tolist() == [1 - np.mean(zeros[:8]), np.mean(zeros[:8])]
    assert found.at["zeros", "both"] == np.mean(zeros[:2])  # of both, a quarter
    assert (found[f"{SIMPLEGOAL}_low"] <= found[SIMPLEGOAL]).all() and found["prior"].tolist() == [0.5, 0.5]


def test_settings_in_words_are_those_that_are_not_the_default():
    assert hidden.in_words(0) == ""
    for k in range(1, 20):
        changed = {name: str(value) for name, value in hidden.setting(k).items()}
        said = dict(part.split(" ", 1) for part in hidden.in_words(k).split(", "))
        assert said.items() <= changed.items()
        assert hidden.experiment(hidden.setting(k), SIMPLEGOAL).settings["config"].keys() >= said.keys() - {"teacher"}
