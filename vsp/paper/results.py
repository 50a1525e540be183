"""Results that take minutes or more, on disk, and what they were made with. Notebooks draw what is committed.

A row of a table and a run file name their provenance:

- settings: an id of everything that decides the result beside the three below, presets and start states included;
- teacher: the first ten hexadecimal digits of the checksum of its weights;
- version: that of the method, a number in the code, raised by hand when the same arguments give other results;
- the seed, where a result has one.

`vsp.beyond.comparison.stale` compares them with today's.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from ..run import atomic, listed, sealed, workers

RESULTS = atomic.ROOT / "data" / "results"
PROVENANCE = ("settings", "teacher", "version")
_TYPES = {"settings": str, "teacher": str, "checksum": str, "version": "Int64"}  # an id may look like a number


def provenance(settings: dict, digest: str, version: int) -> dict[str, str | int]:
    """The columns `PROVENANCE` of a result; `digest` is that of the teacher."""
    return {"settings": settings_id(settings), "teacher": digest[:10], "version": version}


def settings_id(settings: dict) -> str:
    """Ten hexadecimal digits that stand for JSON-able settings."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:10]


def provenance_folder(root: str | os.PathLike, task: str, made_with: dict) -> Path:
    """The folder below `root` of the files of one task that differ in their seed alone."""
    return Path(root) / task / "{settings}-{teacher}-v{version}".format(**made_with)


def load_made(path: str | os.PathLike, kind: str, expected: dict) -> tuple[dict, dict]:
    """The arrays and about of a sealed file. Raises `atomic.DamagedFile`, also where about is not as `expected`: a
    swapped or old file."""
    arrays, about = sealed.load_arrays(path, kind=kind)
    for name, value in expected.items():
        if about.get(name) != value:
            raise atomic.DamagedFile(
                f"{path}: made with {name} {about.get(name)!r}, expected {value!r}: delete it, and it is made anew"
            )
    return arrays, about


def make_missing(
    make: Callable[..., tuple[dict, dict]], work: dict[Path, tuple], label: str, *, jobs: int | str, unit: str
) -> None:
    """Write what is missing of the files `work`: arrays and about by `make(*work[path])`; `jobs` as in `workers`."""
    missing = [path for path in work if not path.exists()]
    arguments = [work[path] for path in missing]
    for i, content in workers.results(make, arguments, label, jobs=jobs, total=len(work), unit=unit):
        sealed.save_arrays(missing[i], *content)


def read_results(name: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """The table data/results/NAME.csv, or that of another folder."""
    return listed.read_table(Path(folder or RESULTS) / f"{name}.csv", dtype=_TYPES)


def write_results(frame: pd.DataFrame, name: str, *, out: str | os.PathLike, float_format: str = "%.6f") -> None:
    """Write OUT/data/results/NAME.csv, atomically and listed."""
    text = frame.to_csv(index=False, float_format=float_format, lineterminator="\n")
    listed.write_listed(Path(out) / "data" / "results" / f"{name}.csv", text)
