import numpy as np
import pandas as pd
import pytest
from studies.comparison.method_summary import AS_GOOD, PARTS, ablation, headline, method_summary, rivals, seeds_as_good
from studies.comparison.method_tables import ABLATION
from support import SIMPLEGOAL

ROWS = pd.DataFrame(
    [("refined", 2, seed, mean, failing, 2) for seed, mean, failing in [(0, 9.0, 0.0), (1, 9.2, 0.0), (2, 7.0, 0.1)]]
    + [("CART", 2, seed, mean, 0.2, 2) for seed, mean in enumerate([5.0, 6.0, 7.0])]
    + [("refined", 4, seed, mean, 0.0, 4) for seed, mean in enumerate([9.0, 10.0, 11.0])]
    + [("CART", 4, seed, 10.0 + seed / 10, 0.0, 4) for seed in range(3)]
    + [("refined, no leak", 4, seed, 3.0, 0.0, 4) for seed in range(3)]
    + [("refined, not tuned", size, seed, 20.0, 0.0, size) for size in (2, 4) for seed in range(3)]
    + [("teacher", 0, 0, 9.01, 0.0, 0)],
    columns=["method", "size", "seed", "mean", "failing", "cells"],
).assign(error_teacher=0.1, error_own=0.2, parameters=6, operations=8.0)  # fmt: skip


def test_a_summary_has_a_row_per_method_and_size():
    table = method_summary(ROWS)
    (row,) = table[(table["method"] == "refined") & (table["size"] == 2)].to_dict("records")
    assert (row["policies"], row["mean"], row["median"]) == (3, pytest.approx(8.4), 9.0)
    assert row["failing"] == pytest.approx(0.1 / 3)
    half = 4.3027 * np.sqrt((1.4**2 + 0.6**2 + 0.8**2) / 2 / 3)  # Student's t with 2 degrees of freedom
    assert [row["low"], row["high"]] == pytest.approx([8.4 - half, 8.4 + half], abs=1e-3)
    assert [table[table["size"] == 4]["method"].iloc[i] for i in (0, 1)] == ["refined, not tuned", "CART"]
    (teacher,) = table[table["method"] == "teacher"].to_dict("records")
    assert pd.isna(teacher["low"]) and teacher["policies"] == 1


def test_rivals_are_others_than_ourselves():
    small, large = rivals(method_summary(ROWS)).to_dict("records")
    assert (small["size"], small["rival"], small["rival mean"], small["ahead"]) == (2, "CART", 6.0, "level")
    assert (large["size"], large["rival"], large["ahead"], large["untuned"]) == (4, "CART", "level", 20.0)
    assert small["untuned ahead"] == large["untuned ahead"] == "ours"
    better = ROWS.assign(mean=ROWS["mean"] + 10 * (ROWS["method"] == "refined"))
    assert rivals(method_summary(better))["ahead"].tolist() == ["ours", "ours"]
    worse = ROWS.assign(mean=ROWS["mean"] - 10 * (ROWS["method"] == "refined"))
    assert rivals(method_summary(worse))["ahead"].tolist() == ["theirs", "theirs"]


@pytest.mark.parametrize(
    ("task", "shares"),
    [("SimpleGoal-v0", [2 / 3, 1]), ("MountainCarContinuous-v0", [1 / 3, 2 / 3]), ("Pendulum-v1", [2 / 3, 1])],
)
def test_what_is_as_good_as_the_teacher(task, shares):
    """Of a teacher with 9.01: at least 8.98 and few failures, above it and none, at least 8.92."""
    table = seeds_as_good(task, ROWS)
    assert table["reached"].tolist() == pytest.approx(shares)
    assert table["gap"].tolist() == pytest.approx([-0.01, 0.99]) and table["failing"].tolist() == [0.1, 0.0]


def test_the_headline_is_of_the_size_of_the_preset():
    (row,) = headline({SIMPLEGOAL: ROWS}).to_dict("records")
    half = 4.3027 / np.sqrt(3)  # three seeds: 9, 10 and 11
    low, high = (pytest.approx(end, abs=1e-3) for end in (10 - half, 10 + half))
    assert row == {
        "task": SIMPLEGOAL, "teacher": 9.01, "cells": 4, "mean": 10.0, "low": low, "high": high, "reached": 1.0,
        "failing": 0.0, "rival": "CART", "rival mean": pytest.approx(10.1), "rival reached": 1.0,
    }  # fmt: skip


def test_a_hundredth_of_a_negative_return_is_below_it():
    teacher, own = pd.Series({"mean": -100.0}), pd.DataFrame({"mean": [-101.0, -101.1, -99.0]})
    assert AS_GOOD["Pendulum-v1"](own, teacher).tolist() == [True, False, True]


def test_an_ablation_is_that_of_the_size_of_the_preset():
    table = ablation(ROWS)
    assert dict(zip(table["part"], table["mean"])) == {
        "all parts": 10.0,
        "no slope beyond the limits": 3.0,
        "no tuning": 20.0,
    }
    assert set(table["size"]) == {4} and table["part"].tolist()[0] == "all parts"


def test_every_part_of_an_ablation_has_words():
    assert list(PARTS) == ["all of it", *ABLATION] and len(set(PARTS.values())) == len(PARTS)


def test_a_task_without_an_ablation_has_none():
    with pytest.raises(ValueError, match="is an ablation"):
        ablation(ROWS[ROWS["method"].isin(["refined", "teacher"])])
