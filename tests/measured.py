"""The figures that `make bench` and `make torture` measure, in one table: trust.csv.

    python tests/measured.py build/measured data/results README.md

puts the tables in the first folder, where the tests write as they go, into the second, and the figures into the README,
between two lines that say so. Not before: a notebook shows them, and tests compare what notebooks make.
"""

import os
import platform
import re
import sys
from pathlib import Path

import pandas as pd

from vsp import store
from vsp.machine import cpu_type

COLUMNS = ["table", "what", "to hold", "measured", "held", "machine"]
TABLES = {"faults": "Faults", "input": "Bad input", "same": "The same everywhere", "speed": "Speed"}
BLOCK = re.compile(r"(<!-- measured -->\n).*(<!-- end of what was measured -->)", re.DOTALL)


def machine() -> str:
    """Processor, cores, memory and type of this machine, in words."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{_processor()}, {os.cpu_count()} cores, {memory:.0f} GB ({cpu_type()})"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()


def record(path: Path, table: str, what: str, to_hold: str, measured: str, held: str) -> None:
    """Put one row into the CSV at `path`, in the place of the one with the same `table` and `what`."""
    row = dict(zip(COLUMNS, (table, what, to_hold, measured, held, machine())))
    write(path, merged(read(path), pd.DataFrame([row])))


def read(path: Path) -> pd.DataFrame:
    """The table at `path`, empty if there is none."""
    return store.read_table(path, dtype=str) if path.exists() else pd.DataFrame(columns=COLUMNS, dtype=str)


def write(path: Path, frame: pd.DataFrame) -> None:
    store.write_listed(path, frame.to_csv(index=False, lineterminator="\n"))


def merged(old: pd.DataFrame, new: pd.DataFrame) -> pd.DataFrame:
    """The rows of both, the new one in the place of an old one; tables in the order of `TABLES`, rows by name."""
    frame = pd.concat([old, new]).groupby(["table", "what"], as_index=False).last()[COLUMNS]
    return frame.sort_values("table", key=lambda names: names.map(list(TABLES).index), kind="stable", ignore_index=True)


def markdown(path: Path) -> str:
    """The rows of the CSV at `path` for the README, with the machines that they were measured on."""
    frame = read(path)
    lines = ["| what | to hold | measured | held |", "|---|---|---|---|"]
    for table, title in TABLES.items():
        rows = frame[frame["table"] == table].drop(columns=["table", "machine"])
        lines += [f"| **{title}** | | | |"] * bool(len(rows))
        lines += [
            f"| {' | '.join(' '.join(text.split()).replace('|', '/') for text in row)} |" for row in rows.to_numpy()
        ]
    return "\n".join([*lines, "", f"Measured on {'; '.join(frame['machine'].unique())}.\n"])


def main() -> None:
    source, results, readme = map(Path, sys.argv[1:])
    for path in source.glob("*.csv"):
        if path.name == "trust.csv":
            write(results / path.name, merged(read(results / path.name), read(path)))
        else:
            store.write_listed(results / path.name, store.read_listed(path))
    if results.resolve() != store.ROOT / "data" / "results":
        return  # the README tells what is committed
    text = markdown(results / "trust.csv")
    store.write_text(readme, BLOCK.sub(lambda block: block[1] + text + block[2], readme.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
