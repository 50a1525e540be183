import measured
import pandas as pd
import pytest

from vsp.run.atomic import ROOT


@pytest.mark.parametrize(
    ("value", "limit", "met"),
    [(3, {"at_least": 3}, "yes"), (2, {"at_least": 3}, "no"), (3, {"at_most": 3}, "yes"), (4, {"at_most": 3}, "no")],
)
def test_a_row_says_whether_its_target_is_met(value, limit, met):
    row = measured.row("speed", "x", value, "times", **limit, low=1, high=5, note="why")
    assert list(row) == measured.COLUMNS and (row["met"], row["target"], row["measured"]) == (met, 3, value)
    assert row["rule"].replace(" ", "_") in limit and (row["low"], row["high"], row["note"]) == (1, 5, "why")


def test_a_new_row_takes_the_place_of_the_old_one(tmp_path):
    path = tmp_path / "trust.csv"
    for table, what, value in (("speed", "b", 1), ("speed", "a", 2), ("faults", "z", 3), ("speed", "b", 4e-7)):
        measured.add(path, measured.row(table, what, value, "s", at_most=5))
    frame = measured.read(path)
    assert frame[["table", "what", "measured"]].to_numpy().tolist() == [
        ["faults", "z", 3], ["speed", "a", 2], ["speed", "b", 4e-7],
    ]  # fmt: skip


def test_committed_numbers_are_numbers():
    frame = measured.read(ROOT / "data" / "results" / "trust.csv")
    assert list(frame) == measured.COLUMNS and set(frame["table"]) == set(measured.TABLES)
    assert all(pd.api.types.is_numeric_dtype(frame[name]) for name in ("target", "measured", "low", "high"))
    met = frame["measured"].ge(frame["target"]).where(frame["rule"] == "at least", frame["measured"] <= frame["target"])
    assert (met == (frame["met"] == "yes")).all()
