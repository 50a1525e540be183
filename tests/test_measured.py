import measured
import pandas as pd

from vsp.run.atomic import ROOT


def test_committed_numbers_are_numbers():
    frame = measured.read(ROOT / "data" / "results" / "trust.csv")
    assert list(frame) == measured.COLUMNS and set(frame["table"]) == set(measured.TABLES)
    assert all(pd.api.types.is_numeric_dtype(frame[name]) for name in ("target", "measured", "low", "high"))
    met = frame["measured"].ge(frame["target"]).where(frame["rule"] == "at least", frame["measured"] <= frame["target"])
    assert (met == (frame["met"] == "yes")).all() and not frame.duplicated(["table", "what"]).any()
