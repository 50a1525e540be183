"""Intervals (95 %) over policies, over policies and start states, and of shares."""

from collections.abc import Callable

import numpy as np

from ..checks import check_count, check_finite, check_seed


def bootstrap_draws(n_rows: int, n_resamples: int, seed: int) -> np.ndarray:
    """Return the indices of the `n_rows` rows that each resample draws with replacement. (n_resamples, n_rows) Every
    interval over policies resamples this way; the same seed draws the same rows."""
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
    finite."""
    returns = check_finite("returns", returns)
    if not returns.size or not returns.ndim:
        raise ValueError(f"returns have shape {returns.shape}, expected a row per policy")
    draws = bootstrap_draws(len(returns), n_resamples, seed)
    drawn = statistic(returns[draws], axis=1) if vectorized else np.array([statistic(returns[draw]) for draw in draws])
    return percentile_interval(drawn)


def share_interval(count: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share when `count` of `n` were observed (Clopper & Pearson 1934)."""
    from scipy.stats import binomtest

    low, high = binomtest(count, n).proportion_ci(method="exact")
    return low, high


def crossed_interval(values: np.ndarray) -> tuple[float, float]:
    """Return the percentile bootstrap interval (95 %) of the mean of `values` (p, n), over policies *and* start states.

    Policies may be so alike (twenty fits to almost the same data) that the starts matter most. How often each row or
    column is drawn is multinomial. This is the distribution of the counts in `bootstrap_draws`, without drawing p + n
    indices per resample."""
    rng = np.random.default_rng(0)
    policies, starts = (rng.multinomial(k, np.full(k, 1 / k), size=2000) for k in values.shape)
    return percentile_interval(np.einsum("rn,rn->r", policies @ values, starts) / values.size)
