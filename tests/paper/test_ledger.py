import dataclasses
import re
from functools import partial

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS

from vsp import get_task
from vsp.evaluation import rollout_from_seed
from vsp.paper import ledger, tables
from vsp.paper.ledger import CONTRADICTED, DIFFERS, REPRODUCED, UNCHECKED, UNTOLD, VERDICTS, ledger_gaps
from vsp.paper.printed import PREFIX, printed_values, spread_id
from vsp.paper.runs import EVALUATION_SEED, Results, make_runs, paper_experiment
from vsp.paper.statistics import resample
from vsp.run import ROOT
from vsp.run.notebook import nbformat
from vsp.tasks import registry, simplegoal

RESULT = "_spread_|_drl_|_ours_"  # what the ids of the results in text and tables hold
SEEDS, N_RESAMPLES = range(4), 40


def experiment(task):
    """The shipped teacher, 60 iterations, 40 episodes."""
    quick = paper_experiment(task, quick=True)
    config = dataclasses.replace(quick.config, n_epochs=60, n_freeze=10, n_split=10)
    return dataclasses.replace(quick, config=config, n_episodes=40)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Tiny runs of both tasks."""
    runs, found = tmp_path_factory.mktemp("runs"), {}
    for task in TASKS:
        one = experiment(task)
        teacher = rollout_from_seed(one.teacher, task, one.n_episodes, seed=EVALUATION_SEED)
        found[task] = Results(one, make_runs(one, SEEDS, runs=runs), teacher)
    return found


@pytest.fixture(scope="module")
def book(results):
    return ledger.ledger_table(results, n_resamples=N_RESAMPLES)


@pytest.fixture(scope="module")
def by_id(book):
    return book.set_index("id")


# Every printed value has its row


def test_every_printed_value_has_one_row_a_verdict_and_a_cell(book):
    assert book[["id", "paper"]].equals(printed_values()[["id", "paper"]]) and book["id"].is_unique
    assert set(book["verdict"]) <= set(VERDICTS) and book["cell"].str.strip().ne("").all()
    assert book.columns.tolist() == ledger.COLUMNS
    assert book["part"].eq("coefficients").equals(book["id"].str.contains("_cell_"))
    counts = ledger.verdict_counts(book).set_index("of")
    counted = book[book["fact"] | book["part"].ne("results")]
    assert counts.sum().to_dict() == {name: (counted["verdict"] == name).sum() for name in VERDICTS}
    assert counts.sum(axis=1).to_dict() == {
        "distilled policies": 28, "MountainCar's teacher": 8, "SimpleGoal's teacher (chosen)": 11, "settings": 78,
        "coefficients": 262,
    }  # fmt: skip


def test_the_values_that_nothing_here_compares_with_are_these(book):
    rows = book[book["here"].isna() & ~book["id"].str.contains("_cell_|_outliers_")]
    assert rows["id"].tolist() == [
        "voronoi_example_codewords", "trajectory_buffer_iterations", "action_dimensions", "machine_chip",
        "machine_memory", "pytorch_version", "python_version", "sg_table_digits", "mc_table_digits",
    ]  # fmt: skip
    assert set(rows["verdict"]) == {UNCHECKED, CONTRADICTED}
    assert set(book[book["id"].str.contains("_cell_")]["verdict"]) == {UNCHECKED}


def test_a_result_that_follows_from_others_or_is_printed_twice_counts_once(book):
    once, results = book[book["fact"]], book[book["part"] == "results"]
    again = results.loc[results.index.difference(once.index), "id"]
    assert len(results) == 75 and len(again) == 16 + 4 + 4 + 4  # text: mean, std, min, max; iqr; coverage; four others
    others = {id for id in again if not id.endswith(("_mean", "_std", "iqr", "coverage")) and "outliers" in id}
    assert others == {"sg_drl_outliers_min", "sg_ours_outliers_min", "mc_ours_outliers_above_share"}
    assert not {*again} & {f"{task}_spread_{who}_{name}" for task in ("sg", "mc") for who in ("drl", "ours")
                           for name in ("mean", "std", "min", "max", "q1", "median", "q3")}  # fmt: skip


def notebook_cells():
    found = {}
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = nbformat.read(path, as_version=4).cells
        found[path.stem[:2]] = {cell.id for cell in cells if cell.cell_type == "code"}
    return found


def test_cells_are_cells_of_the_notebooks_that_hold_code(book):
    cells = notebook_cells()
    for place in book["cell"].unique():
        number, id = re.fullmatch(r"(\d\d), ([\w-]+)", place).groups()
        assert id in cells[number], place


def test_cells_by_hand(book):
    cells = {
        "sg_ours_mean": "04, text-numbers", "sg_spread_drl_q1": "04, simplegoal-spread",
        "mc_hyper_n_split": "04, hyperparameters", "mc_text_drl_episodes": "03, runs", "sg_caption_cells": "03, best",
        "mc_cell_1_F_x": "05, replay", "sg_goal_reward": "05, ledger", "sg_training_steps": "05, ledger",
    }  # fmt: skip
    assert book.set_index("id")["cell"][[*cells]].to_dict() == cells


# The rules


def row(paper, here, low=np.nan, high=np.nan, value=None):
    value = float(paper.rstrip("%")) if value is None else value
    return pd.DataFrame({"paper": [paper], "value": value, "here": here, "low": low, "high": high})


def verdict(row, *, in_doubt=False, unit=np.inf, beyond=np.nan):
    return ledger.verdicts(row.assign(unit=unit, beyond=beyond), in_doubt=pd.Series([in_doubt])).item()


ROOT2 = np.sqrt(2)


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        (row("13", np.nan), UNCHECKED),
        (row("0.1", 0.1 + 1e-12), REPRODUCED),  # a setting found by taking a step
        (row("0.1", 0.1001), DIFFERS),
        (row("no", 1.0, 0.0, 1.0, value=0.0), REPRODUCED),
        # the interval [9, 12] of 10.00 reaches from 10 - √2 to 10 + 2 √2, and half a unit of 0.001 further
        (row("8.586", 10.0, 9.0, 12.0), REPRODUCED),
        (row("8.585", 10.0, 9.0, 12.0), DIFFERS),
        (row("12.828", 10.0, 9.0, 12.0), REPRODUCED),
        (row("12.829", 10.0, 9.0, 12.0), DIFFERS),
        (row("12.8%", 10.0, 9.0, 12.0), REPRODUCED),
        # no width: half a unit alone
        (row("10.00", 10.004, 10.004, 10.004), REPRODUCED),
        (row("10.00", 10.006, 10.006, 10.006), DIFFERS),
    ],
)
def test_verdicts_by_hand(row, expected):
    assert verdict(row) == expected
    assert verdict(row, in_doubt=True, unit=0.0) == CONTRADICTED
    width = ROOT2 * (row["high"] - row["low"]).item()
    assert verdict(row, unit=width) == expected
    wide = {REPRODUCED: UNTOLD}.get(expected, expected) if width > 0 else expected
    assert verdict(row, unit=0.99 * width) == wide


def test_extremes_differ_if_six_runs_go_beyond_from_six_starts():
    for beyond, expected in ((0, UNTOLD), (5, UNTOLD), (6, DIFFERS)):
        assert verdict(row("10.0", 4.0), beyond=beyond) == expected
    returns = np.full((8, 30), 10.0) + np.linspace(0, 1, 30)
    returns[:6, :6] = -1.0  # six runs from six starts
    returns[:7, 6] = -3.0
    assert [ledger._beyond("min", returns, value) for value in (-0.5, -2.0, -3.0)] == [7, 1, 0]
    assert ledger._beyond("max", returns, 10.9) == 3 and ledger._beyond("min", returns[:1], -0.5) == 7
    assert ledger._beyond("outliers_max", returns, -2.0) == 6 and ledger._beyond("outliers_max", returns, 0.0) == 0


def test_what_is_counted_has_the_deviation_of_one():
    returns = np.random.default_rng(0).normal(size=(4, 50))
    values = pd.Series({"mean": 0.0, "coverage": 80.0, "outliers_below_share": 50.0, "outliers": 20.0, "max": 1.0})
    unit = ledger.set_against(ledger.of_returns(returns, n_resamples=5), returns, values, 1.5)["unit"]
    assert unit[["mean", "coverage", "outliers_below_share"]].tolist() == pytest.approx([1.5, 40.0, 50.0])
    assert unit["outliers"] == pytest.approx(200 * 0.3)


# Settings


def test_settings_are_those_of_the_code(by_id):
    """All that the tasks and T2 fix, and the counts of the tiny runs."""
    counts = {f"{prefix}_{place}policies": 4 for prefix in ("sg", "mc") for place in ("", "caption_", "text_")}
    assert {id: by_id.at[id, "here"] for id in counts} == counts
    assert by_id.loc[["sg_total_episodes", "episodes_per_policy", "mc_caption_drl_episodes"], "here"].tolist() == [
        160, 40, 40,
    ]  # fmt: skip
    tiny = "_policies|episodes|algorithm_runs|" + RESULT + "|_cells|_cell_"
    fixed = by_id[~by_id.index.str.contains(tiny) & by_id["here"].notna()]
    assert fixed.index[fixed["verdict"] != REPRODUCED].tolist() == ["mc_max_steps"]  # Gymnasium's 999 for 1000
    assert len(fixed) == 3 + 16 + 11 + 2 * 9 and fixed["low"].isna().all()
    assert fixed.at["mc_goal_position", "here"] == 0.45 and fixed.at["mc_force_reward_exponent", "here"] == 2
    assert fixed.at["sg_training_steps", "here"] == 500_000 and fixed.at["mc_hyper_max_pol_loss", "here"] == 1e-5


def differing(results):
    found = pd.Series(ledger._settings(results))
    printed = printed_values().set_index("id").loc[lambda frame: frame.index.isin(found.index)]
    same = np.isclose(found[printed.index], printed["value"], rtol=1e-9)
    counts = printed.index.str.contains("_policies|episodes|algorithm_runs")
    return printed.index[~same & ~counts].tolist()


def test_another_reward_or_limit_differs(results, monkeypatch):
    """What is compared is what the code does: rewards are found by taking a step."""
    assert differing(results) == ["mc_max_steps"]
    step = partial(simplegoal.step, margin=0.06)
    for name, change in ((SIMPLEGOAL, {"step": step, "max_steps": 51}), (MOUNTAINCAR, {"high": np.array([0.6, 0.08])})):
        monkeypatch.setitem(registry._TASKS, name, dataclasses.replace(get_task(name), **change))
    assert sorted(differing(results)) == ["mc_max_steps", "mc_velocity_high", "sg_goal_reward", "sg_max_steps"]


# Results


@pytest.mark.parametrize("task", TASKS)
def test_our_results_are_those_of_the_tables(book, by_id, results, task):
    """Two routes: notebook 4 prints the same numbers."""
    prefix, result = PREFIX[task], results[task]
    frame = tables.spread_table(task, result.teacher_returns, result.returns).set_index("metric")
    for metric in frame.index:
        for who, column in (("drl", "teacher, here"), ("ours", "distilled, here")):
            here = by_id.at[spread_id(task, who, metric), "here"]
            assert here == pytest.approx(frame.at[metric, column], rel=1e-12)
    text = tables.text_number_table(task, result.teacher_returns, result.returns, cells=len(result.best.policy))
    text = text.set_index("id")["here"].astype(float)
    ids = [id for id in text.index if id in by_id.index]
    assert len(ids) > 15 and np.allclose(by_id.loc[ids, "here"].astype(float), text[ids], rtol=1e-12, equal_nan=True)
    cells = by_id["here"][by_id.index.str.startswith(prefix) & by_id.index.str.endswith("_cells")]
    assert len(cells) == {SIMPLEGOAL: 2, MOUNTAINCAR: 1}[task] and set(cells) == {text[f"{prefix}_cells"]}


@pytest.mark.parametrize("task", TASKS)
def test_intervals_resample_runs_and_for_the_teacher_starts(results, task):
    frame = ledger.measured(task, results[task], n_resamples=300)
    result, prefix = results[task], PREFIX[task]
    for subject, values in (("ours", result.returns), ("drl", result.teacher_returns[None])):
        drawn = resample(values, n_resamples=300)
        for name in ("mean", "median"):
            row = frame.loc[spread_id(task, subject, name)]
            assert (row["low"], row["high"]) == pytest.approx(tuple(drawn[name].quantile([0.025, 0.975])))
            assert row["low"] <= row["here"] <= row["high"]
        covered, least = (frame.loc[spread_id(task, subject, name)] for name in ("coverage", "min"))
        assert 50 <= covered["low"] <= covered["high"] <= 100
        assert np.isnan(least["low"]) and np.isnan(least["high"]) and least["beyond"] >= 0
    same = ["here", "low", "high", "unit"]
    assert frame.loc[f"{prefix}_ours_mean", same].equals(frame.loc[f"{prefix}_spread_ours_mean", same])


def test_the_cells_of_the_best_run_are_set_against_those_of_single_runs():
    runs = np.array([(1.0, 3), (3.0, 5), (2.0, 4), (0.0, 9)])  # mean on the validation starts, cells
    best, low, high = ledger.of_cells(runs).loc["cells", ["here", "low", "high"]]
    assert (best, low, high) == (5, *np.quantile([3, 5, 4, 9], [0.025, 0.975]))
    assert [verdict(row(cells, best, low, high), unit=np.nan) for cells in ("9", "3", "10")] == [
        REPRODUCED, REPRODUCED, DIFFERS
    ]  # fmt: skip


def test_a_count_has_an_interval_of_whole_numbers_around_its_quantiles():
    returns = np.random.default_rng(0).standard_t(2, size=(6, 40))
    low, high = ledger.of_returns(returns, n_resamples=30).loc["outliers", ["low", "high"]]
    ends = resample(returns, n_resamples=30)["outliers"].quantile([0.025, 0.975])
    assert (low, high) == (np.floor(ends.iloc[0]), np.ceil(ends.iloc[1])) and not float(ends.iloc[0]).is_integer()


# Gaps


def test_gaps_by_hand():
    rows = {f"mc_{name}": ("Ours", "1.0", 1.0, 0.0, 2.0, REPRODUCED) for name in ledger.SHOWN}
    rows |= {
        "mc_spread_drl_mean": ("DRL", "12.0", 10.0, 9.0, 14.0, REPRODUCED),  # 2 of 4 upwards
        "mc_spread_drl_std": ("DRL", "7.0", 10.0, 9.0, 14.0, DIFFERS),  # 3 of 1 downwards
        "mc_spread_ours_median": ("Ours", "-11.790", -10.0, -10.0, -10.0, DIFFERS),  # no width: half of 0.001
    }
    book = pd.DataFrame.from_dict(rows, orient="index", columns=["subject", "paper", "here", "low", "high", "verdict"])
    book = book.assign(value=book["paper"].astype(float)).rename_axis("id").reset_index()
    found = ledger_gaps(book, MOUNTAINCAR)
    assert len(found) == 12 and found.columns.tolist() == ["subject", "verdict", "gap"]
    gaps = found["gap"][found["gap"] != 0].to_dict()
    assert gaps == pytest.approx({
        "teacher: mean": 0.5, "teacher: standard deviation": -3, "distilled: median": -1.79 / 0.0005,
    })  # fmt: skip
    assert found.loc["teacher: standard deviation"].tolist()[:2] == ["teacher", DIFFERS]
