"""The study of the teachers: how much of the result depends on the one teacher that all runs of a task share."""

from __future__ import annotations

import dataclasses
import itertools
import os
from pathlib import Path

import numpy as np
import pandas as pd

from vsp.evaluation import rollout_from_seed
from vsp.paper import printed
from vsp.paper.baselines import linear_map
from vsp.paper.runs import EVALUATION_SEED, SHARES, Distillation, Experiment, Run, load_runs, paper_experiment
from vsp.paper.tables import run_summary
from vsp.protocol.job import make_all, settings_id
from vsp.teachers.teacher import SHIPPED, further_teachers, load_teacher

from .simpler import teacher_data

VERSION = 1  # raise it when the same runs give other rows
SEEDS = range(1000, 1010)  # of the distillations of each teacher


def teachers(task: str) -> dict[str, Path]:
    """Return the teachers of `task` by name: the shipped one, and those with shorter training."""
    return {"shipped": SHIPPED / f"{task}.safetensors"} | further_teachers(task)


def study(runs: str | os.PathLike, *, jobs: int | str = 1, tasks=printed.TASKS) -> pd.DataFrame:
    """Distil every teacher with the seeds SEEDS; return one row per run.

    Column `teacher` is the name of the teacher; `checksum` is what other tables call `teacher`.
    """
    work = experiments(tasks)
    asked = itertools.starmap(Distillation, itertools.product(work.values(), SEEDS))
    make_all(asked, runs, "teachers", jobs=jobs)
    parts = (rows_of(one, name, load_runs(one, SEEDS, runs=runs)) for (_, name), one in work.items())
    return pd.concat(parts, ignore_index=True)


def rows_of(experiment: Experiment, name: str, made: list[Run]) -> pd.DataFrame:
    """Return the rows of the teacher with this `name`, one per run of `made`."""
    made_with = provenance_of(experiment)
    teacher = rollout_from_seed(experiment.teacher, experiment.task, seed=EVALUATION_SEED).returns
    about = {
        "task": experiment.task, "teacher": name, "settings": made_with["settings"], "checksum": made_with["teacher"],
        "version": made_with["version"], "steps": experiment.teacher.card["recipe"]["steps"],
        "linear_error": linear_error(experiment),
    }  # fmt: skip
    rows = run_summary(made, experiment).assign(teacher_mean=teacher.mean(), teacher_std=teacher.std(ddof=1))
    columns = ["seed", "cells", "mean", "std", "teacher_mean", "teacher_std", *SHARES]
    return pd.DataFrame(about, index=rows.index).join(rows[columns])


def provenance_of(experiment: Experiment) -> dict[str, str | int]:
    """Return the provenance of the rows of an experiment; the version is that of the paper's method."""
    settings = {"runs": experiment.settings, "linear error of seed": SEEDS[0], "study": VERSION}
    return experiment.provenance | {"settings": settings_id(settings)}


def linear_error(experiment: Experiment) -> float:
    """Return the root mean square error of one linear map fitted to the teacher's episodes, in units of the action."""
    states, actions = teacher_data(experiment, SEEDS[0])
    error = linear_map(states, actions, experiment.task).linear(states) - actions
    return float(np.sqrt(np.square(error).mean()))


def experiments(tasks=printed.TASKS) -> dict[tuple[str, str], Experiment]:
    """Return the paper's experiment with each teacher, by task and name of the teacher."""
    return {
        (task, name): dataclasses.replace(paper_experiment(task), teacher=load_teacher(path))
        for task in tasks
        for name, path in teachers(task).items()
    }
