"""How time and memory grow: with episodes, cells, dimensions of the state, runs and workers. A measurement.

Codewords are uniform in the unit cube, where a made-up teacher walks along curves to the origin: `reach` is SimpleGoal
without its pit, in d dimensions. The command writes data/results/scale.csv. Every measurement has a process of its own;
times are by the clock, of the machine in the last column, and differ from run to run.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from . import store
from .config import preset
from .distill import distill, merge_regions, split_regions
from .envs import GOAL, GOAL_EDGE, RUNNING, STRIDE, Task, get_task
from .evaluate import outcomes
from .experiments import Experiment, load_runs, make_runs
from .machine import cpu_type
from .partition import Partition
from .policy import VoronoiPolicy
from .progress import progress
from .rollouts import Episode, play, record
from .teachers import Teacher
from .workers import results

TASK = "SimpleGoal-v0"
EPISODES = tuple(round(10**e) for e in (3, 3.5, 4, 4.5, 5, 5.5, 6))
CELLS = (10, 18, 32, 56, 100, 178, 316, 562, 1000)
DIMENSIONS = (2, 3, 4, 6, 8, 11, 17)
STEPS = (10, 30, 100, 300, 1000)
RUNS = (1, 3, 10, 30, 100, 300, 1000)
WORKERS = (1, 2, 3, 4)
LAYERS = (400, 300)  # of the teachers' networks
N_CELLS, N_STEPS, D = 30, 100, 8  # where something else varies
N_RUNS = 40  # where workers vary
REPEATS = 25  # of which the median counts: of passes and look-ups. Runs and episodes are timed once, by themselves


@dataclasses.dataclass(frozen=True)
class Pursuit:
    """A teacher without a network: to the origin, faster along some axes than along others."""

    digest: str = "pursuit"

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions in [-1, 1] for observations (n, d)."""
        states = np.asarray(obs, dtype=np.float64)
        return np.clip(-4 * states * (1.5 - np.roll(states, 1, axis=-1)), -1, 1), None


