"""`make runs`: make the distillations that the paper reports, and fit simpler policies to compare them with."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..run import atomic, command
from ..run.locks import file_lock
from .beside import N_BESIDE, QUICK_BESIDE, kept_comparison
from .runs import N_RUNS, paper_results


def main() -> None:
    """Make the runs that the paper reports; skip those that exist."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="write runs to OUT/data/runs")
    parser.add_argument("--quick", action="store_true", help="make a few short runs, as a test")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    arguments = parser.parse_args()
    out, jobs = Path(arguments.out), arguments.jobs
    runs = out / "data" / "runs"
    with file_lock(out / "build" / "locks" / "runs", f"makes runs in {out}"):
        for left in runs.rglob(atomic.TEMPORARY):
            left.unlink(missing_ok=True)  # left by a process that was killed
        for task in N_RUNS:
            results = paper_results(task, runs=runs, quick=arguments.quick, jobs=jobs)
            n_runs = QUICK_BESIDE if arguments.quick else N_BESIDE
            kept_comparison(results, n_runs, runs=runs, jobs=jobs)
            print(f"{task}: {len(results.runs)} runs and their comparison are complete", flush=True)


if __name__ == "__main__":
    with command.in_one_line():
        main()
