import measured
import pandas as pd

from vsp.run.atomic import ROOT


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
    assert (met == (frame["met"] == "yes")).all() and not frame.duplicated(["table", "what"]).any()
