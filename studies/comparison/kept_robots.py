"""Make two tables for the kept policy of a robot: its gait, step by step, and how few of its numbers it needs."""

from __future__ import annotations

import numpy as np
import pandas as pd

from vsp.evaluation import start_states
from vsp.paper.results import provenance
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout

from ..robots import fewest_numbers, record_gait
from .kept import kept_job
from .measure import N_REPORTED, NEW_SEED

VERSION = 2  # raise it when the same policy gives a different table
GAIT = {"start": 0.0, "n_steps": 200}
FEWEST = {"keep": 0.95, "n_episodes": 20, "seed": 0}


def gait(policy: VoronoiPolicy) -> pd.DataFrame:
    """Return the table of `record_gait` for one episode, with the provenance."""
    task = policy.task.name
    return record_gait(policy, task, **GAIT).assign(**provenance_of("gait", task))


def fewest(policy: VoronoiPolicy) -> pd.DataFrame:
    """Return the candidates of `fewest_numbers`, then two rows measured from the starts of the robots' tables.

    These two have the stages "all numbers" and "fewest"; there `kept` tells whether enough of the return is left.
    """
    task = policy.task
    small, rows = fewest_numbers(policy, **FEWEST)
    starts = start_states(task, N_REPORTED // task.slowness, NEW_SEED)
    own = rollout(policy, task, starts).returns.mean()
    ends = []
    for stage, one in (("all numbers", policy), ("fewest", small)):
        size = {"cells": len(one), "nonzero": np.count_nonzero(one.coefficients), "digits": 0}
        mean = rollout(one, task, starts).returns.mean()
        ends.append({"stage": stage, **size, "mean": mean, "kept": mean >= FEWEST["keep"] * own})
    if len(short := rows.loc[(rows["stage"] == "digits") & rows["kept"], "digits"]):
        ends[1]["digits"] = int(short.iloc[-1])
    return pd.concat([rows, pd.DataFrame(ends)], ignore_index=True).assign(**provenance_of("fewest", task.name))


def provenance_of(name: str, task: str) -> dict[str, str | int]:
    """Return the provenance of the table `name`, which includes that of the policy."""
    made_with = kept_job(task, "robots").provenance
    settings = {"policy": made_with, "table": name, **(GAIT if name == "gait" else FEWEST)}
    return {**made_with, **provenance(settings, made_with["teacher"], VERSION)}
