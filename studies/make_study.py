"""`make study`, `make hidden`, `make hub-teacher`: write the experiments on the reproduction to data/results/."""

from __future__ import annotations

from pathlib import Path

from vsp.paper.results import write_results
from vsp.run import command

from .reproduction import hidden, hub_teacher, simpler, verdicts


def main() -> None:
    """Make the missing runs of the experiments, and write simpler.csv and verdicts.csv.

    With --hidden, search for hidden settings instead. With --agent, write hub_teacher_ledger.csv instead, and print it.
    """
    parser = command.parser(main.__doc__, "write to OUT/data/results and OUT/build/study")
    parser.add_argument("--agent", type=Path, help="a zip of Stable-Baselines3, trained for MountainCar")
    parser.add_argument("--hidden", action="store_true", help="write hidden_*.csv")
    given = parser.parse_args()
    out, jobs, runs = given.out, given.jobs, given.out / "build" / "study"
    if given.agent:
        ledger = hub_teacher.study(given.agent, runs, jobs=jobs)
        write_results(ledger, "hub_teacher_ledger", out=out)
        print(ledger[["subject", "quantity", "paper", "here", "low", "high", "verdict"]].to_string(index=False))
        return
    if given.hidden:
        hidden.search(out, jobs)
        return
    write_results(simpler.study(out / "data" / "runs", jobs=jobs), "simpler", out=out, float_format=None)
    write_results(verdicts.study(runs, jobs=jobs), "verdicts", out=out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
