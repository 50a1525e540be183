import numpy as np
import pandas as pd
import pytest
from support import SIMPLEGOAL

from studies.comparison import summary
from studies.comparison.methods import METHODS
from studies.comparison.summary import TUNED
from vsp.run import listed

ROWS = pd.DataFrame(
    [(TUNED, 2, seed, mean, failing, 2) for seed, mean, failing in [(0, 9.0, 0.0), (1, 9.2, 0.0), (2, 7.0, 0.1)]]
    + [("CART", 2, seed, mean, 0.2, 2) for seed, mean in enumerate([5.0, 6.0, 7.0])]
    + [(TUNED, 4, seed, mean, 0.0, 4) for seed, mean in enumerate([9.0, 10.0, 11.0])]
    + [("CART", 4, seed, 10.0 + seed / 10, 0.0, 4) for seed in range(3)]
    + [("our cells, no annealing", 4, seed, 3.0, 0.0, 4) for seed in range(3)]
    + [("our cells", size, seed, 20.0, 0.0, size) for size in (2, 4) for seed in range(3)]
    + [("teacher", 0, 0, 9.01, 0.0, 0)],
    columns=["method", "size", "seed", "mean", "failing", "cells"],
).assign(error_teacher=0.1, error_own=0.2)  # fmt: skip


def test_a_summary_has_a_row_per_method_and_size():
    table = summary.method_summary(ROWS)
    (row,) = table[(table["method"] == TUNED) & (table["size"] == 2)].to_dict("records")
    assert (row["policies"], row["mean"], row["median"]) == (3, pytest.approx(8.4), 9.0)
    assert row["failing"] == pytest.approx(0.1 / 3)
    half = 4.3027 * np.sqrt((1.4**2 + 0.6**2 + 0.8**2) / 2 / 3)  # Student's t with 2 degrees of freedom
    assert [row["low"], row["high"]] == pytest.approx([8.4 - half, 8.4 + half], abs=1e-3)
    assert [table[table["size"] == 4]["method"].iloc[i] for i in (0, 1)] == ["our cells", "CART"]
    (teacher,) = table[table["method"] == "teacher"].to_dict("records")
    assert pd.isna(teacher["low"]) and teacher["policies"] == 1


@pytest.mark.parametrize(("lift", "expected"), [(0, "cannot be told"), (10, "ours"), (-10, "theirs")])
def test_who_is_ahead(lift, expected):
    table = summary.method_summary(ROWS.assign(mean=ROWS["mean"] + lift * (ROWS["method"] == TUNED)))
    ours, theirs = (table[(table["method"] == m) & (table["size"] == 2)].iloc[0] for m in (TUNED, "CART"))
    assert summary.ahead(ours, theirs) == expected


@pytest.mark.parametrize(
    ("task", "shares"),
    [("SimpleGoal-v0", [2 / 3, 1]), ("MountainCarContinuous-v0", [1 / 3, 2 / 3]), ("Pendulum-v1", [2 / 3, 1])],
)
def test_what_is_as_good_as_the_teacher(task, shares):
    """Of a teacher with 9.01: at least 8.98 and few failures, above it and none, at least 8.92."""
    rows = ROWS[ROWS["method"] == TUNED]
    good = summary.AS_GOOD[task](rows, summary.teacher_of(ROWS)).groupby(rows["size"]).mean()
    assert good.tolist() == pytest.approx(shares)


def test_a_hundredth_of_a_negative_return_is_below_it():
    teacher, own = pd.Series({"mean": -100.0}), pd.DataFrame({"mean": [-101.0, -101.1, -99.0]})
    assert summary.AS_GOOD["Pendulum-v1"](own, teacher).tolist() == [True, False, True]


def test_an_ablation_is_that_of_the_size_of_the_preset():
    one = ROWS[ROWS["method"] == "our cells, no annealing"].assign(method="our cells, one restart", mean=5.0)
    table = summary.ablation(pd.concat([ROWS, one]))
    assert table["part"].tolist() == ["all parts", "no annealing", "one restart", "no tuning"]
    assert table["mean"].tolist() == [10.0, 3.0, 5.0, 20.0] and set(table["size"]) == {4}
    assert set(summary.PARTS) <= set(METHODS)


# Policies that act like their teacher


def write(folder, name, frame):
    listed.write_listed(folder / f"{name}_{SIMPLEGOAL}.csv", frame.to_csv(index=False))


