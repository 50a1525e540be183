"""`make runs`: make the distillations that the paper reports."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..run import command
from .runs import N_RUNS, paper_results


def main() -> None:
    """Make the runs that the paper reports; skip those that exist."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=".", help="write to OUT/data/runs")
    parser.add_argument("--quick", action="store_true", help="make a few short runs, as a test")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    arguments = parser.parse_args()
    for task in N_RUNS:
        runs = arguments.out / "data" / "runs"
        results = paper_results(task, runs=runs, quick=arguments.quick, jobs=arguments.jobs)
        print(f"{task}: {len(results.runs)} runs are complete", flush=True)


if __name__ == "__main__":
    with command.in_one_line():
        main()