@dataclasses.dataclass(frozen=True)
class Noise:
    """An agent for LunarLander that acts at random."""

    rng: np.random.Generator

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions in [-1, 1] for observations (n, d)."""
        return self.rng.uniform(-1, 1, size=(len(obs), 2)), None


def reach(d: int) -> Task:
    """SimpleGoal without its pit in the unit cube of d dimensions: walk to the corner at the origin."""
    names = tuple(f"x{i + 1}" for i in range(d))
    return Task(
        name=f"Reach{d}",
        inputs=names,
        outputs=tuple(f"Δ{name}" for name in names),
        input_labels=names,
        low=np.zeros(d),
        high=np.ones(d),
        action_low=-np.ones(d),
        action_high=np.ones(d),
        max_steps=50,
        start=lambda rng, n: rng.uniform(size=(n, d)),
        step=_reach_step,
    )


def _reach_step(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    moved = np.clip(states + STRIDE * np.clip(actions, -1, 1), 0, 1)
    rewards = 10 * (np.linalg.norm(states, axis=1) - np.linalg.norm(moved, axis=1))
    return moved, rewards, np.where((moved < GOAL_EDGE).all(axis=1), GOAL, RUNNING)


# What is measured: each takes a size and returns seconds by what they were spent on


def distillation(n: int) -> dict[str, float]:
    """One run of the paper's method with n iterations, an episode in each."""
    config = dataclasses.replace(preset(TASK), n_epochs=n, n_freeze=n // 5)
    return {"distillation": _seconds(lambda: distill(Pursuit(), TASK, config, seed=0))}


def evaluation(n: int) -> dict[str, float]:
    """n episodes, all at once."""
    return {"evaluation": _seconds(lambda: outcomes(Pursuit(), TASK, n, seed=0))}


def passes(k: int, d: int, steps: int = N_STEPS) -> dict[str, float]:
    """A pass of each part of Algorithm 1 over k cells in d dimensions that neither grow nor vanish; medians.

    The episode has so many steps, and stays in a cell for as much longer. Beyond 4 dimensions neighbours are those that
    visited states show, for the Delaunay graph of the paper takes minutes there (`lookup_study`).
    """
    partition, episodes, rng = _partition(k, d)
    config = partition.config
    slower = np.linspace(0, len(episodes[0].states) - 1, steps).round().astype(int)
    episode = Episode(episodes[0].states[slower], episodes[0].actions[slower])
    work = {
        "training": lambda: (partition.observe(episode), partition.train(rng)),
        "splitting pass": lambda: split_regions(partition, episode, config, rng),
        "merging pass": lambda: merge_regions(partition, config),
    }
    return {name: _median(lambda: _seconds(one)) for name, one in work.items()}


def _partition(k: int, d: int) -> tuple[Partition, list[Episode], np.random.Generator]:
    """k cells that are never split or merged, and the 20 episodes a cell that they have seen."""
    rng, task = np.random.default_rng([k, d]), reach(d)
    graph = "delaunay" if d <= 4 else "visited"
    never = {"min_pol_distance": 10.0 * d, "min_param_distance": 1e-9, "neighbours": graph}
    partition = Partition(task, dataclasses.replace(preset(TASK), **never))
    for codeword in rng.random((k, d)):
        partition.add(codeword, rng)
    episodes = record(Pursuit(), task, task.start(rng, 20 * k))
    for episode in episodes:
        partition.observe(episode)
    return partition, episodes, rng


def policies(d: int) -> dict[str, float]:
    """A thousand states through a network of the size that the paper's teachers have, and through `N_CELLS` cells."""
    rng, sizes = np.random.default_rng(d), (d, *LAYERS, d)
    layers = [(f"mu.{2 * i}.weight", f"mu.{2 * i}.bias", *sizes[i : i + 2]) for i in range(len(sizes) - 1)]
    weights = {weight: rng.normal(size=(m, n)).astype(np.float32) for weight, _, n, m in layers}
    weights |= {bias: np.zeros(m, np.float32) for _, bias, _, m in layers}
    network, states = Teacher(weights, reach(d)), rng.random((1000, d), dtype=np.float32)
    codewords, maps = rng.random((N_CELLS, d)), rng.normal(size=(N_CELLS, d + 1, d))
    work = {"teacher": network, "cells": VoronoiPolicy(codewords, maps, task=reach(d))}
    return {
        f"{name}, 1000 states": _median(lambda: _seconds(lambda: policy.predict(states)))
        for name, policy in work.items()
    }


def physics(n: int) -> dict[str, float]:
    """A thousand steps of a physics engine, LunarLander's, in n episodes at a time of an agent that acts at random."""
    task, rng = get_task("LunarLanderContinuous-v3"), np.random.default_rng(0)

    def each() -> float:
        found = []
        taken = _seconds(lambda: found.append(play(Noise(rng), task, task.start(rng, n))))
        return 1000 * taken / found[0].lengths.sum()

    return {"physics, 1000 steps": _median(each)}


def runs(n: int, *, jobs: int | str = -1) -> dict[str, float]:
    """n short runs with their evaluation, made, written and read."""
    experiment = Experiment(TASK, preset(TASK).quick(), Pursuit(), 100)
    with tempfile.TemporaryDirectory() as folder:
        taken = {"runs": _seconds(lambda: make_runs(experiment, range(n), runs=folder, jobs=jobs))}
        return taken | {"reading runs": _seconds(lambda: load_runs(experiment, runs=folder))}


def workers(n: int) -> dict[str, float]:
    """`N_RUNS` short runs by n processes of this machine, and by n workers of a Dask cluster on it; medians of five."""
    from distributed import LocalCluster

    def median(jobs: int | str) -> float:
        runs(n, jobs=jobs)  # so that workers are there and have imported what they need
        return float(np.median([runs(N_RUNS, jobs=jobs)["runs"] for _ in range(5)]))

    here = median(n)
    with LocalCluster(n_workers=n, threads_per_worker=1, dashboard_address=":0", silence_logs="CRITICAL") as cluster:
        return {"processes": here, "Dask workers": median(cluster.scheduler_address)}


MEASURED = {
    "distillation": distillation,
    "evaluation": evaluation,
    "passes": passes,
    "policies": policies,
    "physics": physics,
    "runs": runs,
    "workers": workers,
}


# What is counted of each, and under which name; of others memory is that of other processes, or small
HOLDS = {"distillation": "distillation", "evaluation": "evaluation", "passes": "a partition"}


def _median(measure: Callable[[], float]) -> float:
    return float(np.median([measure() for _ in range(REPEATS)]))


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


# Measuring


def study(
    *, episodes=EPISODES, cells=CELLS, dimensions=DIMENSIONS, steps=STEPS, n_runs=RUNS, n_workers=WORKERS
) -> pd.DataFrame:
    """One row per thing and size: `what`, `over` (what the size counts), `size`, and `seconds` or `megabytes`.

    Times are taken one after the other; memory, which does not depend on what else goes on, then on all cores.
    """
    asked = [("episodes", n, what, n) for what in ("distillation", "evaluation") for n in episodes]
    asked += [("cells", k, "passes", k, 2) for k in cells]
    asked += [("dimensions", d, "passes", N_CELLS, d) for d in dimensions]
    asked += [("steps", n, "passes", N_CELLS, D, n) for n in steps]
    asked += [("dimensions", d, "policies", d) for d in dimensions] + [("copies", 50, "physics", 50)]
    asked += [("runs", n, "runs", n) for n in n_runs] + [("workers", n, "workers", n) for n in n_workers]
    rows = []
    for over, size, *work in progress(asked, "times", total=len(asked), unit="measurements"):
        found = alone("seconds", *work)
        rows += [{"what": what, "over": over, "size": size, "seconds": taken} for what, taken in found.items()]
    counted = [one for one in asked if one[2] in HOLDS and one[0] != "steps"]
    counted.sort(key=lambda one: one[1], reverse=True)  # the largest takes longest
    jobs = [("megabytes", *work) for _, _, *work in counted]
    peaks = dict(results(alone, jobs, "memory", jobs=-1, total=len(jobs), unit="measurements"))
    for i, (over, size, what, *_) in enumerate(counted):
        rows.append({"what": HOLDS[what], "over": over, "size": size, "megabytes": peaks[i]})
    return pd.DataFrame(rows).assign(machine=cpu_type())


def alone(quantity: str, what: str, *sizes: int) -> dict[str, float] | float:
    """What a function of `MEASURED` returns in a new process, or how many megabytes its arrays and objects take there.

    `quantity` is "seconds" or "megabytes". `tracemalloc` counts the megabytes, which slows everything down and gives
    the same number each time.
    """
    command = [sys.executable, "-m", "vsp.scale_study", "--alone", quantity, what, *map(str, sizes)]
    return json.loads(subprocess.run(command, stdout=subprocess.PIPE, cwd=store.ROOT, check=True).stdout)


def _alone(quantity: str, what: str, *sizes: int) -> dict[str, float] | float:
    """What `alone` returns, in its process."""
    with threadpool_limits(1):
        if quantity == "seconds":
            return MEASURED[what](*sizes)
        MEASURED[what](min(sizes[0], 20), *sizes[1:])  # a small one first, which imports what it needs
        tracemalloc.start()
        MEASURED[what](*sizes)
        return tracemalloc.get_traced_memory()[1] / 1e6


def main() -> None:
    """Measure all of it, in about half an hour, and write OUT/data/results/scale.csv."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="the result goes to OUT/data/results")
    parser.add_argument("--alone", nargs="+", metavar="WHAT", help="one measurement, in this process")
    arguments = parser.parse_args()
    if arguments.alone:
        quantity, what, *sizes = arguments.alone
        print(json.dumps(_alone(quantity, what, *map(int, sizes))))
        return
    path = Path(arguments.out) / "data" / "results" / "scale.csv"
    store.write_listed(path, study().to_csv(index=False, float_format="%.4g", lineterminator="\n"))


if __name__ == "__main__":
    from vsp.scale_study import main  # of the module by its name, under which workers find what it holds

    main()
