"""`make study`: write the experiments on the reproduction to data/results/."""

from __future__ import annotations

import argparse
from pathlib import Path

from vsp.paper.results import write_results
from vsp.run import command

from .reproduction import interpretations, simpler, teachers


def main() -> None:
    """Make the missing runs of the experiments, and write readings.csv, teachers.csv and simpler.csv."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=".", help="write to OUT/data/results and OUT/build/study")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    given = parser.parse_args()
    out, jobs, runs = given.out, given.jobs, given.out / "build" / "study"
    write_results(interpretations.study(runs, jobs=jobs), "readings", out=out)
    write_results(teachers.study(runs, jobs=jobs), "teachers", out=out)
    write_results(simpler.study(out / "data" / "runs", jobs=jobs), "simpler", out=out, float_format=None)


if __name__ == "__main__":
    with command.in_one_line():
        main()
