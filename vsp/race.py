"""How long it takes from a teacher's weights to a policy nearly as good, on SimpleGoal: ours and trees with DAgger.

All are measured in turn, in one process and one thread. Several settings each, for a faster one may not be good
enough: a tree of constants has as many leaves as its data ask for, one of linear maps 32. The results go to
data/results/beyond_race.csv; times differ from run to run.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import pandas as pd
from threadpoolctl import threadpool_limits

from .baselines import dagger
from .config import Refinement, preset
from .envs import GOAL, get_task
from .evaluate import start_states
from .measure import N_REPORTED, REPORT_SEED
from .progress import progress
from .refine import refine
from .rollouts import Policy, play
from .teachers import Teacher, load_teacher
from .trees import LinearTree, Tree

TASK = "SimpleGoal-v0"
SEEDS = range(20)
ENOUGH = 0.99  # of the teacher's mean return
QUICK = replace(preset(TASK, "best"), n_restarts=1, n_generations=0, n_validation=1000)
TREES = {  # by the episodes of the teacher: with two rounds of corrections
    f"{n} + 2 × {more} episodes": replace(QUICK, n_episodes=n, n_correction_episodes=more)
    for n, more in ((300, 200), (2000, 500), (5000, 1000), (10_000, 3000))
}
LINEAR_TREES = dict(list(TREES.items())[:2])
OURS = {
    f"{cells} cells, {steps} steps": replace(QUICK, n_cells=cells, n_steps=steps, n_episodes=300)
    for cells, steps in ((13, 500), (20, 800), (26, 1000), (32, 1500))
}


def _tree(teacher: Teacher, config: Refinement, seed: int) -> Policy:
    fits = [lambda states, actions: Tree(states, actions, leaves=len(states))]
    return dagger(fits, teacher, TASK, config=config, seed=seed)


def _linear_tree(teacher: Teacher, config: Refinement, seed: int) -> Policy:
    fits = [lambda states, actions: LinearTree(states, actions, leaves=32, task=get_task(TASK))]
    return dagger(fits, teacher, TASK, config=config, seed=seed)


def _ours(teacher: Teacher, config: Refinement, seed: int) -> Policy:
    return refine(teacher, TASK, config, seed=seed)[0]


@threadpool_limits.wrap(limits=1)
def race(seeds=SEEDS) -> pd.DataFrame:
    """One row per method, setting and seed: seconds, mean return, share of failed episodes, share of the teacher's
    mean return."""
    teacher, task = load_teacher(TASK), get_task(TASK)
    starts = start_states(task, N_REPORTED, REPORT_SEED)
    own, rows = play(teacher, task, starts).returns.mean(), []
    methods = {
        "CART, DAgger": (_tree, TREES),
        "CART, linear leaves, DAgger": (_linear_tree, LINEAR_TREES),
        "refined, not tuned": (_ours, OURS),
    }
    entries = [
        (method, setting, partial(make, teacher, config))
        for method, (make, settings) in methods.items()
        for setting, config in settings.items()
    ]
    for _, _, make in entries:
        make(seed=0)  # imports, and memory that is had once
    for seed in progress(seeds, "race", total=len(seeds), unit="seeds"):
        for method, setting, make in entries:
            began = time.perf_counter()
            policy = make(seed=seed)
            seconds, result = time.perf_counter() - began, play(policy, task, starts)
            scores = {"mean": result.returns.mean(), "failing": (result.codes != GOAL).mean()}
            about = {"method": method, "setting": setting, "seed": seed, "seconds": seconds}
            rows.append({**about, **scores, "share": scores["mean"] / own})
    return pd.DataFrame(rows)


def quickest(frame: pd.DataFrame) -> pd.DataFrame:
    """The quickest setting of each method whose median share is `ENOUGH`; a method without one is left out.

    `frame` has rows of `race`. Columns: method, setting, seconds, mean, failing, share: medians over the seeds;
    crossing, the share of the seeds that come to `ENOUGH`. The quickest method comes first.
    """
    groups = frame.assign(crossing=frame["share"] >= ENOUGH).groupby(["method", "setting"], sort=False)
    medians = groups[["seconds", "mean", "failing", "share"]].median()
    medians = medians.assign(crossing=groups["crossing"].mean()).reset_index()
    enough = medians[medians["share"] >= ENOUGH].sort_values("seconds", ignore_index=True)
    return enough.drop_duplicates("method", ignore_index=True)
