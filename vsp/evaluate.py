"""Episodic returns on shared start states, the paper's spread metrics, coverage, and intervals over policies."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .checks import check_array, check_count, check_finite, check_number, check_seed
from .envs import OUTCOMES, Task, get_task
from .moments import fences
from .rollouts import Outcomes, Policy, play


def start_states(task: str | Task, n_episodes: int, seed: int) -> np.ndarray:
    """The start states that belong to `seed`, the same for every policy. (n, d)"""
    check_seed(seed)
    check_count("n_episodes", n_episodes)
    return get_task(task).start(np.random.default_rng(np.random.SeedSequence(seed)), n_episodes)


def outcomes(policy: Policy, task: str | Task, n_episodes: int = 1000, *, seed: int) -> Outcomes:
    """Play `policy` from the start states of `seed`; arrays, one entry per episode."""
    task = get_task(task)
    return play(policy, task, start_states(task, n_episodes, seed))


def evaluate(policy: Policy, task: str | Task, n_episodes: int = 1000, *, seed: int) -> pd.DataFrame:
    """Play `policy` from the start states of `seed`: one row per episode with return, length and outcome."""
    result = outcomes(policy, task, n_episodes, seed=seed)
    named = np.array(OUTCOMES)[result.codes]
    return pd.DataFrame({"return": result.returns, "length": result.lengths, "outcome": named}).rename_axis("episode")


def spread(returns: np.ndarray) -> dict[str, float]:
    """How returns of any shape spread: the metrics of the paper's tables T5 and T6, and what its text adds.

    Keys, in units of return: min, max, mean, std (of the sample, n - 1), q1, median, q3, iqr; lower_fence and
    upper_fence, 1.5 interquartile ranges beyond the quartiles, which the paper calls bounds; outliers_below and
    outliers_above, counts of returns outside the fences; coverage, the share inside. Raises ValueError for no returns
    or some that are not finite.
    """
    returns = check_finite("returns", returns).ravel()
    if not len(returns):
        raise ValueError("no returns, expected at least one")
    q1, median, q3 = np.percentile(returns, [25, 50, 75])
    lower, upper = fences(q1, q3)
    below, above = returns < lower, returns > upper
    return {
        "min": returns.min(),
        "max": returns.max(),
        "mean": returns.mean(),
        "std": returns.std(ddof=1) if len(returns) > 1 else 0.0,
        "q1": q1,
        "median": median,
        "q3": q3,
        "iqr": q3 - q1,
        "coverage": 1.0 - (below | above).mean(),
        "lower_fence": lower,
        "upper_fence": upper,
        "outliers_below": int(below.sum()),
        "outliers_above": int(above.sum()),
    }


def outlier_numbers(returns: np.ndarray) -> dict[str, float]:
    """What the paper's text says about outliers, under the names that end its ids in `data/paper/text_numbers.csv`.

    Means, standard deviations and ranges of a set without members are NaN. Raises ValueError as `spread` does.
    """
    facts, returns = spread(returns), np.ravel(returns)
    below = returns[returns < facts["lower_fence"]]
    above = returns[returns > facts["upper_fence"]]
    outside = np.concatenate([below, above])
    numbers = {f"outliers_{name}": value for name, value in _moments(outside).items()}
    for side, values in (("below", below), ("above", above)):
        moments = _moments(values)
        numbers[f"outliers_{side}_share"] = 100 * len(values) / len(outside) if len(outside) else np.nan
        numbers |= {f"outliers_{side}_{name}": moments[name] for name in ("mean", "std")}
    return {
        **{name: facts[name] for name in ("mean", "std", "min", "max")},
        "whisker_low": facts["lower_fence"],
        "whisker_high": facts["upper_fence"],
        "outliers": len(outside),
        **numbers,
    }


def _moments(values: np.ndarray) -> dict[str, float]:
    if not len(values):
        return dict.fromkeys(("mean", "std", "min", "max"), np.nan)
    deviation = values.std(ddof=1) if len(values) > 1 else 0.0
    return {"mean": values.mean(), "std": deviation, "min": values.min(), "max": values.max()}


def interval(
    returns: np.ndarray, statistic, *, level: float = 0.95, n_resamples: int = 10_000, seed: int = 0
) -> tuple[float, float]:
    """Percentile bootstrap interval of `statistic(returns)` that resamples policies, the rows of `returns` (p, n).

    All policies share start states, so single episodes are not independent and are never resampled on their own.
    Raises ValueError for no returns or some that are not finite, and for a level outside (0, 1).
    """
    returns = check_finite("returns", returns)
    if not returns.size or not returns.ndim:
        raise ValueError(f"returns have shape {returns.shape}, expected a row per policy")
    check_number("level", level, least=0, most=1)
    check_count("n_resamples", n_resamples)
    check_seed(seed)
    rng = np.random.default_rng(seed)
    draws = rng.integers(len(returns), size=(n_resamples, len(returns)))
    values = [statistic(returns[draw]) for draw in draws]
    tail = 50 * (1 - level)
    low, high = np.percentile(values, [tail, 100 - tail])
    return float(low), float(high)


def resample(returns: np.ndarray, *, n_resamples: int = 10_000, seed: int = 0) -> pd.DataFrame:
    """Bootstrap of everything that `spread` and `outlier_numbers` give: one row per resample, one column per statistic.

    Resamples the rows of `returns` (p, n), which are policies. Coverage and shares are in percent. A statistic of a set
    that a resample leaves empty is NaN. Raises ValueError for no returns or some that are not finite.
    """
    returns = check_array("returns", returns, (-1, -1))
    if not returns.size:
        raise ValueError(f"returns have shape {returns.shape}, expected a row per policy")
    check_count("n_resamples", n_resamples)
    check_seed(seed)
    rng, (p, n) = np.random.default_rng(seed), returns.shape
    order = returns.ravel().argsort(kind="stable")
    values, owner = returns.ravel()[order], order // n
    rows = []
    for _ in range(n_resamples):
        times_drawn = np.bincount(rng.integers(p, size=p), minlength=p).astype(float)
        rows.append(_weighted_statistics(values, times_drawn[owner]))
    return pd.DataFrame(rows)


def _weighted_statistics(values: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    """The statistics of sorted `values` (n,) of which each is there `weights` (n,) times."""
    until = weights.cumsum()
    q1, median, q3 = (_weighted_quantile(values, until, q) for q in (0.25, 0.5, 0.75))
    lower, upper = fences(q1, q3)
    low, high = values.searchsorted(lower, "left"), values.searchsorted(upper, "right")
    parts = {"": slice(None), "outliers_below_": slice(0, low), "outliers_above_": slice(high, None)}
    facts = {name: _weighted_moments(values[part], weights[part]) for name, part in parts.items()}
    outside = np.r_[0:low, high : len(values)]
    facts["outliers_"] = _weighted_moments(values[outside], weights[outside])
    numbers = {prefix + name: value for prefix, moments in facts.items() for name, value in moments.items()}
    outliers = numbers.pop("outliers_n")
    for side in ("below", "above"):
        found = numbers.pop(f"outliers_{side}_n")
        numbers[f"outliers_{side}_share"] = 100 * found / outliers if outliers else np.nan
    numbers |= {"q1": q1, "median": median, "q3": q3, "iqr": q3 - q1, "whisker_low": lower, "whisker_high": upper}
    return numbers | {"outliers": outliers, "coverage": 100 * (1 - outliers / numbers.pop("n"))}


def _weighted_quantile(values: np.ndarray, until: np.ndarray, q: float) -> float:
    """Linear interpolation between order statistics, as `np.percentile` has it; `until` are cumulated counts."""
    place = q * (until[-1] - 1)
    below, above = values[until.searchsorted([np.floor(place), np.ceil(place)], "right")]
    return below + (place - np.floor(place)) * (above - below)


def _weighted_moments(values: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    n = weights.sum()
    if not n:
        return {"n": 0.0} | dict.fromkeys(("mean", "std", "min", "max"), np.nan)
    mean = values @ weights / n
    deviation = np.sqrt(max(0.0, (values - mean) ** 2 @ weights / (n - 1))) if n > 1 else 0.0
    present = weights > 0
    first, last = present.argmax(), len(present) - 1 - present[::-1].argmax()
    return {"n": n, "mean": mean, "std": deviation, "min": values[first], "max": values[last]}
