import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vsp.paper import statistics
from vsp.paper.statistics import greatest_std, outlier_numbers, resample, rounds_to, spread
from vsp.protocol import interval, intervals

HAND = np.array([-100.0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 100])  # quartiles 2.5, 5, 7.5: whiskers at -5 and 15


def test_spread_by_hand():
    found = spread(HAND)
    expected = {
        "min": -100, "max": 100, "mean": 45 / 11, "q1": 2.5, "median": 5, "q3": 7.5, "iqr": 5, "coverage": 9 / 11,
        "lower_fence": -5, "upper_fence": 15, "outliers_below": 1, "outliers_above": 1,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert found["std"] == pytest.approx(pd.Series(HAND).std()) and len(found) == len(expected) + 1
    assert spread([3.0])["std"] == 0 and spread([3.0])["coverage"] == 1


def test_outlier_numbers_by_hand():
    found = outlier_numbers(np.array([-100.0, -50, *range(1, 10), 100]))
    std = np.std([-100, -50, 100], ddof=1)
    expected = {"": 3, "_mean": -50 / 3, "_min": -100, "_max": 100, "_std": std, "_below_share": 200 / 3,
                "_above_share": 100 / 3, "_below_mean": -75, "_above_mean": 100, "_below_std": 1250**0.5,
                "_above_std": 0}  # fmt: skip
    assert {name: found[f"outliers{name}"] for name in expected} == pytest.approx(expected)
    assert (both := spread([-100.0, -50, *range(1, 10), 100]))["outliers_below"] == 2 * both["outliers_above"] == 2
    without = outlier_numbers(np.arange(10.0))
    assert without["outliers"] == 0 and all(np.isnan(without[f"outliers{name}"]) for name in expected if name)


# Intervals


def test_an_interval_repeats_with_its_seed():
    returns = np.random.default_rng(0).normal(size=(12, 40))
    one, same, other = (interval(returns, np.mean, seed=seed) for seed in (1, 1, 2))
    assert one == same != other


@pytest.mark.parametrize("statistic", [np.mean, np.median])
def test_all_resamples_at_once_give_the_interval_of_one_by_one(statistic):
    values = np.random.default_rng(3).normal(size=23)
    assert interval(values, statistic, vectorized=True) == interval(values, statistic)


def test_an_interval_resamples_policies_and_not_episodes():
    """Policies that differ by much in all episodes: the interval must see p policies, not p x n independent numbers."""
    policy_means = np.random.default_rng(1).normal(size=20)
    returns = np.repeat(policy_means[:, None], 1000, axis=1)
    low, high = interval(returns, np.mean)
    expected = 2 * 1.96 * policy_means.std() / np.sqrt(20)
    assert high - low == pytest.approx(expected, rel=0.1) and low < policy_means.mean() < high
    seen = []
    interval(returns, lambda drawn: seen.append(drawn) or 0.0, n_resamples=50)
    assert all(drawn.shape == (20, 1000) and (drawn == drawn[:, :1]).all() for drawn in seen)
    assert any(len(np.unique(drawn[:, 0])) < 20 for drawn in seen)


def test_the_crossed_interval_is_that_of_drawing_rows_and_columns():
    """The same by hand: an average over drawn policies of an average over drawn starts."""
    gaps, rng = np.random.default_rng(5).normal(size=(4, 30)), np.random.default_rng(1)
    means = [gaps[rng.integers(4, size=4)][:, rng.integers(30, size=30)].mean() for _ in range(4000)]
    assert intervals.crossed_interval(gaps) == pytest.approx(np.percentile(means, [2.5, 97.5]), abs=0.04)
    assert intervals.crossed_interval(gaps) == intervals.crossed_interval(gaps)


# Everything resampled at once

# Quarters of whole numbers: many are equal, some lie on a fence, and quartiles and fences come out exact
QUARTERS = st.integers(-80, 80).map(lambda number: number / 4)


def both_routes(returns):
    """What `resample` gives, from `spread` and `outlier_numbers`, which know it by these names or others."""
    facts = spread(returns)
    expected = {name: facts[name] for name in ("q1", "median", "q3", "iqr")}
    return expected | outlier_numbers(returns) | {"coverage": 100 * facts["coverage"]}


def check_resamples(frame, returns, seed):
    """A resample is the drawn rows, of which the drawn columns."""
    rng = np.random.default_rng(seed)
    for found in frame.to_dict("records"):
        rows, columns = (np.repeat(np.arange(k), rng.multinomial(k, np.full(k, 1 / k))) for k in returns.shape)
        assert found == pytest.approx(both_routes(returns[rows][:, columns].ravel()), nan_ok=True)


@given(arrays(np.float64, st.tuples(st.integers(1, 5), st.integers(1, 20)), elements=QUARTERS), st.integers(0, 99))
def test_a_resample_is_the_drawn_runs_from_the_drawn_starts(returns, seed):
    check_resamples(resample(returns, n_resamples=3, seed=seed), returns, seed)


def test_outliers_that_are_almost_equal_have_an_exact_deviation():
    """Far from the mean of all returns, so that sums of squares about it would keep no digit of it."""
    values = np.append(np.zeros(98), [1e6, 1e6 + 1e-6])
    assert statistics._weighted(values, np.ones(100))["outliers_std"] == np.std(values[98:], ddof=1)


# What summary numbers imply


@pytest.mark.parametrize("seed", range(8))
def test_bounds_hold_for_samples_whose_truth_is_known(seed):
    rng = np.random.default_rng(seed)
    values = np.sort(rng.choice([rng.normal(size=2000), rng.gamma(0.5, size=2000), rng.uniform(size=2000) ** 8]))
    below, above = rng.integers(0, 200, size=2)
    facts, rest = spread(values), values[below : 2000 - above]
    marks = [rest.min(), facts["q1"], facts["median"], facts["q3"], rest.max()]
    groups = statistics.quarters(2000, marks, below, above)
    assert sum(count for count, _, _ in groups) == len(rest)
    for (count, low, high), group in zip(groups, np.split(rest, np.cumsum([g[0] for g in groups[:3]]).astype(int))):
        assert count == len(group) and low <= group.min() and group.max() <= high
    least, most = statistics.mean_range(groups)
    assert least <= rest.mean() <= most
    assert statistics.least_std(rest.mean(), groups) <= rest.std() <= greatest_std(rest.mean(), rest.min(), rest.max())


def test_bounds_by_hand_and_reached():
    groups = [(2, 0.0, 1.0), (2, 3.0, 6.0)]
    assert statistics.mean_range(groups) == (1.5, 3.5)
    assert statistics.least_std(2.0, groups) == np.std([1.0, 1.0, 3.0, 3.0]) == 1.0
    assert statistics.least_std(0.5, [(4, 0.0, 1.0)]) == 0.0
    assert greatest_std(2.0, 0.0, 8.0) == pytest.approx(np.std([0.0, 0.0, 0.0, 8.0]))
    assert greatest_std(9.0, 0.0, 8.0) == 0.0  # no such values


def test_rounds_to():
    assert rounds_to(92.175, 92.18) and rounds_to(97.6, 97.6) and rounds_to(100.4, 100.0)
    assert not rounds_to(86.98, 86.17) and not rounds_to(97.7, 97.6) and not rounds_to(100.6, 100.0)


def test_a_share_has_exact_bounds():
    """Five of five are at least 48 %: 0.025 ** (1 / 5)."""
    assert intervals.share_interval(5, 5) == (pytest.approx(0.025**0.2), 1.0)
    low, high = intervals.share_interval(2, 4)
    assert low == pytest.approx(1 - high) and low < 0.5
