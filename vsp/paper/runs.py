"""The paper's experiment: many distillations of one teacher, each a `Job`, and how they end."""

import os
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ..algorithms import VERSION, distill
from ..checks import check_count, check_finite
from ..config import Config, paper_preset
from ..evaluation import rollout_from_seed
from ..policy import VoronoiPolicy
from ..protocol import EVALUATION_SEED, N_EPISODES, job
from ..rollouts import Outcomes
from ..run import sealed
from ..run.identity import identity
from ..tasks import GOAL, PIT, TRUNCATED, get_task
from ..teachers import Teacher, digest_of, load_teacher
from .readings import Readings

N_RUNS = {"SimpleGoal-v0": 85, "MountainCarContinuous-v0": 40}  # paper, section "Experimental Validation"
VALIDATION_SEED = 2  # start states for choosing the best run
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
    readings: Readings | None = None  # other passes than those of `algorithms`: `Readings`, or an object like it

    @property
    def settings(self) -> dict:
        """Everything that determines the result of a run apart from teacher, version and seed, as JSON-able values."""
        own = isinstance(self.readings, Readings | None)
        passes = asdict(self.readings or Readings()) if own else {"passes": identity(self.readings)}
        return {
            "task": self.task,
            "config": self.config.settings() | passes,
            "n_episodes": self.n_episodes,
            "start_seeds": [EVALUATION_SEED, VALIDATION_SEED],
            "versions": job.LIBRARIES,
        }

    @cached_property
    def provenance(self) -> dict[str, str | int]:
        """The provenance of its runs: settings (an id), teacher, version."""
        return job.provenance(self.settings, digest_of(self.teacher), VERSION)

    def folder(self, runs: str | os.PathLike) -> Path:
        """Return the folder of this experiment's runs, below the folder `runs`."""
        return Distillation(self, 0).path(runs).parent


@dataclass(frozen=True)
class Distillation(job.Job):
    """One run of an experiment."""

    experiment: Experiment
    seed: int
    kind = "Run"

    @property
    def task(self) -> str:
        """The experiment's task."""
        return self.experiment.task

    @property
    def provenance(self) -> dict[str, str | int]:
        """The experiment's provenance."""
        return self.experiment.provenance

    def make(self) -> tuple[dict[str, np.ndarray], dict]:
        """Distil and evaluate once."""
        one, n = self.experiment, self.experiment.n_episodes
        passes = {"split": one.readings.split, "merge": one.readings.merge} if one.readings else {}
        policy, history = distill(one.teacher, get_task(one.task), one.config, seed=self.seed, **passes)
        result = rollout_from_seed(policy, one.task, n, seed=EVALUATION_SEED)
        validation = rollout_from_seed(policy, one.task, n, seed=VALIDATION_SEED)
        arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
        arrays |= {**asdict(result), "cells": np.array(history.cells)}
        changes = [event.kind for event in history.events]
        about = {"validation_mean": float(validation.returns.mean())}
        about |= {f"{kind}s": changes.count(kind) for kind in ("split", "merge")}
        return arrays, {"settings in full": one.settings, **about}

    def run(self, folder: str | os.PathLike) -> Run:
        """Read the run. Raises `atomic.DamagedFile`, also for a run of another experiment or seed."""
        (arrays, about), config = self.load(folder), self.experiment.config
        codewords, coefficients, scale, cells = map(arrays.pop, ("codewords", "coefficients", "scale", "cells"))
        policy = VoronoiPolicy(
            codewords, coefficients, task=self.task, metric=config.metric, scale=scale, sub_policy=config.sub_policy
        )
        check_finite(f"{self.path(folder)}: returns", arrays["returns"])
        counts = {name: about[name] for name in ("seed", "validation_mean", "splits", "merges")}
        return Run(policy=policy, cells=cells, outcomes=Outcomes(**arrays), **counts)


def paper_experiment(task: str, *, quick: bool = False) -> Experiment:
    """Return the paper's experiment on `task`: its hyperparameters, the shipped teacher, 1000 episodes."""
    config, task = paper_preset(task), get_task(task).name
    episodes = QUICK_EPISODES if quick else N_EPISODES
    return Experiment(task, config.quick() if quick else config, load_teacher(task), episodes)


def make_runs(experiment: Experiment, seeds, *, runs: str | os.PathLike, jobs: int | str = 1) -> list[Run]:
    """Distil once per seed, skip existing runs, and return the runs in the order of `seeds`; `jobs` as in `workers`."""
    made = [Distillation(experiment, seed) for seed in seeds]
    job.make_all(made, runs, experiment.task, jobs=jobs)
    return [one.run(runs) for one in made]


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


def paper_results(
    task: str, *, runs: str | os.PathLike, n: int = 0, quick: bool = False, jobs: int | str = -1
) -> Results:
    """Return the paper's experiment on `task`; make the runs that are missing in the folder `runs`. `n`: how many runs;
    0: as many as in the paper, or a few if `quick`. Raises ValueError unless `n` is such a number."""
    one = paper_experiment(task, quick=quick)
    check_count("n", n := n or (QUICK_RUNS if quick else N_RUNS[one.task]))
    return results_of(one, n, runs=runs, jobs=jobs)


def results_of(experiment: Experiment, n: int, *, runs: str | os.PathLike, jobs: int | str = 1) -> Results:
    """Return the results of an experiment with the seeds 0 to n - 1; make the missing runs."""
    made = make_runs(experiment, range(n), runs=runs, jobs=jobs)
    return Results(experiment, made, teacher_outcomes(experiment, runs=runs))


@threadpool_limits.wrap(limits=1)  # the same order of sums, also without the thread limit of `make`
def teacher_outcomes(experiment: Experiment, *, runs: str | os.PathLike) -> Outcomes:
    """Return the teacher's episodes from the shared start states, stored beside the runs."""
    like = Distillation(experiment, EVALUATION_SEED)
    path = experiment.folder(runs) / "teacher.run"
    if not path.exists():
        played = rollout_from_seed(experiment.teacher, experiment.task, experiment.n_episodes, seed=EVALUATION_SEED)
        sealed.save_arrays(path, asdict(played), {"kind": "Teacher", **like.about()})
    return Outcomes(**job.load_made(path, "Teacher", like.about())[0])
