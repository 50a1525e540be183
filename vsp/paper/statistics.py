"""Statistics of returns: the paper's spread metrics, their resamples, and what summary numbers imply.

Standard deviations divide by n - 1 for samples (`spread`) and by n for the identities on parts of a sample
(`remaining_std` and the like). In the identities NaN gives NaN.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from ..checks import check_array, check_finite
from ..evaluation import fences
from ..protocol.intervals import bootstrap_draws


def spread(returns: np.ndarray) -> dict[str, float]:
    """Return the spread of returns of any shape: the metrics of the paper's tables T5 and T6, and those its text adds.

    Keys, in units of return: min, max, mean, std (of the sample, n - 1), q1, median, q3, iqr; lower_fence and
    upper_fence, 1.5 interquartile ranges beyond the quartiles, which the paper calls bounds; outliers_below and
    outliers_above, counts of returns outside the fences; coverage, the share inside. Raises ValueError if there are
    no returns, or some are not finite.
    """
    returns = check_finite("returns", returns).ravel()
    if not len(returns):
        raise ValueError("no returns, expected at least one")
    q1, median, q3 = np.percentile(returns, [25, 50, 75])
    lower, upper = fences(q1, q3)
    below, above, moments = returns < lower, returns > upper, _moments(returns)
    numbers = {name: moments[name] for name in ("min", "max", "mean", "std")}
    numbers |= {"q1": q1, "median": median, "q3": q3, "iqr": q3 - q1}
    numbers |= {"coverage": 1.0 - (below | above).mean(), "lower_fence": lower, "upper_fence": upper}
    return numbers | {"outliers_below": int(below.sum()), "outliers_above": int(above.sum())}


def outlier_numbers(returns: np.ndarray) -> dict[str, float]:
    """Return the paper's statistics of outliers, under the names that end their ids in `data/paper/text_numbers.csv`.

    Means, standard deviations and ranges of an empty set are NaN. Raises ValueError as `spread` does.
    """
    facts, returns = spread(returns), np.ravel(returns)
    lower, upper = facts["lower_fence"], facts["upper_fence"]
    sides = {"below": returns[returns < lower], "above": returns[returns > upper]}
    outside = np.concatenate([*sides.values()])
    numbers = {name: facts[name] for name in ("mean", "std", "min", "max")}
    numbers |= {"whisker_low": lower, "whisker_high": upper, "outliers": len(outside)}
    numbers |= {f"outliers_{name}": value for name, value in _moments(outside).items()}
    for side, values in sides.items():
        moments = _moments(values)
        numbers[f"outliers_{side}_share"] = 100 * len(values) / len(outside) if len(outside) else np.nan
        numbers |= {f"outliers_{side}_{name}": moments[name] for name in ("mean", "std")}
    return numbers


def _moments(values: np.ndarray) -> dict[str, float]:
    if not len(values):
        return dict.fromkeys(("mean", "std", "min", "max"), np.nan)
    deviation = values.std(ddof=1) if len(values) > 1 else 0.0
    return {"mean": values.mean(), "std": deviation, "min": values.min(), "max": values.max()}


def resample(returns: np.ndarray, *, n_resamples: int = 10_000, seed: int = 0) -> pd.DataFrame:
    """Bootstrap all statistics of `spread` and `outlier_numbers`: one row per resample, one column per statistic.

    Resamples the rows of `returns` (p, n), which are policies. Coverage and shares are in percent. A statistic of a set
    that a resample leaves empty is NaN. Raises ValueError if there are no returns, or some are not finite.
    """
    returns = check_array("returns", returns, (-1, -1))
    if not returns.size:
        raise ValueError(f"returns have shape {returns.shape}, expected a row per policy")
    draws = bootstrap_draws(len(returns), n_resamples, seed)
    sample = _SortedReturns(np.ascontiguousarray(returns))
    batches = (draws[i : i + _BATCH] for i in range(0, n_resamples, _BATCH))
    with threadpool_limits(1):  # NumPy's loops run in parallel in threads
        columns = Parallel(n_jobs=-1, prefer="threads")(delayed(sample.statistics)(batch) for batch in batches)
    return pd.DataFrame({name: np.concatenate([batch[name] for batch in columns]) for name in columns[0]})


_BATCH = 25  # resamples at a time, so that their arrays stay in the cache


class _SortedReturns:
    """Returns (p, n) of policies, sorted once, so that no resample needs sorting.

    A resample contains each policy, with all its returns, some number of times. Its order statistics are found in
    cumulative counts: first the block of sorted returns, then the return inside it.
    """

    def __init__(self, returns: np.ndarray):
        (p, n), self.block = returns.shape, math.ceil(math.sqrt(returns.size))
        order = np.argsort(returns.ravel(), kind="stable")
        self.values, self.policy = returns.ravel()[order], order // n
        cells = self.policy * self.block + np.arange(p * n) // self.block
        in_block = np.bincount(cells, minlength=p * self.block).reshape(p, self.block)
        # Returns of each policy before each block
        self.until = np.pad(in_block.cumsum(axis=1), ((0, 0), (1, 0))).astype(float)
        means = returns.mean(axis=1)
        squares = np.square(returns - means[:, None]).sum(axis=1)
        self.by_policy = np.full(p, n), means, squares, returns.min(axis=1), returns.max(axis=1)

    def statistics(self, draws: np.ndarray) -> dict[str, np.ndarray]:
        """Return the columns of `resample`, for the resamples that draw these policies (r, p)."""
        counts = np.stack([np.bincount(draw, minlength=draws.shape[1]) for draw in draws]).astype(float)
        q1, median, q3 = self._quantiles(counts, (0.25, 0.5, 0.75))
        lower, upper = np.stack(fences(q1, q3))
        n = len(self.values)
        low, high = self.values.searchsorted(lower), self.values.searchsorted(upper, "right")
        places = np.arange(max(1, low.max()))  # outliers of any resample
        below = self._part(places, counts[:, self.policy[places]] * (places < low[:, None]))
        places = np.arange(min(n - 1, high.min()), n)
        above = self._part(places, counts[:, self.policy[places]] * (places >= high[:, None]))
        size, mean, squares, least, most = self.by_policy
        parts = {"": (counts * size, mean, counts * squares, least, most), "outliers_below_": below}
        parts |= {"outliers_above_": above, "outliers_": tuple(np.hstack(pair) for pair in zip(below, above))}
        numbers = {prefix + name: x for prefix, part in parts.items() for name, x in _pooled(*part).items()}
        outliers = (below[0] + above[0])[:, 0]
        some = np.where(outliers > 0, outliers, np.nan)
        for side, part in (("below", below), ("above", above)):
            numbers[f"outliers_{side}_share"] = 100 * part[0][:, 0] / some
        numbers |= {"q1": q1, "median": median, "q3": q3, "iqr": q3 - q1, "whisker_low": lower, "whisker_high": upper}
        return numbers | {"outliers": outliers, "coverage": 100 * (1 - outliers / n)}

    def _quantiles(self, counts: np.ndarray, shares: Sequence[float]) -> list[np.ndarray]:
        """Interpolate linearly between order statistics, as `np.percentile` does; return an array (r,) per share."""
        until, quantiles = counts @ self.until, []
        for place in np.multiply(shares, len(self.values) - 1):
            below, above = (self._ranked(counts, until, rank) for rank in (math.floor(place), math.ceil(place)))
            quantiles.append(below + (place - math.floor(place)) * (above - below))
        return quantiles

    def _ranked(self, counts: np.ndarray, until: np.ndarray, rank: int) -> np.ndarray:
        """Return the value of this rank (0: smallest) in each resample; `until`: values before each block. (r,)"""
        block = (until[:, 1:] <= rank).sum(axis=1, keepdims=True)
        places = np.minimum(block * self.block + np.arange(self.block), len(self.values) - 1)
        inside = np.take_along_axis(counts, self.policy[places], axis=1).cumsum(axis=1)
        passed = np.take_along_axis(until, block, axis=1) + inside <= rank
        return self.values[block[:, 0] * self.block + passed.sum(axis=1)]

    def _part(self, places: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the arguments (r, 1) of `_pooled` of the sorted returns at `places` (k,), counted `weights` (r, k)."""
        values, size, there = self.values[places], weights.sum(axis=1), weights > 0
        mean = values[0] + np.einsum("rk,k->r", weights, values - values[0]) / np.maximum(1, size)
        squares = np.einsum("rk,rk->r", weights, np.square(values - mean[:, None]))
        least, most = values[there.argmax(axis=1)], values[::-1][there[:, ::-1].argmax(axis=1)]
        return tuple(x[:, None] for x in (size, mean, squares, least, most))


