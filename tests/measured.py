"""The figures that `make bench` and `make torture` measure, in one table: data/results/trust.csv.

    python tests/measured.py data/results/trust.csv

prints them as the README shows them.
"""

import os
import platform
import sys
from pathlib import Path

import pandas as pd

COLUMNS = ["table", "what", "to hold", "measured", "held", "machine"]


TABLES = {"faults": "Faults", "input": "Bad input", "same": "The same everywhere", "speed": "Speed"}


def machine() -> str:
    """Processor, cores, memory and system of this machine, in words."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{_processor()}, {os.cpu_count()} cores, {memory:.0f} GB, {platform.system()}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()


def record(path: Path, table: str, what: str, to_hold: str, measured: str, held: str) -> None:
    """Put one row into the CSV at `path`, in the place of the one with the same `table` and `what`."""
    from vsp.store import read_table, write_listed

    row = dict(zip(COLUMNS, (table, what, to_hold, measured, held, machine())))
    frame = read_table(path, dtype=str) if path.exists() else pd.DataFrame(columns=COLUMNS)
    same = (frame["table"] == table) & (frame["what"] == what)
    place = frame.index[same][0] if same.any() else len(frame)
    frame.loc[place] = row
    write_listed(path, frame.to_csv(index=False, lineterminator="\n"))


def markdown(path: Path) -> str:
    """The rows of the CSV at `path` for the README, with the machines that they were measured on."""
    from vsp.store import read_table

    frame = read_table(path, dtype=str)
    lines = ["| what | to hold | measured | held |", "|---|---|---|---|"]
    for table, title in TABLES.items():
        rows = frame[frame["table"] == table].drop(columns=["table", "machine"])
        lines += [f"| **{title}** | | | |"] + [f"| {' | '.join(row)} |" for row in rows.itertuples(index=False)]
    return "\n".join([*lines, "", f"Measured on {'; '.join(frame['machine'].unique())}."])


if __name__ == "__main__":
    print(markdown(Path(sys.argv[1])))
