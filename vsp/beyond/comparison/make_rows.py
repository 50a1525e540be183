"""`make beyond` and `make beyond-long`: the rows of the comparison of methods, and how long methods take."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from ...paper.results import write_results
from ...run import command
from .kept import keep_faithful, keep_simplest
from .method_rows import LONG, TABLES, TASKS, jobs_of, make_all, pairs, rows, tables_of
from .regret import optimum
from .time_to_quality import time_to_quality


def main() -> None:
    """Make the rows that are missing, and write data/results/<table>_<task>.csv, same_<task>.csv and
    faithful_<task>.policy beside the faithful table, times in <table>_seconds.csv, beyond_race.csv and optimum.csv; or
    those of the tasks whose rows take hours, their times in <table>_seconds_long.csv, and beyond_<task>.policy.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="results go to OUT/data/results, rows to OUT/build/beyond")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    parser.add_argument("--long", action="store_true", help="the tasks whose rows take hours")
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=list(TABLES), help="default: all")
    arguments = parser.parse_args()
    out, tasks = Path(arguments.out), LONG if arguments.long else TASKS
    rows_in = out / "build" / "beyond"
    wanted = {(table, task): jobs_of(task, table) for task in tasks for table in tables_of(task)}
    wanted = {about: some for about, some in wanted.items() if about[0] in arguments.tables}
    make_all(rows_in, [job for some in wanted.values() for job in some], jobs=arguments.jobs)
    for table in dict.fromkeys(table for table, _ in wanted):
        found = {task: rows(rows_in, wanted[table, task]) for task in tasks}
        for task, (frame, _) in found.items():
            write_results(frame, f"{table}_{task}", out=out)
            if table == "faithful":
                write_results(pairs(rows_in, wanted[table, task]), f"same_{task}", out=out)
                keep_faithful(rows_in, task, out / "data" / "results" / f"faithful_{task}.policy")
        seconds = pd.concat([took for _, took in found.values()])
        write_results(seconds, f"{table}_seconds{'_long' * arguments.long}", out=out)
    if "beyond" in arguments.tables and arguments.long:
        for task in tasks:
            keep_simplest(task, out / "data" / "results" / f"beyond_{task}.policy")
    elif "beyond" in arguments.tables:
        write_results(time_to_quality(), "beyond_race", out=out)
        write_results(optimum(), "optimum", out=out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