def _pooled(size, mean, squares, least, most) -> dict[str, np.ndarray]:
    """Return moments and range of the parts of each resample together, NaN where all are empty. (r,)

    All arguments are (r, parts), or (parts,) where all resamples share them; `squares` are sums of squared deviations
    from the mean.
    """
    n = size.sum(axis=1)
    centre = (size * mean).sum(axis=1) / np.maximum(1, n)
    total = (squares + size * np.square(mean - centre[:, None])).sum(axis=1)
    low, high = np.where(size > 0, least, np.inf).min(axis=1), np.where(size > 0, most, -np.inf).max(axis=1)
    moments = {"mean": centre, "std": np.sqrt(total / np.maximum(1, n - 1)), "min": low, "max": high}
    return {name: np.where(n > 0, x, np.nan) for name, x in moments.items()}


Groups = Sequence[tuple[float, float, float]]  # (count, low, high): `count` values lie in [low, high]
Part = namedtuple("Part", "size mean std low high")  # some of the returns, and the range that they lie in


def quartiles_from_fences(low: float, high: float) -> tuple[float, float]:
    """Return Q1 and Q3 for these fences, which lie 1.5 + 1 + 1.5 interquartile ranges apart."""
    iqr = (high - low) / (1.5 + 1 + 1.5)
    return low + 1.5 * iqr, high - 1.5 * iqr


