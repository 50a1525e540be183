"""Run `make beyond` and `make beyond-long`: make the rows of the comparison of methods, and time the methods."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from vsp.run import command

from .comparison.methods import LONG, TABLES
from .comparison.rows import best_returns, jobs_of, make_all, rows, write_extras
from .results import write_results


def main() -> None:
    """Make the missing rows, and write them to data/beyond/<table>_<task>.csv, with what is kept beside them: policies,
    the sameness of faithful ones, gaits. Times go to <table>_seconds.csv, or to <table>_seconds_long.csv for the tasks
    that take hours. The returns of the best policies go to optimum.csv.
    """
    names = list(dict.fromkeys(table for tables in TABLES.values() for table in tables))
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="results go to OUT/data/beyond, rows to OUT/build/beyond")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    parser.add_argument("--long", action="store_true", help="make the tasks whose rows take hours instead")
    parser.add_argument("--tables", nargs="+", choices=names, default=names, help="default: all")
    arguments = parser.parse_args()
    folder, long = Path(arguments.out) / "build" / "beyond", arguments.long
    asked = [
        (table, task)
        for task in TABLES
        for table in TABLES[task]
        if (task in LONG) == long and table in arguments.tables
    ]
    make_all(folder, [job for table, task in asked for job in jobs_of(task, table)], jobs=arguments.jobs)
    seconds: dict[str, list[pd.DataFrame]] = {}
    for table, task in asked:
        frame, times = rows(folder, jobs_of(task, table))
        seconds.setdefault(table, []).append(times)
        write_results(frame, f"{table}_{task}", out=arguments.out)
        write_extras(folder, task, table, arguments.out)
    for table, times in seconds.items():
        write_results(pd.concat(times), f"{table}_seconds{'_long' * long}", out=arguments.out)
    if "methods" in seconds and not long:
        write_results(best_returns(), "optimum", out=arguments.out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
