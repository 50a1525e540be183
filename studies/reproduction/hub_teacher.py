"""The paper's MountainCar part with another teacher, such as one of a model hub.

The paper's own teacher is the RL Zoo's TD3 agent, whose weights we do not have. The committed tables are those of the
zoo's DDPG agent, its sibling.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pandas as pd

from vsp.paper.ledger import ledger_table
from vsp.paper.runs import N_RUNS, Results, make_runs, paper_experiment, teacher_outcomes
from vsp.run.command import CommandError

from ..zoo import CAR, read
from .teachers import rows_of


def study(agent: Path, runs: str | os.PathLike, *, jobs: int | str = 1) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Distil the agent in a zip as often as the paper does; return a row per run, and the ledger of the task's results.

    Raises `CommandError` for an agent of another task.
    """
    try:
        experiment = replace(paper_experiment(CAR), teacher=read(agent, CAR))
    except ValueError as error:
        raise CommandError(error) from error
    made = make_runs(experiment, range(N_RUNS[CAR]), runs=runs, jobs=jobs)
    results = Results(experiment, made, teacher_outcomes(experiment, runs=runs))
    return rows_of(experiment, agent.stem, made), ledger_table({CAR: results}).query("fact and task == @CAR")
