"""What summary numbers say about each other: fences and quartiles, means and deviations of a part and of the rest.

Standard deviations divide by n. What is not a number stays so: NaN in, NaN out.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from .checks import check_number

Groups = Sequence[tuple[float, float, float]]  # (count, low, high): so many values lie in [low, high]
Part = namedtuple("Part", "size mean std low high")  # some of the returns, and the range that they lie in


def fences(q1: float, q3: float) -> tuple[float, float]:
    """The bounds beyond which a box plot counts outliers: 1.5 interquartile ranges from the quartiles."""
    return q1 - 1.5 * (q3 - q1), q3 + 1.5 * (q3 - q1)


def quartiles_from_fences(low: float, high: float) -> tuple[float, float]:
    """Q1 and Q3 with these fences, which lie 1.5 + 1 + 1.5 interquartile ranges apart."""
    iqr = (high - low) / (1.5 + 1 + 1.5)
    return low + 1.5 * iqr, high - 1.5 * iqr


def remaining_mean(n: float, mean: float, parts: Sequence[Part]) -> float:
    """Mean of what is left of n values with this `mean` when `parts` are taken away."""
    return (n * mean - sum(p.size * p.mean for p in parts)) / (n - sum(p.size for p in parts))


def remaining_std(n: float, mean: float, std: float, parts: Sequence[Part]) -> float:
    """Standard deviation of what is left when `parts` are taken away; NaN if no values have such moments."""
    squares = n * (std**2 + mean**2) - sum(p.size * (p.std**2 + p.mean**2) for p in parts)
    variance = squares / (n - sum(p.size for p in parts)) - remaining_mean(n, mean, parts) ** 2
    return math.sqrt(variance) if variance >= 0 else math.nan


def quarters(n: float, marks: Sequence[float], below: float = 0, above: float = 0) -> Groups:
    """Where those of n values lie that are no outliers; `marks` are their lowest, Q1, median, Q3 and their highest.

    The quartiles count all values: outliers take their places in the first (`below`) and the last quarter (`above`).
    """
    return list(zip((n / 4 - below, n / 4, n / 4, n / 4 - above), marks[:-1], marks[1:], strict=True))


def mean_range(groups: Groups) -> tuple[float, float]:
    """The least and the greatest mean that values in these ranges can have."""
    n = sum(count for count, _, _ in groups)
    return sum(count * low for count, low, _ in groups) / n, sum(count * high for count, _, high in groups) / n


def least_std(mean: float, groups: Groups) -> float:
    """A lower bound on the standard deviation of such values: each is at least as far from their mean as its range."""
    squares = sum(count * float(np.max((low - mean, mean - high, 0))) ** 2 for count, low, high in groups)
    return math.sqrt(squares / sum(count for count, _, _ in groups))


def greatest_std(mean: float, low: float, high: float) -> float:
    """An upper bound on the standard deviation of values in [low, high] with this mean (Bhatia and Davis 2000)."""
    return math.sqrt(max((high - mean) * (mean - low), 0))


def rounds_to(number: float, printed: float) -> bool:
    """Whether `number` may be printed as `printed`, to the last decimal of this; NaN may not."""
    check_number("printed", printed)
    decimals = max(0, -Decimal(repr(float(printed))).normalize().as_tuple().exponent)
    return bool(abs(number - printed) <= 0.5 / 10**decimals + 1e-9)
