"""Many distillations: seeds, workers, one sealed file per run, resume, progress.

A run lies in a folder named by its provenance (see `results`), and its file states the provenance, too. So a changed
configuration, teacher or method never loads old runs, nor a run that was copied to another folder.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ..algorithms import VERSION, distill
from ..config import Config, paper_preset
from ..evaluation import rollout_from_seed
from ..policy import VoronoiPolicy
from ..rollouts import Outcomes
from ..run import sealed
from ..tasks.base import GOAL, PIT, TRUNCATED
from ..tasks.registry import get_task
from ..teachers.teacher import Teacher, load_teacher
from .readings import Readings
from .results import load_made, make_missing, provenance, provenance_folder

N_RUNS = {"SimpleGoal-v0": 85, "MountainCarContinuous-v0": 40}  # paper, section "Experimental Validation"
N_EPISODES = 1000
EVALUATION_SEED, VALIDATION_SEED = 1, 2  # start states for the reported results, and for choosing the best run
QUICK_RUNS, QUICK_EPISODES = 4, 100
SHARES = {"goal": GOAL, "pit": PIT, "truncated": TRUNCATED}  # outcomes of episodes whose shares are in the tables


@dataclass(frozen=True)
class Run:
    """One distillation and its evaluation."""

    seed: int
    policy: VoronoiPolicy
    outcomes: Outcomes  # on the shared start states
    validation_mean: float  # mean return on the validation starts
    cells: np.ndarray  # number of cells after each iteration
    splits: int
    merges: int


@dataclass(frozen=True)
class Experiment:
    """The settings that a set of runs shares: task, configuration, teacher, and the number of evaluation episodes."""

    task: str
    config: Config
    teacher: Teacher
    n_episodes: int = N_EPISODES
    readings: Readings | None = None  # other passes than those of `algorithms`

    @property
    def settings(self) -> dict:
        """Everything that determines the result of a run apart from teacher, version and seed, as JSON-able values."""
        return {
            "task": self.task,
            "config": self.config.settings() | asdict(self.readings or Readings()),
            "n_episodes": self.n_episodes,
            "start_seeds": [EVALUATION_SEED, VALIDATION_SEED],
            "versions": {name: _version(name) for name in ("numpy", "scipy")},
        }

    @cached_property
    def provenance(self) -> dict[str, str | int]:
        """The provenance of its runs: settings (an id), teacher, version."""
        return provenance(self.settings, self.teacher.digest, VERSION)

    def about(self, seed: int) -> dict:
        """Return what a file of this experiment states; `seed` is that of the run or of the start states."""
        return {"task": self.task, **self.provenance, "seed": seed}

    def folder(self, runs: str | os.PathLike) -> Path:
        """Return the folder of this experiment's runs, below the folder `runs`."""
        return provenance_folder(runs, self.task, self.provenance)


_version = cache(version)  # it takes milliseconds, and each run needs it


def paper_experiment(task: str, *, quick: bool = False) -> Experiment:
    """Return the paper's experiment on `task`: its hyperparameters, the shipped teacher, 1000 episodes."""
    config, task = paper_preset(task), get_task(task).name
    episodes = QUICK_EPISODES if quick else N_EPISODES
    return Experiment(task, config.quick() if quick else config, load_teacher(task), episodes)


def make_runs(experiment: Experiment, seeds, *, runs: str | os.PathLike, jobs: int | str = 1) -> list[Run]:
    """Distil once per seed, skip existing runs, and return the runs in the order of `seeds`; `jobs` as in `workers`."""
    seeds = list(seeds)
    make_all([(experiment, seed) for seed in seeds], runs=runs, jobs=jobs, label=experiment.task)
    return load_runs(experiment, seeds, runs=runs)


def make_all(work: Iterable, *, runs: str | os.PathLike, jobs: int | str = 1, label: str) -> None:
    """Make the runs (experiment, seed) of `work` that are missing in the folder `runs`; `jobs` as in `workers`."""
    asked = {run_path(experiment.folder(runs), seed): (experiment, seed) for experiment, seed in work}
    make_missing(make_run, asked, label, jobs=jobs, unit="runs")


