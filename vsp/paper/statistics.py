"""Statistics of returns: the paper's spread metrics, their resamples, and what summary numbers imply.

Standard deviations divide by n - 1 for samples (`spread`) and by n for the identities on parts of a sample
(`remaining_std` and the like). In the identities NaN gives NaN.
"""

import math
from collections import namedtuple
from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..checks import check_finite, check_seed
from ..evaluation import fences


def spread(returns: np.ndarray) -> dict[str, float]:
    """Return the spread of returns of any shape: the metrics of the paper's tables T5 and T6, and those its text adds.

    Keys, in units of return: min, max, mean, std (of the sample, n - 1), q1, median, q3, iqr; lower_fence and
    upper_fence, 1.5 interquartile ranges beyond the quartiles, which the paper calls bounds; outliers_below and
    outliers_above, counts of returns outside the fences; coverage, the share inside. Raises ValueError if there are
    no returns, or some are not finite."""
    returns = check_finite("returns", returns).ravel()
    if not len(returns):
        raise ValueError("no returns, expected at least one")
    q1, median, q3 = np.percentile(returns, [25, 50, 75])
    lower, upper = fences(q1, q3)
    below, above, moments = returns < lower, returns > upper, _moments(returns, np.ones(len(returns)))
    numbers = {name: moments[name] for name in ("min", "max", "mean", "std")}
    numbers |= {"q1": q1, "median": median, "q3": q3, "iqr": q3 - q1}
    numbers |= {"coverage": 1.0 - (below | above).mean(), "lower_fence": lower, "upper_fence": upper}
    return numbers | {"outliers_below": int(below.sum()), "outliers_above": int(above.sum())}


def outlier_numbers(returns: np.ndarray) -> dict[str, float]:
    """Return the paper's statistics of outliers, under the names that end their ids in `data/paper/text_numbers.csv`.
    Means, standard deviations and ranges of an empty set are NaN. Raises ValueError as `spread` does."""
    facts, returns = spread(returns), np.ravel(returns)
    lower, upper = facts["lower_fence"], facts["upper_fence"]
    numbers = {name: facts[name] for name in ("mean", "std", "min", "max")}
    numbers |= {"whisker_low": lower, "whisker_high": upper}
    return numbers | _outliers(
        *((side, np.ones(len(side))) for side in (returns[returns < lower], returns[returns > upper]))
    )


def _outliers(*sides: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    """Describe the outliers below and above; of each side their values, and how many times each occurs."""
    outside = tuple(np.concatenate(part) for part in zip(*sides))
    numbers: dict[str, float] = {"outliers": int(outside[1].sum())}
    numbers |= {f"outliers_{name}": value for name, value in _moments(*outside).items()}
    for side, (values, times) in zip(("below", "above"), sides):
        moments = _moments(values, times)
        numbers[f"outliers_{side}_share"] = 100 * times.sum() / numbers["outliers"] if numbers["outliers"] else np.nan
        numbers |= {f"outliers_{side}_{name}": moments[name] for name in ("mean", "std")}
    return numbers


def _moments(values: np.ndarray, times: np.ndarray) -> dict[str, float]:
    """Return mean, standard deviation and extremes of values that occur so many `times`."""
    n, there = times.sum(), values[times > 0]
    if not n:
        return dict.fromkeys(("mean", "std", "min", "max"), np.nan)
    mean = times @ values / n
    deviation = math.sqrt(times @ np.square(values - mean) / max(1, n - 1))
    return {"mean": mean, "std": deviation, "min": there.min(), "max": there.max()}


def resample(returns: np.ndarray, *, n_resamples: int = 2000, seed: int = 0) -> pd.DataFrame:
    """Bootstrap the statistics of `spread` and `outlier_numbers`: one row per resample, one column per statistic.

    Resamples policies, the rows of `returns` (p, n), *and* start states, the columns; of a single policy the starts
    alone. How often each is drawn is multinomial, and a return counts as often as its policy times as its start.
    Coverage and shares are in percent. A statistic of a set that a resample leaves empty is NaN."""
    check_seed(seed)
    order = np.argsort(returns, axis=None, kind="stable")
    values, places = returns.ravel()[order], np.divmod(order, returns.shape[1])
    rng, rows = np.random.default_rng(seed), []
    for _ in range(n_resamples):
        drawn = (rng.multinomial(k, np.full(k, 1 / k)).astype(float) for k in returns.shape)
        policies, starts = (times[place] for times, place in zip(drawn, places))
        rows.append(_weighted(values, policies * starts))
    return pd.DataFrame(rows)


def _weighted(values: np.ndarray, times: np.ndarray) -> dict[str, float]:
    """Return the statistics of a sample that contains each of the sorted `values` so many `times`."""
    until = np.cumsum(times)
    places = np.multiply((0.25, 0.5, 0.75), until[-1] - 1)
    whole = places.astype(int)
    first, second = (
        values[until.searchsorted(rank, "right")] for rank in (whole, np.minimum(whole + 1, until[-1] - 1))
    )
    q1, median, q3 = first + (places - whole) * (second - first)
    lower, upper = fences(q1, q3)
    low, high = values.searchsorted(lower), values.searchsorted(upper, "right")
    sides = (values[:low], times[:low]), (values[high:], times[high:])
    numbers = {"q1": q1, "median": median, "q3": q3, "iqr": q3 - q1, **_moments(values, times)}
    numbers |= {"whisker_low": lower, "whisker_high": upper, **_outliers(*sides)}
    return numbers | {"coverage": 100 * (1 - numbers["outliers"] / until[-1])}


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
    """Return the quarters of n values without the outliers; `marks`: lowest of the rest, Q1, median, Q3, highest. The
    quartiles count all values: `below` outliers belong to the first quarter, `above` outliers to the last."""
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
