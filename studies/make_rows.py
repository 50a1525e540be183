"""Run `make beyond` and `make beyond-long`: make the rows of the comparison of methods, and time the methods."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from studies.results import write_results
from vsp.policy import VoronoiPolicy
from vsp.run import command

from .comparison import kept_robots
from .comparison.kept import KEPT, keep, keep_simplest
from .comparison.method_rows import jobs_of, make_all, pairs, rows, tables_of
from .comparison.method_tables import LONG, ROBOT_TABLES, TABLES, TASKS, WALKERS
from .comparison.regret import optimum


def main() -> None:
    """Make the missing rows, and write them to data/beyond/<table>_<task>.csv. Some tables also keep one policy, and
    the faithful table also has same_<task>.csv. Times go to <table>_seconds.csv, or to <table>_seconds_long.csv for the
    tasks that take hours.

    Also write optimum.csv; or, for the tasks that take hours, methods_<task>.policy, and for robots gait_<task>.csv and
    fewest_<task>.csv.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="results go to OUT/data/beyond, rows to OUT/build/beyond")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    parser.add_argument("--long", action="store_true", help="make the tasks whose rows take hours instead")
    parser.add_argument("--tables", nargs="+", choices=TABLES | ROBOT_TABLES, help="default: all")
    arguments = parser.parse_args()
    out, tasks = Path(arguments.out), (*LONG, *WALKERS) if arguments.long else TASKS
    rows_in, results = out / "build" / "methods", out / "data" / "beyond"
    advice = "leave --long out" if arguments.long else "add --long"
    wanted = {(table, task): jobs_of(task, table) for task in tasks for table in tables_of(task)}
    wanted = {about: jobs for about, jobs in wanted.items() if not arguments.tables or about[0] in arguments.tables}
    if not wanted:
        parser.error(f"argument --tables: {arguments.tables}: no rows for {tasks}, {advice}")
    make_all(rows_in, [job for jobs in wanted.values() for job in jobs], jobs=arguments.jobs)
    seconds = {}
    for (table, task), jobs in wanted.items():
        frame, took = rows(rows_in, jobs)
        seconds.setdefault(table, []).append(took)
        write_results(frame, f"{table}_{task}", out=out)
        if table == "faithful":
            write_results(pairs(rows_in, jobs), f"same_{task}", out=out)
        if table in KEPT:
            keep(rows_in, task, table, results / f"{table}_{task}.policy")
    for table, took in seconds.items():
        write_results(pd.concat(took), f"{table}_seconds{'_long' * arguments.long}", out=out)
    _beside(arguments.long, {table for table, _ in wanted}, out)


def _beside(long: bool, tables: set[str], out: Path) -> None:
    """Write the files that are made from the rows, or in addition to them."""
    results = out / "data" / "beyond"
    if "robots" in tables:
        for task in WALKERS:
            policy = VoronoiPolicy.load(results / f"robots_{task}.policy")
            write_results(kept_robots.gait(policy), f"gait_{task}", out=out)
            write_results(kept_robots.fewest(policy), f"fewest_{task}", out=out)
    if "beyond" in tables and long:
        for task in LONG:
            keep_simplest(task, results / f"methods_{task}.policy")
    elif "beyond" in tables:
        write_results(optimum(), "optimum", out=out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
