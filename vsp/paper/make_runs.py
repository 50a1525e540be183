"""`make runs`: make the distillations that the paper reports. `make study`: write the studies to data/results/."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..run import command
from .results import write_results
from .runs import N_RUNS, paper_results


def main() -> None:
    """Make the runs that the paper reports; skip those that exist.

    With --study, do so for the studies and write readings.csv, teachers.csv and simpler.csv.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=".", help="write to OUT/data and OUT/build/study")
    parser.add_argument("--quick", action="store_true", help="make a few short runs, as a test")
    parser.add_argument("--study", action="store_true", help="make the studies instead")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    arguments = parser.parse_args()
    runs, jobs = arguments.out / "data" / "runs", arguments.jobs
    if arguments.study:
        from .studies import interpretations, simpler, teachers

        out, study_runs = arguments.out, arguments.out / "build" / "study"
        write_results(interpretations.study(study_runs, jobs=jobs), "readings", out=out)
        write_results(teachers.study(study_runs, jobs=jobs), "teachers", out=out)
        write_results(simpler.study(runs, jobs=jobs), "simpler", out=out, float_format=None)
    else:
        for task in N_RUNS:
            results = paper_results(task, runs=runs, quick=arguments.quick, jobs=jobs)
            print(f"{task}: {len(results.runs)} runs are complete", flush=True)


if __name__ == "__main__":
    with command.in_one_line():
        main()
