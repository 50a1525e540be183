"""Many distillations: seeds, workers, one sealed file per run, resume, progress.

A run is named by its settings (configuration, teacher, evaluation) and by the code that it ran with; both are hashed
into the name of its folder, so a changed configuration never picks up old runs.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from . import store, workers
from .config import Config, preset
from .distill import distill
from .envs import GOAL, PIT, TRUNCATED, get_task
from .evaluate import outcomes
from .machine import cpu_type
from .policy import VoronoiPolicy
from .rollouts import Outcomes
from .teachers import Teacher, load_teacher

N_RUNS = {"SimpleGoal-v0": 85, "MountainCarContinuous-v0": 40}  # paper, section "Experimental Validation"
N_EPISODES = 1000
EVALUATION_SEED, VALIDATION_SEED = 1, 2  # start states to report on, and to choose the best run on
QUICK_RUNS, QUICK_EPISODES = 4, 100
SHARES = {"goal": GOAL, "pit": PIT, "truncated": TRUNCATED}  # the outcomes of episodes whose shares tables show
_CODE = (
    "buffers",
    "checks",
    "distill",
    "envs",
    "evaluate",
    "geometry",
    "history",
    "moments",
    "partition",
    "policy",
    "readings",
    "rollouts",
    "subpolicies",
    "teachers",
)


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
    cpu: str  # the type of processor that it was made on


@dataclass(frozen=True)
class Experiment:
    """What a set of runs has in common: task, configuration, teacher, and the episodes of the evaluation."""

    task: str
    config: Config
    teacher: Teacher
    n_episodes: int = N_EPISODES

    @property
    def settings(self) -> dict:
        """All that decides the result of a run beside its seed and the code, as JSON-able values."""
        return {
            "task": self.task,
            "config": self.config.settings(),
            "teacher": self.teacher.digest,
            "n_episodes": self.n_episodes,
            "start_seeds": [EVALUATION_SEED, VALIDATION_SEED],
            "versions": {name: _version(name) for name in ("numpy", "scipy")},
        }

    @property
    def id(self) -> str:
        """Ten hexadecimal digits that stand for the settings."""
        return hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode()).hexdigest()[:10]

    def folder(self, runs: str | os.PathLike) -> Path:
        """Where the runs of this experiment lie below the folder `runs`."""
        return Path(runs) / self.task / f"{self.id}-{code_id()}"


_version = cache(version)  # which takes milliseconds, and is asked for each run


@cache
def code_id(*more: str) -> str:
    """Ten hexadecimal digits that stand for the modules that decide a run's result, and for those called `more`.

    Comments, docstrings and layout have no say: runs outlive a better explanation.
    """
    folder = Path(__file__).parent
    trees = (ast.parse((folder / f"{name}.py").read_text(encoding="utf-8")) for name in (*_CODE, *more))
    content = "".join(ast.dump(_WithoutDocstrings().visit(tree)) for tree in trees)
    return hashlib.sha256(content.encode()).hexdigest()[:10]


class _WithoutDocstrings(ast.NodeTransformer):
    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        return None if isinstance(node.value, ast.Constant) else node


def paper_experiment(task: str, *, quick: bool = False) -> Experiment:
    """The paper's experiment on `task`: its hyperparameters, the shipped teacher, 1000 episodes."""
    task = get_task(task).name
    config = preset(task).quick() if quick else preset(task)
    return Experiment(task, config, load_teacher(task), QUICK_EPISODES if quick else N_EPISODES)


def paper_runs(task: str, *, runs: str | os.PathLike, quick: bool = False, jobs: int | str = 1) -> list[Run]:
    """All runs of the paper's experiment on `task`, in the order of their seeds; those that are missing are made."""
    experiment = paper_experiment(task, quick=quick)
    n = QUICK_RUNS if quick else N_RUNS[experiment.task]
    return make_runs(experiment, range(n), runs=runs, jobs=jobs)


def make_runs(experiment: Experiment, seeds, *, runs: str | os.PathLike, jobs: int | str = 1) -> list[Run]:
    """Distil once per seed, skip what is there, and return the runs in the order of `seeds`; `jobs` as in `workers`."""
    seeds = list(seeds)
    make_all([(experiment, seed) for seed in seeds], runs=runs, jobs=jobs, label=experiment.task)
    return [load_run(run_path(experiment.folder(runs), seed), experiment) for seed in seeds]


def make_all(
    work: Iterable[tuple[Experiment, int]], *, runs: str | os.PathLike, jobs: int | str = 1, label: str
) -> None:
    """Make those runs (experiment, seed) of `work` that are missing in the folder `runs`; `jobs` as in `workers`."""
    asked = [(run_path(experiment.folder(runs), seed), experiment, seed) for experiment, seed in work]
    missing = [one for one in asked if not one[0].exists()]
    made = workers.results(make_run, [one for _, *one in missing], label, jobs=jobs, total=len(asked), unit="runs")
    for i, content in made:
        store.save(missing[i][0], *content)


def make_run(experiment: Experiment, seed: int) -> tuple[dict[str, np.ndarray], dict]:
    """One distillation, evaluated: what its sealed file holds, arrays and about."""
    task, n = experiment.task, experiment.n_episodes
    policy, history = distill(experiment.teacher, task, experiment.config, seed=seed)
    result = outcomes(policy, task, n, seed=EVALUATION_SEED)
    validation = outcomes(policy, task, n, seed=VALIDATION_SEED)
    arrays = {
        "codewords": policy.codewords,
        "coefficients": policy.coefficients,
        "scale": policy.scale,
        "returns": result.returns,
        "lengths": result.lengths,
        "outcomes": result.codes,
        "cells": np.array(history.cells),
    }
    about = {
        "kind": "Run",
        "seed": seed,
        "settings": experiment.settings,
        "validation_mean": float(validation.returns.mean()),
        "splits": sum(event.kind == "split" for event in history.events),
        "merges": sum(event.kind == "merge" for event in history.events),
        "cpu": cpu_type(),
    }
    return arrays, about


