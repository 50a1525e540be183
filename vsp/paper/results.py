"""Tables of results that take minutes or more: data/results. Notebooks draw the committed ones.

A row states its provenance (`protocol.jobs`); `studies.comparison.stale` compares it with the current one.
"""

import io
import os
from pathlib import Path

import pandas as pd

from ..run import atomic, listed

RESULTS = atomic.ROOT / "data" / "results"
_TYPES = {"settings": str, "teacher": str, "checksum": str, "version": "Int64"}  # an id may look like a number


def read_results(name: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Read the table data/results/NAME.csv, or NAME.csv in another `folder`."""
    content = listed.read_listed(Path(folder or RESULTS) / f"{name}.csv")
    return pd.read_csv(io.BytesIO(content), dtype=_TYPES)


def write_results(
    frame: pd.DataFrame, name: str, *, out: str | os.PathLike, float_format: str | None = "%.6f",
    folder: str = "data/results",
) -> None:  # fmt: skip
    """Write OUT/`folder`/NAME.csv atomically, and list it in the manifest of its folder. `float_format`: of all floats;
    None: as many digits as they have."""
    text = frame.to_csv(index=False, float_format=float_format, lineterminator="\n")
    listed.write_listed(Path(out, folder, f"{name}.csv"), text)
