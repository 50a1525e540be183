"""Run `make beyond` and `make beyond-long`: make the rows of the comparison of methods, and time the methods."""

import pandas as pd

from vsp.run import command

from .committed import write_results
from .comparison.beside import beside
from .comparison.methods import LONG, TABLES
from .comparison.rows import committed_rows, make_all


def main() -> None:
    """Make the rows that are not committed, and write all to data/beyond/<table>_<task>.csv, with what stands beside
    them. Times go to <table>_seconds.csv, or to <table>_seconds_long.csv for the tasks that take hours."""
    parser = command.parser(main.__doc__, "results go to OUT/data/beyond, rows to OUT/build/beyond")
    parser.add_argument("--long", action="store_true", help="make the tasks whose rows take hours instead")
    arguments = parser.parse_args()
    out, folder = arguments.out, arguments.out / "build" / "beyond"
    tables = [(task, table) for task in TABLES for table in TABLES[task] if (task in LONG) == arguments.long]
    rows = {each: committed_rows(*each) for each in tables}
    files = [file for each in tables for file in beside(*each)]
    todo = [job for known in rows.values() for job, row in known.items() if row is None]
    todo += [job for file in files if not file.current for job in file.jobs]
    make_all(folder, todo, jobs=arguments.jobs)
    seconds: dict[str, list[pd.DataFrame]] = {}
    for (task, table), known in rows.items():
        frame = pd.DataFrame([row or job.row(folder) for job, row in known.items()])
        seconds.setdefault(table, []).append(frame.loc[:, :"seconds"])
        write_results(frame.drop(columns=["task", "seconds"]), f"{table}_{task}", out=out)
    for table, times in seconds.items():
        write_results(pd.concat(times), f"{table}_seconds{'_long' * arguments.long}", out=out)
    for file in files:
        file.write(folder, out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
