"""`make hub-teacher AGENT=file.zip`: the paper's MountainCar part with another teacher, such as one of a model hub.

The paper's own teacher is the RL Zoo's TD3 agent, whose weights we do not have. `make study AGENT=file.zip` does the
same with the zoo's DDPG agent, its sibling.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from vsp.paper.ledger import distinct_results, ledger_table
from vsp.paper.results import write_results
from vsp.paper.runs import N_RUNS, Results, make_runs, paper_experiment, teacher_outcomes
from vsp.run import command

from .reproduction.teachers import rows_of
from .zoo import CAR, read


def main() -> None:
    """Distil the agent as often as the paper does. Write hub_teacher.csv, a row per run, and hub_teacher_ledger.csv,
    the ledger of the task's results, and print the second."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("agent", type=Path, help="a zip of Stable-Baselines3, trained for this task")
    parser.add_argument("--out", type=Path, default=".", help="results go to OUT/data/results, runs to OUT/build/study")
    parser.add_argument("--jobs", type=command.jobs, default=-1, help=command.JOBS)
    given = parser.parse_args()
    try:
        experiment = replace(paper_experiment(CAR), teacher=read(given.agent, CAR))
    except ValueError as error:
        raise command.CommandError(error) from error
    runs = given.out / "build" / "study"
    made = make_runs(experiment, range(N_RUNS[CAR]), runs=runs, jobs=given.jobs)
    results = Results(experiment, made, teacher_outcomes(experiment, runs=runs))
    ledger = distinct_results(ledger_table({CAR: results})).query("task == @CAR")
    write_results(rows_of(experiment, given.agent.stem, made), "hub_teacher", out=given.out)
    write_results(ledger, "hub_teacher_ledger", out=given.out)
    print(ledger[["subject", "quantity", "paper", "here", "low", "high", "verdict"]].to_string(index=False))


if __name__ == "__main__":
    with command.in_one_line():
        main()
