"""Statistics of returns: the paper's spread metrics, intervals that resample policies, and what summary numbers imply.

Standard deviations divide by n - 1 for samples (`spread`) and by n for the identities on parts of a sample
(`remaining_std` and the like). In the identities NaN gives NaN.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Sequence
from decimal import Decimal

import numpy as np
import pandas as pd

from ..checks import check_array, check_count, check_finite, check_number, check_seed
from ..evaluation import fences


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


def bootstrap_draws(n_rows: int, n_resamples: int, seed: int) -> np.ndarray:
    """Return the indices of the `n_rows` rows that each resample draws with replacement. (n_resamples, n_rows)

    Every interval over policies resamples this way; the same seed draws the same rows.
    """
    check_count("n_resamples", n_resamples)
    check_seed(seed)
    return np.random.default_rng(seed).integers(n_rows, size=(n_resamples, n_rows))


def percentile_interval(values: np.ndarray) -> tuple[float, float]:
    """Return the middle 95 % of `values`: a percentile interval if they are the statistic of each resample."""
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def interval(
    returns: np.ndarray, statistic: Callable, *, vectorized: bool = False, n_resamples: int = 10_000, seed: int = 0
) -> tuple[float, float]:
    """Return the percentile bootstrap interval (95 %) of `statistic(returns)`.

    It resamples policies, which are the rows of `returns` (p, ...). All policies share start states, so episodes are
    not independent and are never resampled alone. `vectorized` calls `statistic(resamples, axis=1)` once for all
    resamples; `returns` are then one number per policy (p,). Raises ValueError if there are no returns, or some are not
    finite.
    """
    returns = check_finite("returns", returns)
    if not returns.size or not returns.ndim:
        raise ValueError(f"returns have shape {returns.shape}, expected a row per policy")
    draws = bootstrap_draws(len(returns), n_resamples, seed)
    return percentile_interval(
        statistic(returns[draws], axis=1) if vectorized else [statistic(returns[draw]) for draw in draws]
    )


def share_interval(count: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share when `count` of `n` were observed (Clopper & Pearson 1934)."""
    from scipy.stats import binomtest

    low, high = binomtest(count, n).proportion_ci(method="exact")
    return low, high


def crossed_interval(values: np.ndarray) -> tuple[float, float]:
    """Return the percentile bootstrap interval (95 %) of the mean of `values` (p, n), over policies *and* start states.

    Policies may be so alike (twenty fits to almost the same data) that the starts matter most. How often each row or
    column is drawn is multinomial. This is the distribution of the counts in `bootstrap_draws`, without drawing p + n
    indices per resample.
    """
    rng = np.random.default_rng(0)
    policies, starts = (rng.multinomial(k, np.full(k, 1 / k), size=2000) for k in values.shape)
    return percentile_interval(np.einsum("rn,rn->r", policies @ values, starts) / values.size)


def resample(returns: np.ndarray, *, n_resamples: int = 10_000, seed: int = 0) -> pd.DataFrame:
    """Bootstrap all statistics of `spread` and `outlier_numbers`: one row per resample, one column per statistic.

    Resamples the rows of `returns` (p, n), which are policies. Coverage and shares are in percent. A statistic of a set
    that a resample leaves empty is NaN. Raises ValueError if there are no returns, or some are not finite.
    """
    returns = check_array("returns", returns, (-1, -1))
    if not returns.size:
        raise ValueError(f"returns have shape {returns.shape}, expected a row per policy")
    (p, n), order = returns.shape, returns.argsort(axis=None, kind="stable")
    values, policy = returns.ravel()[order], order // n  # sorted once: a resample only counts each value again
    means, low, high = returns.mean(axis=1), returns.min(axis=1), returns.max(axis=1)
    squares, rows = np.square(returns - means[:, None]).sum(axis=1), []
    for draw in bootstrap_draws(p, n_resamples, seed):
        mean = means[draw].mean()
        total = (squares[draw] + n * np.square(means[draw] - mean)).sum()
        row = {
            "mean": mean,
            "std": math.sqrt(total / max(1, p * n - 1)),
            "min": low[draw].min(),
            "max": high[draw].max(),
        }
        rows.append(row | _counted(values, np.bincount(draw, minlength=p).astype(np.int32)[policy]))
    return pd.DataFrame(rows)


def _counted(values: np.ndarray, counts: np.ndarray) -> dict[str, float]:
    """Return quartiles, fences and outliers of sorted `values` (k,), each of which counts `counts` (k,) times."""
    until, n = counts.cumsum(dtype=np.int32), len(values)
    place = np.array([0.25, 0.5, 0.75]) * (n - 1)  # interpolated as by `np.percentile`
    below, above = values[until.searchsorted(np.array([np.floor(place), np.ceil(place)], dtype=np.int32), "right")]
    q1, median, q3 = (below + (place - np.floor(place)) * (above - below)).tolist()
    lower, upper = fences(q1, q3)
    sides = {"below": slice(values.searchsorted(lower)), "above": slice(values.searchsorted(upper, "right"), n)}
    parts = {f"outliers_{side}": (values[part], counts[part].astype(float)) for side, part in sides.items()}
    parts["outliers"] = tuple(np.concatenate(pair) for pair in zip(*parts.values()))
    sizes = {name: size.sum() for name, (_, size) in parts.items()}
    total = sizes.pop("outliers")
    row = {f"{name}_{statistic}": x for name, part in parts.items() for statistic, x in _counted_moments(*part).items()}
    row |= {f"{name}_share": 100 * size / total if total else np.nan for name, size in sizes.items()}
    row |= {"q1": q1, "median": median, "q3": q3, "iqr": q3 - q1, "whisker_low": lower, "whisker_high": upper}
    return row | {"outliers": total, "coverage": 100 * (1 - total / n)}


def _counted_moments(values: np.ndarray, counts: np.ndarray) -> dict[str, float]:
    drawn = np.flatnonzero(counts)
    if not len(drawn):
        return _moments(values[drawn])
    n = counts.sum()
    mean = values[0] + counts @ (values - values[0]) / n
    std = math.sqrt(counts @ np.square(values - mean) / max(1, n - 1))
    return {"mean": mean, "std": std, "min": values[drawn[0]], "max": values[drawn[-1]]}


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
    check_number("printed", printed)
    decimals = max(0, -Decimal(repr(float(printed))).normalize().as_tuple().exponent)
    return bool(abs(number - printed) <= 0.5 / 10**decimals + 1e-9)
