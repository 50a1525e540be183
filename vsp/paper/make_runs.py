"""`make runs`: make the distillations that the paper reports."""

from ..run import command
from .runs import N_RUNS, paper_results


def main() -> None:
    """Make the runs that the paper reports; skip those that exist."""
    parser = command.parser(main.__doc__, "write to OUT/data/runs")
    parser.add_argument("--quick", action="store_true", help="make a few short runs, as a test")
    arguments = parser.parse_args()
    for task in N_RUNS:
        runs = arguments.out / "data" / "runs"
        results = paper_results(task, runs=runs, quick=arguments.quick, jobs=arguments.jobs)
        print(f"{task}: {len(results.runs)} runs are complete", flush=True)


if __name__ == "__main__":
    with command.in_one_line():
        main()
