"""Results that take minutes or more, on disk, with their provenance. Notebooks draw the committed results.

A row of a table and a run file state their provenance:

- settings: an id of everything else that determines the result, including presets and start states;
- teacher: the first ten hexadecimal digits of the checksum of its weights;
- version: the method's version number in the code, raised by hand when the same arguments give other results;
- the seed, where a result has one.

`vsp.paper.studies.stale` and `studies.comparison.stale` compare them with the current ones.
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
    """Return the columns `PROVENANCE` of a result; `digest` is the checksum of the teacher's weights."""
    return {"settings": settings_id(settings), "teacher": digest[:10], "version": version}


def settings_id(settings: dict) -> str:
    """Return ten hexadecimal digits that identify JSON-able settings."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:10]


def provenance_folder(root: str | os.PathLike, task: str, made_with: dict) -> Path:
    """Return the folder below `root` for files of one task that differ only in their seed."""
    return Path(root) / task / "{settings}-{teacher}-v{version}".format(**made_with)


def load_made(path: str | os.PathLike, kind: str, expected: dict) -> tuple[dict, dict]:
    """Return the arrays and about of a sealed file.

    Raises `atomic.DamagedFile`, also if about differs from `expected`, as in a swapped or old file.
    """
    arrays, about = sealed.load_arrays(path, kind=kind)
    for name, value in expected.items():
        if about.get(name) != value:
            raise atomic.DamagedFile(
                f"{path}: made with {name} {about.get(name)!r}, expected {value!r}: delete it to make it again"
            )
    return arrays, about


def make_missing(
    make: Callable[..., tuple[dict, dict]], work: dict[Path, tuple], label: str, *, jobs: int | str, unit: str
) -> None:
    """Write the missing files of `work`; `make(*work[path])` returns arrays and about; `jobs` as in `workers`."""
    missing = [path for path in work if not path.exists()]
    arguments = [work[path] for path in missing]
    for i, content in workers.results(make, arguments, label, jobs=jobs, total=len(work), unit=unit):
        sealed.save_arrays(missing[i], *content)


def read_results(name: str, folder: str | os.PathLike | None = None) -> pd.DataFrame:
    """Read the table data/results/NAME.csv, or NAME.csv in another `folder`."""
    return listed.read_table(Path(folder or RESULTS) / f"{name}.csv", dtype=_TYPES)


def write_results(frame: pd.DataFrame, name: str, *, out: str | os.PathLike, float_format: str | None = "%.6f") -> None:
    """Write OUT/data/results/NAME.csv atomically, and list it in the manifest of its folder.

    `float_format`: of all floats; None: as many digits as they have.
    """
    text = frame.to_csv(index=False, float_format=float_format, lineterminator="\n")
    listed.write_listed(Path(out) / "data" / "results" / f"{name}.csv", text)