def row(method, size, seed, mean, r2, *, failing=0.0, cells=None):
    return {"method": method, "size": size, "seed": seed, "mean": mean, "r2": r2, "r2_worst": r2 - 0.1, "off": 0.2,
            "failing": failing, "cells": size if cells is None else cells}  # fmt: skip


@pytest.fixture
def results(tmp_path):
    """Of the size 2 two of four policies are both like the teacher and as good; of size 3 one has one cell."""
    faithful = [row("faithful", 2, 0, 16.6, 0.97), row("faithful", 2, 1, 16.6, 0.96), row("faithful", 2, 2, 16.6, 0.94),
                row("faithful", 2, 3, 16.5, 0.98), row("faithful", 3, 0, 16.6, 0.99),
                row("faithful", 3, 1, 16.6, 0.99, failing=0.01, cells=1)]  # fmt: skip
    write(tmp_path, "faithful", pd.DataFrame(faithful))
    write(tmp_path, "methods", pd.DataFrame([row("teacher", 0, 0, 16.6, 1.0), row(TUNED, 2, 0, 16.9, -1.0)]))
    write(tmp_path, "tuned", pd.DataFrame([row("one linear map, tuned", 0, 0, 15.0, -2.0)]))
    pairs = [(2, 0, 1, 0.95, 0.2), (2, 0, 2, 0.85, 0.3), (2, 1, 2, 0.97, 0.4), (3, 0, 1, None, 0.5)]
    write(tmp_path, "same", pd.DataFrame(pairs, columns=["size", "seed", "other", "index", "ratio"]))
    others = [row("teacher", 0, 0, 10.0, 1.0), row(TUNED, 2, 0, 10.5, 0.1), row(TUNED, 2, 1, 9.5, 0.2)]
    others = [{**other, "agent": 1} for other in others]
    others += [{**row(TUNED, 2, 0, 7.0, 0.3), "agent": 2}, {**row("teacher", 0, 0, 9.0, 1.0), "agent": 2}]
    write(tmp_path, "teachers", pd.DataFrame(others).sort_values("method", kind="stable"))  # agents take turns
    return tmp_path


def test_a_row_says_how_many_are_like_the_teacher_and_as_good(results):
    two, three = summary.likeness(SIMPLEGOAL, results).to_dict("records")
    assert (two["policies"], two["like"], two["good"], two["both"]) == (4, 0.75, 0.75, 0.5)
    assert (two["r2"], two["r2_least"], two["mean"]) == (pytest.approx(0.965), 0.94, 16.6)
    assert (two["index"], two["ratio"]) == (0.95, 0.3)
    assert three["good"] == 0.5 and pd.isna(three["index"])


def test_the_largest_size_with_the_same_cells(results):
    table = summary.likeness(SIMPLEGOAL, results)
    assert summary.largest_alike(table) == 2
    assert summary.largest_alike(table.assign(index=0.8)) is None
    more = pd.DataFrame({"size": [1, 2, 3, 4], "index": [None, 0.95, 0.8, 0.99]})
    assert summary.largest_alike(more) == 2


def test_every_teacher_is_compared_with_its_own_policies(results):
    shipped, one, other, every = summary.other_teachers(SIMPLEGOAL, results).to_dict("records")
    assert (shipped["teacher"], shipped["own"], shipped["gap"]) == (0, 16.6, pytest.approx(0.3))
    assert (one["teacher"], one["own"], one["gap"], one["policies"]) == (1, 10.0, 0.0, 2)
    half = 12.706 * 0.5  # Student's t with one degree of freedom
    assert (one["low"], one["high"]) == (pytest.approx(-half, abs=1e-3), pytest.approx(half, abs=1e-3))
    assert (one["good"], one["r2"]) == (0.5, pytest.approx(0.15))
    assert (other["teacher"], other["gap"], other["good"]) == (2, -2.0, 0.0)
    assert (every["teacher"], every["policies"], every["good"]) == ("all", 4, 0.5)
    assert every["gap"] == pytest.approx((0.3 + 0.0 - 2.0) / 3) and every["low"] < -1 < 0 < every["high"]


def test_intervals_over_groups_by_enumeration():
    """Of two groups of one value each, the mean of two draws is one value, the middle, or the other: 1 : 2 : 1."""
    assert summary.over_groups([np.array([0.0]), np.array([1.0])]) == (0.0, 1.0)
    assert summary.over_groups([np.array([1.0, 3.0])]) == (1.0, 3.0)
    low, high = summary.over_groups([np.full(50, 1.0), np.full(5, 2.0), np.full(5, 6.0)])  # each group counts alike
    assert (low, high) == (1.0, 6.0)
