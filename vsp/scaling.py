"""What the curves of `scale_study` say: how fast time and memory grow, and what many runs would cost on a cluster."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from .checks import check_array, check_count
from .config import Config, preset
from .distill import EPISODES_AHEAD
from .history import SNAPSHOTS
from .scale_study import N_CELLS, N_STEPS

POINTS = 4  # sizes that a fit needs at least
POLICY_BYTES = 2000  # of a policy's objects, beside its numbers


class Environment(NamedTuple):
    """What a run on a task costs by."""

    name: str
    d: int  # numbers in a state
    m: int  # numbers in an action
    steps: int  # in an episode: its limit, where we have not measured
    engine: bool  # whether a physics engine plays it


TEN_TASKS = (  # two of them the paper's, the others Gymnasium's; MuJoCo's as of version 5
    Environment("SimpleGoal", 2, 2, 12, False),
    Environment("MountainCarContinuous", 2, 1, 65, False),
    Environment("Pendulum", 3, 1, 200, False),
    Environment("LunarLanderContinuous", 8, 2, 250, True),
    Environment("InvertedPendulum", 4, 1, 1000, True),
    Environment("InvertedDoublePendulum", 9, 1, 1000, True),
    Environment("Reacher", 10, 2, 50, True),
    Environment("Swimmer", 8, 2, 1000, True),
    Environment("Hopper", 11, 3, 1000, True),
    Environment("HalfCheetah", 17, 6, 1000, True),
)


def exponents(frame: pd.DataFrame) -> pd.DataFrame:
    """How everything measured in at least `POINTS` sizes grows: a row per thing and quantity, with 95 % intervals.

    Workers are left out: what they add ends with the cores, which is no power law.
    Columns: over (what the size counts), what, quantity ("seconds" or "megabytes"), exponent, low, high.
    """
    rows = []
    for (over, what), part in frame[frame["over"] != "workers"].groupby(["over", "what"], sort=False):
        for quantity in ("seconds", "megabytes"):
            measured = part.dropna(subset=[quantity])
            if len(measured) < POINTS:
                continue
            _, _, exponent, half = power_law(measured["size"].to_numpy(), measured[quantity].to_numpy())
            about = {"over": over, "what": what, "quantity": quantity}
            rows.append({**about, "exponent": exponent, "low": exponent - half, "high": exponent + half})
    return pd.DataFrame(rows)


def in_words(frame: pd.DataFrame, quantity: str = "seconds") -> str:
    """The `exponents` of one quantity, for somebody who cannot see the curves."""
    rows = exponents(frame)
    rows = rows[rows["quantity"] == quantity]
    parts = [
        f"over {over} " + ", ".join(f"{row.exponent:.1f} for {row.what}" for row in part.itertuples())
        for over, part in rows.groupby("over", sort=False)
    ]
    return f"with these exponents: {'; '.join(parts)}."


def power_law(sizes: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Fit b·size^c to the upper half of the sizes, at least `POINTS`: below, what any call costs hides the growth.

    Least squares of logarithms. Returns those sizes and the fitted values (n,), c, and half the width of its 95 %
    interval (Student's t). Raises ValueError for fewer sizes and for numbers that are not positive.
    """
    from scipy.stats import linregress, t

    sizes, values = check_array("sizes", sizes, (-1,)), check_array("values", values, (len(sizes),))
    if len(sizes) < POINTS or min(sizes.min(), values.min()) <= 0:
        raise ValueError(f"sizes are {sizes}, values {values}, expected {POINTS} or more, all positive")
    n = max(POINTS, (len(sizes) + 1) // 2)
    upper = np.argsort(sizes)[-n:]
    x, y = np.log(sizes[upper]), np.log(values[upper])
    line = linregress(x, y)
    fitted = np.exp(line.intercept + line.slope * x)
    return sizes[upper], fitted, float(line.slope), float(t.ppf(0.975, n - 2) * line.stderr)


def cost(frame: pd.DataFrame, *, n_runs: int = 1000, tasks=TEN_TASKS) -> pd.DataFrame:
    """Core-hours of `n_runs` runs of the paper's method per task, a row each, from the measured curves.

    A run has SimpleGoal's settings, `N_CELLS` cells throughout, the teacher's network of the paper, and two evaluations
    of 1000 episodes. A pass costs what it does in d dimensions, times what the steps of an episode make of it; a step
    of any physics engine, what LunarLander's does. Columns: task, d, steps, then core-hours: teacher, physics,
    distillation, evaluation, all; then megabytes: of one run at most, beside its teacher's network, and on disk for all
    runs. Raises ValueError for a task outside what was measured, and for what is no count.
    """
    check_count("n_runs", n_runs)
    config = preset("SimpleGoal-v0")
    rows = []
    for task in tasks:
        check_count("m", task.m)
        training, split, merge = (
            _at(frame, what, "dimensions", task.d)
            * (_at(frame, what, "steps", task.steps) / _at(frame, what, "steps", N_STEPS))
            for what in ("training", "splitting pass", "merging pass")
        )
        played, judged = config.n_epochs * task.steps / 1000, 2 * task.steps  # thousands of steps
        step = float(frame.loc[frame["what"] == "physics, 1000 steps", "seconds"].iloc[0]) if task.engine else 0.0
        hours = {
            "teacher": played * _at(frame, "teacher, 1000 states", "dimensions", task.d),
            "physics": played * step,
            "distillation": config.n_epochs * (training + split / config.n_split + merge / config.n_merge),
            "evaluation": judged * (step + _at(frame, "cells, 1000 states", "dimensions", task.d)),
        }
        hours = {name: n_runs * seconds / 3600 for name, seconds in hours.items()}
        size = {"MB in memory": _bytes(task, config) / 1e6, "MB on disk": n_runs * _bytes_on_disk(task, config) / 1e6}
        rows.append({"task": task.name, "d": task.d, "steps": task.steps, **hours, "all": sum(hours.values()), **size})
    return pd.DataFrame(rows)


def _at(frame: pd.DataFrame, what: str, over: str, size: float) -> float:
    """Seconds measured at a size, or between two, where logarithms are interpolated."""
    part = frame[(frame["what"] == what) & (frame["over"] == over)].dropna(subset=["seconds"]).sort_values("size")
    if not part["size"].min() <= size <= part["size"].max():
        raise ValueError(f"{over} are {size}, expected {part['size'].min()} to {part['size'].max()}, as was measured")
    return float(np.exp(np.interp(np.log(size), np.log(part["size"]), np.log(part["seconds"]))))


def _bytes(task: Environment, config: Config) -> float:
    """What a run holds at most: the bound of `Buffers`, the episodes that are played ahead, and the history.

    Of that the losses and numbers of cells, and the snapshots, where each pass that may change the cells adds one.
    """
    rows = config.n_reset * task.steps
    buffers = rows * (16 * (task.d + 1 + task.m) + 8 * N_CELLS)
    ahead = EPISODES_AHEAD * task.steps * 8 * (task.d + task.m)
    snapshots = SNAPSHOTS + config.n_epochs / config.n_split + config.n_epochs / config.n_merge
    return buffers + ahead + 40 * config.n_epochs + snapshots * (POLICY_BYTES + 8 * _numbers(task))


def _bytes_on_disk(task: Environment, config: Config) -> float:
    """The file of a run: returns, lengths and ends of 1000 episodes, the history, the policy."""
    return 8 * (3 * 1000 + config.n_epochs + _numbers(task))


def _numbers(task: Environment) -> int:
    """Those in a policy: codewords and coefficients."""
    return N_CELLS * (task.d + (task.d + 1) * task.m)


def second_worker(frame: pd.DataFrame, what: str = "Dask workers") -> float:
    """What a second worker adds, as a share of what the first one does."""
    times = frame[frame["what"] == what].set_index("size")["seconds"]
    return float(times[1] / times[2] - 1)


def part(frame: pd.DataFrame, table: str) -> pd.DataFrame:
    """The rows of data/results/trust.csv that belong to a table, without machine and name of the table."""
    return frame.loc[frame["table"] == table, ["what", "to hold", "measured", "held"]].reset_index(drop=True)
