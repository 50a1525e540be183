import math

import numpy as np
import pytest

from vsp.evaluate import spread
from vsp.moments import (
    Part,
    fences,
    greatest_std,
    least_std,
    mean_range,
    quarters,
    quartiles_from_fences,
    remaining_mean,
    remaining_std,
    rounds_to,
)


def test_fences_by_hand():
    assert fences(2.0, 4.0) == (-1.0, 7.0)
    assert quartiles_from_fences(-1.0, 7.0) == (2.0, 4.0)


def test_fences_are_those_of_the_evaluation_and_their_inverse_undoes_them():
    facts = spread(np.random.default_rng(0).gamma(2.0, size=1001))
    low, high = fences(facts["q1"], facts["q3"])
    assert (low, high) == (facts["lower_fence"], facts["upper_fence"])
    assert quartiles_from_fences(low, high) == pytest.approx((facts["q1"], facts["q3"]), rel=1e-12)


def part(values):
    return Part(len(values), values.mean(), values.std(), values.min(), values.max())


@pytest.mark.parametrize("seed", range(5))
def test_what_remains_is_what_numpy_finds_in_the_rest(seed):
    values = np.sort(np.random.default_rng(seed).gamma(2.0, size=400))
    low, middle, high = values[:30], values[30:380], values[380:]
    told = 400, values.mean(), [part(low), part(high)]
    assert remaining_mean(*told) == pytest.approx(middle.mean(), rel=1e-12)
    assert remaining_std(400, values.mean(), values.std(), told[2]) == pytest.approx(middle.std(), rel=1e-9)


def test_nothing_taken_away_and_moments_that_no_values_have():
    assert remaining_mean(10, 3.0, []) == 3.0 and remaining_std(10, 3.0, 2.0, []) == pytest.approx(2.0)
    assert math.isnan(remaining_std(10, 0.0, 1.0, [Part(5, 0.0, 2.0, -2.0, 2.0)]))  # the part alone spreads wider


@pytest.mark.parametrize("seed", range(20))
def test_bounds_hold_for_samples_whose_truth_is_known(seed):
    rng = np.random.default_rng(seed)
    values = np.sort(rng.choice([rng.normal(size=2000), rng.gamma(0.5, size=2000), rng.uniform(size=2000) ** 8]))
    below, above = rng.integers(0, 200, size=2)
    facts, rest = spread(values), values[below : 2000 - above]
    marks = [rest.min(), facts["q1"], facts["median"], facts["q3"], rest.max()]
    groups = quarters(2000, marks, below, above)
    assert sum(count for count, _, _ in groups) == len(rest)
    for (count, low, high), group in zip(groups, np.split(rest, np.cumsum([g[0] for g in groups[:3]]).astype(int))):
        assert count == len(group) and low <= group.min() and group.max() <= high
    least, most = mean_range(groups)
    assert least <= rest.mean() <= most
    assert least_std(rest.mean(), groups) <= rest.std() <= greatest_std(rest.mean(), rest.min(), rest.max())


def test_bounds_by_hand_and_reached():
    groups = [(2, 0.0, 1.0), (2, 3.0, 6.0)]
    assert mean_range(groups) == (1.5, 3.5)
    assert least_std(2.0, groups) == np.std([1.0, 1.0, 3.0, 3.0]) == 1.0
    assert least_std(0.5, [(4, 0.0, 1.0)]) == 0.0
    assert greatest_std(2.0, 0.0, 8.0) == pytest.approx(np.std([0.0, 0.0, 0.0, 8.0]))
    assert greatest_std(9.0, 0.0, 8.0) == 0.0  # no such values


def test_rounds_to():
    assert rounds_to(92.175, 92.18) and rounds_to(97.6, 97.6) and rounds_to(100.4, 100.0)
    assert not rounds_to(86.98, 86.17) and not rounds_to(97.7, 97.6) and not rounds_to(100.6, 100.0)
