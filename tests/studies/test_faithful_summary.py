import numpy as np
import pandas as pd
import pytest
from support import SIMPLEGOAL

from studies.comparison import faithful_summary
from studies.comparison.faithful_summary import largest_alike, likeness, other_teachers, over_groups
from vsp.run import listed


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
    write(tmp_path, "methods", pd.DataFrame([row("teacher", 0, 0, 16.6, 1.0), row("refined", 2, 0, 16.9, -1.0)]))
    write(tmp_path, "tuned", pd.DataFrame([row("one linear map, tuned", 0, 0, 15.0, -2.0)]))
    pairs = [(2, 0, 1, 0.95, 0.2), (2, 0, 2, 0.85, 0.3), (2, 1, 2, 0.97, 0.4), (3, 0, 1, None, 0.5)]
    write(tmp_path, "same", pd.DataFrame(pairs, columns=["size", "seed", "other", "index", "ratio"]))
    others = [row("teacher", 0, 0, 10.0, 1.0), row("refined", 2, 0, 10.5, 0.1), row("refined", 2, 1, 9.5, 0.2)]
    others = [{**other, "agent": 1} for other in others]
    others += [{**row("refined", 2, 0, 7.0, 0.3), "agent": 2}, {**row("teacher", 0, 0, 9.0, 1.0), "agent": 2}]
    write(tmp_path, "teachers", pd.DataFrame(others).sort_values("method", kind="stable"))  # agents take turns
    return tmp_path


def test_a_row_says_how_many_are_like_the_teacher_and_as_good(results):
    two, three = likeness(SIMPLEGOAL, results).to_dict("records")
    assert (two["policies"], two["like"], two["good"], two["both"]) == (4, 0.75, 0.75, 0.5)
    assert (two["r2"], two["r2_least"], two["mean"]) == (pytest.approx(0.965), 0.94, 16.6)
    assert (two["index"], two["index_least"], two["ratio"], two["one_cell"]) == (0.95, 0.85, 0.3, 0)
    assert (three["good"], three["one_cell"]) == (0.5, 1) and pd.isna(three["index"])


def test_the_largest_size_with_the_same_cells(results):
    table = likeness(SIMPLEGOAL, results)
    assert largest_alike(table) == 2
    assert largest_alike(table.assign(index=0.8)) is None
    more = pd.DataFrame({"size": [1, 2, 3, 4], "index": [None, 0.95, 0.8, 0.99]})
    assert largest_alike(more) == 2


def test_every_teacher_is_compared_with_its_own_policies(results):
    shipped, one, other, every = other_teachers(SIMPLEGOAL, results).to_dict("records")
    assert (shipped["teacher"], shipped["own"], shipped["gap"]) == (0, 16.6, pytest.approx(0.3))
    assert (one["teacher"], one["own"], one["gap"], one["policies"]) == (1, 10.0, 0.0, 2)
    half = 12.706 * 0.5  # Student's t with one degree of freedom
    assert (one["low"], one["high"]) == (pytest.approx(-half, abs=1e-3), pytest.approx(half, abs=1e-3))
    assert (one["good"], one["r2"]) == (0.5, pytest.approx(0.15))
    assert (other["teacher"], other["gap"], other["good"], other["good_high"]) == (2, -2.0, 0.0, 0.975)
    assert (every["teacher"], every["policies"], every["good"]) == ("all", 4, 0.5)
    assert every["gap"] == pytest.approx((0.3 + 0.0 - 2.0) / 3) and every["low"] < -1 < 0 < every["high"]


def test_intervals_over_groups_by_enumeration():
    """Of two groups of one value each, the mean of two draws is one value, the middle, or the other: 1 : 2 : 1."""
    assert over_groups([np.array([0.0]), np.array([1.0])]) == (0.0, 1.0)
    assert over_groups([np.array([1.0, 3.0])]) == (1.0, 3.0)
    low, high = over_groups([np.full(50, 1.0), np.full(5, 2.0), np.full(5, 6.0)])  # each group counts alike
    assert (low, high) == (1.0, 6.0)


def test_targets_are_of_tasks_that_are_known():
    assert faithful_summary.LEAST_R2.keys() == faithful_summary.AS_GOOD.keys()