def load_run(path: str | os.PathLike, experiment: Experiment) -> Run:
    """Read one run. Raises `store.DamagedFile`, and ValueError for a run that was made with other settings."""
    a, about = store.load(path, kind="Run")
    for name, expected in experiment.settings.items():
        if about["settings"].get(name) != expected:
            raise ValueError(
                f"{path}: made with {name} = {about['settings'].get(name)}, expected {expected}: "
                "delete it, and `make runs` makes it again"
            )
    if Path(path).name != run_path("", about["seed"]).name:
        raise ValueError(f"{path}: holds the run of seed {about['seed']}, expected that of its name: delete it")
    form = experiment.config.sub_policy
    return Run(
        seed=about["seed"],
        policy=VoronoiPolicy(
            a["codewords"], a["coefficients"], scale=a["scale"], task=experiment.task, sub_policy=form
        ),
        outcomes=Outcomes(a["returns"], a["lengths"], a["outcomes"]),
        validation_mean=about["validation_mean"],
        cells=a["cells"],
        splits=about["splits"],
        merges=about["merges"],
        cpu=about["cpu"],
    )


def load_runs(experiment: Experiment, *, runs: str | os.PathLike) -> list[Run]:
    """All runs that are there, by seed. Raises FileNotFoundError if there are none."""
    folder = experiment.folder(runs)
    paths = sorted(folder.glob("[0-9]*.run"))
    if not paths:
        raise FileNotFoundError(f"{folder}: no runs, expected one or more: `make runs` makes them")
    return [load_run(path, experiment) for path in paths]


def best(runs: list[Run]) -> Run:
    """The run with the highest mean return on the validation starts; the lowest seed among equals."""
    return max(runs, key=lambda run: (run.validation_mean, -run.seed))


def returns(runs: list[Run]) -> np.ndarray:
    """Returns on the shared start states, one row per run. (n_runs, n_episodes)"""
    return np.stack([run.outcomes.returns for run in runs])


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
        return returns(self.runs)

    @property
    def codes(self) -> np.ndarray:
        """How their episodes ended, codes of `vsp.envs.OUTCOMES`. (n_runs, n_episodes)"""
        return np.stack([run.outcomes.codes for run in self.runs])

    @property
    def best(self) -> Run:
        """The run with the highest mean return on the validation starts."""
        return best(self.runs)


def paper_results(task: str, *, runs: str | os.PathLike, quick: bool = False, jobs: int | str = -1) -> Results:
    """The paper's experiment on `task`; runs that are missing in the folder `runs` are made."""
    experiment = paper_experiment(task, quick=quick)
    made = paper_runs(task, runs=runs, quick=quick, jobs=jobs)
    return Results(experiment, made, teacher_outcomes(experiment, runs=runs))


def teacher_outcomes(experiment: Experiment, *, runs: str | os.PathLike) -> Outcomes:
    """The teacher's episodes from the shared start states, kept beside the runs.

    On another CPU type a network's sums are rounded otherwise, and an episode may end elsewhere: tables made of the
    same files are the same there.
    """
    path = experiment.folder(runs) / "teacher.run"
    if not path.exists():
        own = outcomes(experiment.teacher, experiment.task, experiment.n_episodes, seed=EVALUATION_SEED)
        arrays = {"returns": own.returns, "lengths": own.lengths, "outcomes": own.codes}
        store.save(path, arrays, {"kind": "Teacher"})
    arrays, _ = store.load(path, kind="Teacher")
    return Outcomes(arrays["returns"], arrays["lengths"], arrays["outcomes"])


def run_path(folder: str | os.PathLike, seed: int) -> Path:
    """Where the run with this seed lies in the folder of its experiment."""
    return Path(folder) / f"{seed:04d}.run"


def main() -> None:
    """Make the runs that the paper reports, or those of them that are missing."""
    from . import baselines  # which takes runs itself

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="runs go to OUT/data/runs")
    parser.add_argument("--quick", action="store_true", help="a few short runs, to see that all works")
    parser.add_argument("--jobs", type=workers.jobs, default=-1, help=workers.JOBS)
    arguments = parser.parse_args()
    out, jobs = Path(arguments.out), arguments.jobs
    runs, locks = out / "data" / "runs", out / "build" / "locks"
    with store.alone(locks / "runs", f"makes runs in {out}"):
        for left in runs.rglob(store.TEMPORARY):
            left.unlink(missing_ok=True)  # of a process that was killed
        try:
            for task in N_RUNS:
                results = paper_results(task, runs=runs, quick=arguments.quick, jobs=jobs)
                n_runs = baselines.QUICK_RUNS if arguments.quick else baselines.N_RUNS
                baselines.kept_comparison(results, n_runs, runs=runs, jobs=jobs)
                print(f"{task}: {len(results.runs)} runs are there, and what stands beside them", flush=True)
        except workers.WorkerDied:
            store.end_others(locks)  # make would wait for its notebooks, minutes
            raise


if __name__ == "__main__":
    from vsp.experiments import main  # of the module by its name, under which workers find what it holds

    with workers.in_one_line():
        main()
