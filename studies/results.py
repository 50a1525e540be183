"""Committed results of the studies: the tables and policies in data/beyond."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd

from vsp.paper import results
from vsp.run import ROOT, listed

BEYOND = Path("data", "beyond")
RESULTS = ROOT / BEYOND


def read_results(name: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Read the table data/beyond/NAME.csv, or NAME.csv in another `folder`."""
    return results.read_results(name, folder or RESULTS)


def write_results(frame: pd.DataFrame, name: str, *, out: str | os.PathLike, float_format: str = "%.6f") -> None:
    """Write OUT/data/beyond/NAME.csv atomically, and list it in the manifest of its folder."""
    text = frame.to_csv(index=False, float_format=float_format, lineterminator="\n")
    listed.write_listed(Path(out) / BEYOND / f"{name}.csv", text)
