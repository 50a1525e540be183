"""Run `make beyond` and `make beyond-long`: make the rows of the comparison of methods, and time the methods."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from vsp.run import command

from .comparison.methods import LONG, TABLES
from .comparison.rows import best_returns, extras, jobs_of, make_all, rows
from .results import write_results


def main() -> None:
    """Make the missing rows, and write them to data/beyond/<table>_<task>.csv, with what is kept beside them: policies,
    the sameness of faithful ones, gaits. Times go to <table>_seconds.csv, or to <table>_seconds_long.csv for the tasks
    that take hours. The returns of the best policies go to optimum.csv.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=".", help="results go to OUT/data/beyond, rows to OUT/build/beyond")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    parser.add_argument("--long", action="store_true", help="make the tasks whose rows take hours instead")
    arguments = parser.parse_args()
    out, folder = arguments.out, arguments.out / "build" / "beyond"
    wanted = {
        (table, task): jobs_of(task, table)
        for task in TABLES
        for table in TABLES[task]
        if (task in LONG) == arguments.long
    }
    make_all(folder, [job for jobs in wanted.values() for job in jobs], jobs=arguments.jobs)
    seconds: dict[str, list[pd.DataFrame]] = {}
    for (table, task), jobs in wanted.items():
        frame, times = rows(folder, jobs)
        seconds.setdefault(table, []).append(times)
        write_results(frame, f"{table}_{task}", out=out)
        for _, _, write in extras(task, table):
            write(folder, out)
    for table, times in seconds.items():
        write_results(pd.concat(times), f"{table}_seconds{'_long' * arguments.long}", out=out)
    if not arguments.long:
        write_results(best_returns(), "optimum", out=out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
