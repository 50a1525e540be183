"""`make study`, `make hidden`, `make hub-teacher`: write the experiments on the reproduction to data/results/."""

from dataclasses import replace
from pathlib import Path

import pandas as pd

from vsp.paper.ledger import ledger_table
from vsp.paper.results import write_results
from vsp.paper.runs import N_RUNS, paper_experiment, results_of
from vsp.run import command

from .reproduction import hidden, simpler, verdicts
from .zoo import CAR, read


def main() -> None:
    """Make the missing runs of the experiments, and write simpler.csv and verdicts.csv. With --hidden, search for
    hidden settings instead. With --agent, write hub_teacher_ledger.csv instead, and print it."""
    parser = command.parser(main.__doc__, "write to OUT/data/results and OUT/build/study")
    parser.add_argument("--agent", type=Path, help="a zip of Stable-Baselines3, trained for MountainCar")
    parser.add_argument("--hidden", action="store_true", help="write hidden_*.csv")
    given = parser.parse_args()
    out, jobs, runs = given.out, given.jobs, given.out / "build" / "study"
    if given.agent:
        ledger = with_another_teacher(given.agent, runs, jobs)
        write_results(ledger, "hub_teacher_ledger", out=out)
        print(ledger[["subject", "quantity", "paper", "here", "low", "high", "verdict"]].to_string(index=False))
        return
    if given.hidden:
        hidden.search(out, jobs)
        return
    write_results(simpler.study(out / "data" / "runs", jobs=jobs), "simpler", out=out, float_format=None)
    write_results(verdicts.study(runs, jobs=jobs), "verdicts", out=out)


def with_another_teacher(agent: Path, runs: Path, jobs: int | str) -> pd.DataFrame:
    """Distil the agent in a zip as often as the paper distils MountainCar's teacher; return the ledger of the results.
    The paper's own teacher is the RL Zoo's TD3 agent, whose weights we do not have. The committed table is that of the
    zoo's DDPG agent, its sibling. Raises `CommandError` for an agent of another task."""
    try:
        experiment = replace(paper_experiment(CAR), teacher=read(agent, CAR))
    except ValueError as error:
        raise command.CommandError(error) from error
    results = results_of(experiment, N_RUNS[CAR], runs=runs, jobs=jobs)
    return ledger_table({CAR: results}).query("fact and task == @CAR")


if __name__ == "__main__":
    with command.in_one_line():
        main()
