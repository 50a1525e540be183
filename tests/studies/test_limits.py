import pandas as pd
import pytest
from support import CHEETAH, LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS

from studies import comparison
from studies.committed import read_results, write_results
from studies.comparison import all_rows, best_mean, near, references, with_regret

MEASURED = {"failing": 0.0, "error_teacher": 0.1, "error_own": 0.1, "cells": 3}


def rows(*found):
    """A row per method, size, seed and mean return."""
    return pd.DataFrame([dict(zip(("method", "size", "seed", "mean"), row)) | MEASURED for row in found])


def test_shares_regret_and_failures_by_hand(tmp_path):
    best = pd.DataFrame({"task": [MOUNTAINCAR] * 2, "mean": [99.5, 99.6]})
    write_results(best, "optimum", out=tmp_path)
    frame = rows(*(("at the limit", 3, seed, mean) for seed, mean in enumerate((99.2, 99.4, 99.0, 99.4))))
    frame.loc[2, "failing"] = 0.25
    write_results(frame, f"limit_{MOUNTAINCAR}", out=tmp_path)
    found = comparison.limit_summary(MOUNTAINCAR, tmp_path / "data/beyond").iloc[0]
    assert found[["size", "policies", "near", "least", "most", "failing"]].tolist() == [3, 4, 0.75, 99, 99.4, 0.25]
    assert found["regret"] == pytest.approx(99.6 - 99.25) and found["low"] < 99.25 < found["high"]


def test_robots_stand_beside_their_teacher(tmp_path):
    found = [("cells", 8, 0, 40.0), ("cells", 8, 1, 60.0), ("oblique tree", 8, 0, 30.0)]
    found += [("one map, random search", 0, 0, 20.0), ("robot's teacher", 0, 0, 100.0)]
    frame = rows(*found).assign(r2=[0.8, 0.9, 0.7, -1.0, 1.0])
    write_results(frame, f"robots_{CHEETAH}", out=tmp_path)
    table = comparison.robots_summary(CHEETAH, tmp_path / "data/beyond").set_index("method")
    assert table.index[0] == "robot's teacher" and table.loc["cells", "share"] == 0.5
    assert table.loc["cells", "r2"] == pytest.approx(0.85) and table.loc["cells", "seeds"] == "40, 60"
    assert table.loc["one map, random search", "share"] == 0.2 and table.loc["oblique tree", "share"] == 0.3


def test_searches_stand_in_the_order_of_their_length(tmp_path):
    tuned = [("our cells, tuned", size, seed, mean) for size, seed, mean in ((3, 0, 95.0), (3, 1, 96.0), (4, 0, 90.0))]
    of_table = {
        "methods": [*tuned, ("CART", 3, 0, 91.0)],
        "starts": [("at the limit, from the teacher", 3, 0, 97.0), ("our cells, 800 generations", 3, 0, 96.0)],
        "limit": [("at the limit", 3, 0, 99.4), ("at the limit", 4, 0, 99.3)],
    }
    for table, found in of_table.items():
        write_results(rows(*found), f"{table}_{MOUNTAINCAR}", out=tmp_path)
    table = comparison.starts_summary(MOUNTAINCAR, tmp_path / "data/beyond")
    by_length = ["our cells, tuned", "our cells, 800 generations", "at the limit, from the teacher", "at the limit"]
    assert table["method"].tolist() == by_length
    assert table["mean"].tolist() == [95.5, 96.0, 97.0, 99.4] and table.loc[0, ["least", "most"]].tolist() == [95, 96]


# Regret


def test_what_is_best_is_that_of_the_finest_grid_and_near_is_below_it():
    assert references()["best"].tolist() == [best_mean(task) for task in references()["task"]]
    assert near(SIMPLEGOAL) == best_mean(SIMPLEGOAL) - 0.015


def test_two_grids_differ_by_less_than_teachers_and_the_best():
    """So the grids are fine enough: their error is small beside what is to be gained."""
    frame = read_results("optimum")
    assert frame["task"].tolist() == [SIMPLEGOAL, *[MOUNTAINCAR] * 2, *[PENDULUM] * 2]
    table = references().set_index("task").drop(SIMPLEGOAL)
    assert frame["failing"].dropna().eq(0).all() and (table["error"] < 0.05 * table["regret"]).all()


@pytest.mark.parametrize("task", (*TASKS, PENDULUM))
def test_nothing_returns_more_than_the_best(task):
    assert (with_regret(all_rows(task), task)["regret"] > 0).all()


def test_of_a_task_without_an_optimum_the_regret_is_not_known():
    table = with_regret(pd.DataFrame({"mean": [1.0, 2.0]}), LUNARLANDER)
    assert table["regret"].tolist() == ["not known"] * 2
    known = with_regret(pd.DataFrame({"mean": [1.0]}), SIMPLEGOAL)
    assert known["regret"][0] == best_mean(SIMPLEGOAL) - 1.0
