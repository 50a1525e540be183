"""Committed results of the studies: the tables and policies in data/beyond, and what they were made with."""

import os
from collections import Counter
from functools import partial
from pathlib import Path

import pandas as pd

from vsp.paper import results
from vsp.protocol.job import PROVENANCE
from vsp.run import ROOT, sealed

BEYOND = Path("data", "beyond")
RESULTS = ROOT / BEYOND
write_results = partial(results.write_results, folder=str(BEYOND))  # to OUT/data/beyond/NAME.csv
MADE_WITH = (*PROVENANCE, "seed", "other")


def read_results(name: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Read the table data/beyond/NAME.csv, or NAME.csv in another `folder`."""
    return results.read_results(name, folder or RESULTS)


def keys(rows: pd.DataFrame | list[dict]) -> list[tuple[str, ...]]:
    """Return what each row was made with, as text: the columns `MADE_WITH`."""
    return list(pd.DataFrame(rows).reindex(columns=MADE_WITH).astype(str).itertuples(index=False, name=None))


def differing(name: str, today: list[dict]) -> list[str]:
    """Return in what a committed file differs from what `today` says of its rows, as columns; [] if it is current."""
    path = RESULTS / name
    kept = [sealed.load_arrays(path, kind="VoronoiPolicy")[1]] if path.suffix == ".policy" else read_results(path.stem)
    now, then = keys(today), keys(kept)
    count = Counter if "seed" in today[0] else set  # with a seed, each row stands for one job
    if count(now) == count(then):
        return []
    return [name for name, *both in zip(MADE_WITH, zip(*now), zip(*then)) if set(both[0]) != set(both[1])] or ["rows"]
