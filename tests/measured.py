"""Collects what `make bench` and `make faults` measure in one table, trust.csv, which docs/reference.md shows.

    python tests/measured.py build/measured data/results

merges the table of the first folder, where the tests write as they run, into that of the second. This waits until the
tests have ended, because they compare what is made from data/results.
"""

import os
import platform
import sys
from pathlib import Path

import pandas as pd

from vsp.paper.results import read_results
from vsp.run import kernels, listed

COLUMNS = ["table", "what", "rule", "target", "measured", "unit", "low", "high", "met", "note", "machine"]
TABLES = ["faults", "input", "same", "speed"]


def machine() -> str:
    """Processor, cores, memory and kernels of this machine."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{_processor()}, {os.cpu_count()} cores, {memory:.0f} GB ({kernels.name()})"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()


def row(
    table: str, what: str, measured: float, unit: str, *, at_least: float | None = None, at_most: float | None = None,
    low: float | None = None, high: float | None = None, note: str = "",
) -> dict:  # fmt: skip
    """A row of trust.csv. `low` and `high` are the range of repeated measurements, `measured` their median."""
    rule, target = ("at most", at_most) if at_least is None else ("at least", at_least)
    met = measured <= target if at_least is None else measured >= target
    numbers = (rule, target, measured, unit, low, high)
    return dict(zip(COLUMNS, (table, what, *numbers, "yes" if met else "no", note, machine()), strict=True))


def add(path: Path, new: dict) -> None:
    """Put a row into the CSV at `path`, in place of the one with the same `table` and `what`."""
    write(path, merged(read(path), pd.DataFrame([new])))


def read(path: Path) -> pd.DataFrame:
    """The table at `path`, empty if there is none."""
    return read_results(path.stem, path.parent) if path.exists() else pd.DataFrame(columns=COLUMNS)


def write(path: Path, frame: pd.DataFrame) -> None:
    listed.write_listed(path, frame.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def merged(old: pd.DataFrame, new: pd.DataFrame) -> pd.DataFrame:
    """The rows of both, new ones in place of old ones; tables in the order of `TABLES`, rows by name."""
    frame = pd.concat([part for part in (old, new) if len(part)])[COLUMNS]
    frame = frame.drop_duplicates(["table", "what"], keep="last").sort_values("what")
    return frame.sort_values("table", key=lambda names: names.map(TABLES.index), kind="stable", ignore_index=True)


def main() -> None:
    source, results = map(Path, sys.argv[1:])
    write(results / "trust.csv", merged(read(results / "trust.csv"), read(source / "trust.csv")))


if __name__ == "__main__":
    main()
