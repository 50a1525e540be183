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
from vsp.paper.runs import N_RUNS, paper_experiment, results_of
from vsp.run.command import CommandError

from ..zoo import CAR, read


def study(agent: Path, runs: str | os.PathLike, *, jobs: int | str = 1) -> pd.DataFrame:
    """Distil the agent in a zip as often as the paper does; return the ledger of the task's results.

    Raises `CommandError` for an agent of another task.
    """
    try:
        experiment = replace(paper_experiment(CAR), teacher=read(agent, CAR))
    except ValueError as error:
        raise CommandError(error) from error
    results = results_of(experiment, N_RUNS[CAR], runs=runs, jobs=jobs)
    return ledger_table({CAR: results}).query("fact and task == @CAR")
