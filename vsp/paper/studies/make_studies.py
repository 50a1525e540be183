"""`make study`: write the studies to data/results/: readings.csv, teachers.csv and simpler.csv."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...run import command
from ..results import write_results
from . import interpretations, simpler, teachers


def main() -> None:
    """Make the missing runs of all studies, and write their results."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="write to OUT/data/results, OUT/data/runs and OUT/build/study")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    arguments = parser.parse_args()
    out, jobs = Path(arguments.out), arguments.jobs
    runs = out / "build" / "study"
    write_results(interpretations.study(runs, jobs=jobs), "readings", out=out)
    write_results(teachers.study(runs, jobs=jobs), "teachers", out=out)
    write_results(simpler.study(out / "data" / "runs", jobs=jobs), "simpler", out=out, float_format=None)


if __name__ == "__main__":
    with command.in_one_line():
        main()
