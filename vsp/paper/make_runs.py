"""`make runs`: the distillations that the paper reports, and the simpler policies beside them."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..run import atomic, command, workers
from ..run.locks import file_lock, terminate_peers
from .beside import N_BESIDE, QUICK_BESIDE, kept_comparison
from .runs import N_RUNS, paper_results


def main() -> None:
    """Make the runs that the paper reports, or those of them that are missing."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="runs go to OUT/data/runs")
    parser.add_argument("--quick", action="store_true", help="a few short runs, to see that all works")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    arguments = parser.parse_args()
    out, jobs = Path(arguments.out), arguments.jobs
    runs, locks = out / "data" / "runs", out / "build" / "locks"
    with file_lock(locks / "runs", f"makes runs in {out}"):
        for left in runs.rglob(atomic.TEMPORARY):
            left.unlink(missing_ok=True)  # of a process that was killed
        try:
            for task in N_RUNS:
                results = paper_results(task, runs=runs, quick=arguments.quick, jobs=jobs)
                n_runs = QUICK_BESIDE if arguments.quick else N_BESIDE
                kept_comparison(results, n_runs, runs=runs, jobs=jobs)
                print(f"{task}: {len(results.runs)} runs are there, and what stands beside them", flush=True)
        except workers.WorkerDied:
            terminate_peers(locks)  # make would wait for its notebooks, minutes
            raise


if __name__ == "__main__":
    with command.in_one_line():
        main()
