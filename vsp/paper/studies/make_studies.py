"""`make study`: write the studies of the readings and of the teachers to data/results/readings.csv and teachers.csv."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...run import command
from ..results import write_results
from . import interpretations, teachers

STUDIES = {"readings": interpretations.study, "teachers": teachers.study}


def main() -> None:
    """Make the missing runs of both studies, and write their results."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="write results to OUT/data/results, runs to OUT/build/study")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    arguments = parser.parse_args()
    runs = Path(arguments.out) / "build" / "study"
    for name, study in STUDIES.items():
        write_results(study(runs, jobs=arguments.jobs), name, out=arguments.out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