def make_run(experiment: Experiment, seed: int) -> tuple[dict[str, np.ndarray], dict]:
    """Distil and evaluate once; return the arrays and about of the run's sealed file."""
    task, n = experiment.task, experiment.n_episodes
    readings = experiment.readings
    passes = {"split": readings.split, "merge": readings.merge} if readings else {}
    policy, history = distill(experiment.teacher, get_task(task), experiment.config, seed=seed, **passes)
    result = rollout_from_seed(policy, task, n, seed=EVALUATION_SEED)
    validation = rollout_from_seed(policy, task, n, seed=VALIDATION_SEED)
    arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
    arrays |= {**asdict(result), "cells": np.array(history.cells)}
    changes = [event.kind for event in history.events]
    about = {"validation_mean": float(validation.returns.mean())}
    about |= {f"{kind}s": changes.count(kind) for kind in ("split", "merge")}
    return arrays, {"kind": "Run", **experiment.about(seed), "settings in full": experiment.settings, **about}


def load_run(path: str | os.PathLike, experiment: Experiment) -> Run:
    """Read one run. Raises `atomic.DamagedFile`, also for a run of another experiment or of a seed not in its name."""
    arrays, about = load_made(path, "Run", experiment.about(int(Path(path).stem)))
    parameters = {name: arrays.pop(name) for name in ("codewords", "coefficients", "scale")}
    policy = VoronoiPolicy(**parameters, task=experiment.task, sub_policy=experiment.config.sub_policy)
    counts = {name: about[name] for name in ("seed", "validation_mean", "splits", "merges")}
    return Run(policy=policy, cells=arrays.pop("cells"), outcomes=Outcomes(**arrays), **counts)


def load_runs(experiment: Experiment, seeds, *, runs: str | os.PathLike) -> list[Run]:
    """Read the runs of these seeds. Raises as `load_run` does."""
    return [load_run(run_path(experiment.folder(runs), seed), experiment) for seed in seeds]


def outcome_shares(outcomes: np.ndarray) -> dict[str, float]:
    """Return the shares of the episodes that reached the goal, fell into the pit and were truncated, by name."""
    return {name: np.mean(outcomes == code) for name, code in SHARES.items()}


@dataclass(frozen=True)
class Results:
    """The paper's experiment on one task, with everything that its figures and tables need."""

    experiment: Experiment
    runs: list[Run]
    teacher_outcomes: Outcomes  # on the start states that the runs are evaluated on

    @property
    def teacher_returns(self) -> np.ndarray:
        """Returns of the teacher. (n_episodes,)"""
        return self.teacher_outcomes.returns

    @property
    def returns(self) -> np.ndarray:
        """Returns of the distilled policies. (n_runs, n_episodes)"""
        return np.stack([run.outcomes.returns for run in self.runs])

    @property
    def outcomes(self) -> np.ndarray:
        """Outcomes of the distilled policies, as indices of `vsp.tasks.OUTCOMES`. (n_runs, n_episodes)"""
        return np.stack([run.outcomes.outcomes for run in self.runs])

    @property
    def best(self) -> Run:
        """The run with the highest mean return on the validation starts; the lowest seed among equals."""
        return max(self.runs, key=lambda run: (run.validation_mean, -run.seed))


def paper_results(task: str, *, runs: str | os.PathLike, quick: bool = False, jobs: int | str = -1) -> Results:
    """Return the paper's experiment on `task`; make the runs that are missing in the folder `runs`."""
    experiment = paper_experiment(task, quick=quick)
    n = QUICK_RUNS if quick else N_RUNS[experiment.task]
    made = make_runs(experiment, range(n), runs=runs, jobs=jobs)
    return Results(experiment, made, teacher_outcomes(experiment, runs=runs))


@threadpool_limits.wrap(limits=1)  # the same order of sums, also without the thread limit of `make`
def teacher_outcomes(experiment: Experiment, *, runs: str | os.PathLike) -> Outcomes:
    """Return the teacher's episodes from the shared start states, stored beside the runs."""
    path, about = experiment.folder(runs) / "teacher.run", experiment.about(EVALUATION_SEED)
    if not path.exists():
        played = rollout_from_seed(experiment.teacher, experiment.task, experiment.n_episodes, seed=EVALUATION_SEED)
        sealed.save_arrays(path, asdict(played), {"kind": "Teacher", **about})
    return Outcomes(**load_made(path, "Teacher", about)[0])


def run_path(folder: str | os.PathLike, seed: int) -> Path:
    """Return the path of the run with this seed in the folder of its experiment."""
    return Path(folder) / f"{seed:04d}.run"