def remaining_mean(n: float, mean: float, parts: Sequence[Part]) -> float:
    """Return the mean of the values that remain when `parts` are removed from n values with this `mean`."""
    return (n * mean - sum(p.size * p.mean for p in parts)) / (n - sum(p.size for p in parts))


def remaining_std(n: float, mean: float, std: float, parts: Sequence[Part]) -> float:
    """Return the standard deviation of the values that remain without `parts`; NaN if no values have such moments."""
    squares = n * (std**2 + mean**2) - sum(p.size * (p.std**2 + p.mean**2) for p in parts)
    variance = squares / (n - sum(p.size for p in parts)) - remaining_mean(n, mean, parts) ** 2
    return math.sqrt(variance) if variance >= 0 else math.nan


def quarters(n: float, marks: Sequence[float], below: float = 0, above: float = 0) -> Groups:
    """Return the quarters of n values without the outliers; `marks`: lowest of the rest, Q1, median, Q3, highest.

    The quartiles count all values: `below` outliers belong to the first quarter, `above` outliers to the last.
    """
    return list(zip((n / 4 - below, n / 4, n / 4, n / 4 - above), marks[:-1], marks[1:], strict=True))


def mean_range(groups: Groups) -> tuple[float, float]:
    """Return the least and the greatest mean that values in these ranges can have."""
    n = sum(count for count, _, _ in groups)
    return sum(count * low for count, low, _ in groups) / n, sum(count * high for count, _, high in groups) / n


def least_std(mean: float, groups: Groups) -> float:
    """Return a lower bound on the standard deviation of such values: none is nearer to the mean than its range is."""
    squares = sum(count * float(np.max((low - mean, mean - high, 0))) ** 2 for count, low, high in groups)
    return math.sqrt(squares / sum(count for count, _, _ in groups))


def greatest_std(mean: float, low: float, high: float) -> float:
    """An upper bound on the standard deviation of values in [low, high] with this mean (Bhatia and Davis 2000)."""
    return math.sqrt(max((high - mean) * (mean - low), 0))


def rounds_to(number: float, printed: float) -> bool:
    """Return whether `number`, rounded to the decimals of `printed`, may be `printed`; NaN may not."""
    decimals = len(f"{printed:.12g}".partition(".")[2])
    return bool(abs(number - printed) <= 0.5 / 10**decimals + 1e-9)
