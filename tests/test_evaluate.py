import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, Constant, CurvedTeacher, PumpingTeacher

from vsp import paper
from vsp.envs import OUTCOMES, get_task
from vsp.evaluate import (
    _weighted_statistics,
    evaluate,
    interval,
    outcomes,
    outlier_numbers,
    resample,
    spread,
    start_states,
)
from vsp.rollouts import play

HAND = np.array([-100.0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 100])  # quartiles 2.5, 5, 7.5: whiskers at -5 and 15
RETURNS = arrays(np.float64, st.integers(1, 60), elements=st.floats(-1e3, 1e3))


def test_spread_by_hand():
    found = spread(HAND)
    expected = {
        "min": -100, "max": 100, "mean": 45 / 11, "q1": 2.5, "median": 5, "q3": 7.5, "iqr": 5, "coverage": 9 / 11,
        "lower_fence": -5, "upper_fence": 15, "outliers_below": 1, "outliers_above": 1,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert found["std"] == pytest.approx(pd.Series(HAND).std()) and len(found) == len(expected) + 1


def test_a_value_on_the_whisker_is_no_outlier():
    found = spread(np.array([-5.0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 15]))
    assert (found["outliers_below"], found["outliers_above"], found["coverage"]) == (0, 0, 1)


def test_one_return():
    assert spread([3.0])["std"] == 0 and spread([3.0])["coverage"] == 1


@given(RETURNS, st.floats(-100, 100), st.floats(0.125, 8))
def test_spread_moves_and_stretches_with_its_numbers(returns, shift, scale):
    plain, other = spread(returns), spread(returns * scale + shift)
    for name in ("min", "max", "mean", "q1", "median", "q3"):
        assert other[name] == pytest.approx(plain[name] * scale + shift, abs=1e-6)
    for name in ("std", "iqr"):
        assert other[name] == pytest.approx(plain[name] * scale, abs=1e-6)


@given(RETURNS)
def test_coverage_is_what_is_left_of_the_outliers(returns):
    found = spread(returns)
    outside = found["outliers_below"] + found["outliers_above"]
    assert found["coverage"] == pytest.approx(1 - outside / len(returns)) and found["coverage"] >= 0.5
    assert found["min"] <= found["q1"] <= found["median"] <= found["q3"] <= found["max"]
    assert outlier_numbers(returns)["outliers"] == outside
    assert spread(returns[::-1].reshape(-1, 1)) == pytest.approx(found)


def test_outlier_numbers_by_hand():
    found = outlier_numbers(np.array([-100.0, -50, *range(1, 10), 100]))
    assert (found["outliers"], found["outliers_mean"], found["outliers_min"], found["outliers_max"]) == (
        3, pytest.approx(-50 / 3), -100, 100,
    )  # fmt: skip
    assert found["outliers_below_share"] == pytest.approx(200 / 3) and found["outliers_above_share"] == pytest.approx(
        100 / 3
    )
    assert (found["outliers_below_mean"], found["outliers_above_mean"]) == (-75, 100)
    assert found["outliers_below_std"] == pytest.approx(np.sqrt(1250)) and found["outliers_above_std"] == 0
    assert found["outliers_std"] == pytest.approx(np.std([-100, -50, 100], ddof=1))


def test_outlier_numbers_without_outliers_are_nan():
    found = outlier_numbers(np.arange(10.0))
    assert found["outliers"] == 0
    assert all(
        np.isnan(found[f"outliers_{name}"]) for name in ("mean", "std", "min", "max", "below_share", "above_mean")
    )


@pytest.mark.parametrize("task", TASKS)
def test_outlier_numbers_have_the_names_of_the_papers_list(task):
    prefix = {SIMPLEGOAL: "sg", MOUNTAINCAR: "mc"}[task]
    ids = paper.text_numbers(task).index
    shared = [name for name in outlier_numbers(HAND) if f"{prefix}_ours_{name}" in ids]
    assert {"mean", "std", "min", "max", "outliers"} <= set(shared) and len(shared) >= 9


def test_start_states_repeat_and_the_first_ones_stay():
    task = get_task(SIMPLEGOAL)
    assert np.array_equal(start_states(task, 50, 1), start_states(task, 50, 1))
    assert not np.array_equal(start_states(task, 50, 1), start_states(task, 50, 2))
    assert np.array_equal(start_states(task, 10, 1), start_states(task, 50, 1)[:10])
    for n in (0, -5):
        with pytest.raises(ValueError, match=f"n_episodes is {n}, expected an integer from 1 on"):
            evaluate(CurvedTeacher(), SIMPLEGOAL, n, seed=0)


@pytest.mark.parametrize(("task", "player"), [(SIMPLEGOAL, CurvedTeacher()), (MOUNTAINCAR, PumpingTeacher())])
def test_evaluate_is_a_row_per_episode(task, player):
    frame = evaluate(player, task, n_episodes=60, seed=3)
    result = play(player, get_task(task), start_states(get_task(task), 60, 3))
    assert frame.columns.tolist() == ["return", "length", "outcome"] and frame.index.tolist() == list(range(60))
    assert np.array_equal(frame["return"], result.returns) and np.array_equal(frame["length"], result.lengths)
    assert frame["outcome"].tolist() == [OUTCOMES[code] for code in result.codes]
    assert frame.equals(evaluate(player, task, n_episodes=60, seed=3))


def test_policies_share_their_starts():
    still, up = (outcomes(Constant(0.0, y), SIMPLEGOAL, 100, seed=0).returns for y in (0.0, 1e-9))
    assert np.abs(still - up).max() < 1e-3 and still.min() == -10


def test_unknown_task():
    with pytest.raises(ValueError, match="unknown task 'SimpleGaol-v0'.*did you mean 'SimpleGoal-v0'"):
        evaluate(CurvedTeacher(), "SimpleGaol-v0", seed=0)


# Intervals


def test_an_interval_repeats_with_its_seed():
    returns = np.random.default_rng(0).normal(size=(12, 40))
    assert (
        interval(returns, np.mean, seed=1) == interval(returns, np.mean, seed=1) != interval(returns, np.mean, seed=2)
    )


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


def test_an_interval_widens_with_its_level_and_covers():
    returns = np.random.default_rng(2).normal(size=(40, 5))
    narrow, wide = interval(returns, np.mean, level=0.5), interval(returns, np.mean, level=0.999)
    assert wide[0] < narrow[0] < returns.mean() < narrow[1] < wide[1]
    draws = (np.random.default_rng(seed).normal(size=(40, 1)) for seed in range(200))
    covered = np.mean([low < 0 < high for low, high in (interval(d, np.mean, n_resamples=300) for d in draws)])
    assert 0.89 <= covered <= 0.99


@pytest.mark.parametrize(("returns", "message"), [([], "no returns"), ([1.0, np.nan], "returns hold nan")])
def test_a_spread_of_nothing_or_nan_is_refused(returns, message):
    with pytest.raises(ValueError, match=message):
        spread(np.array(returns))


@pytest.mark.parametrize("n", [2.5, "3", None])
def test_a_number_of_episodes_is_an_integer(n):
    with pytest.raises(ValueError, match="expected an integer from 1 on"):
        start_states(get_task(SIMPLEGOAL), n, 1)


# Everything resampled at once

# Quarters of whole numbers: many are equal, some lie on a fence, and quartiles and fences come out exact
QUARTERS = st.integers(-80, 80).map(lambda number: number / 4)


def both_routes(returns):
    """What `resample` gives, from `spread` and `outlier_numbers`, which know it by these names or others."""
    facts = spread(returns)
    expected = {name: facts[name] for name in ("min", "max", "mean", "std", "q1", "median", "q3", "iqr")}
    expected |= outlier_numbers(returns) | {"coverage": 100 * facts["coverage"]}
    sides = {"below": returns[returns < facts["lower_fence"]], "above": returns[returns > facts["upper_fence"]]}
    for side, values in sides.items():
        expected[f"outliers_{side}_min"] = values.min() if len(values) else np.nan
        expected[f"outliers_{side}_max"] = values.max() if len(values) else np.nan
    return expected


def agree(found, expected):
    assert found.keys() == expected.keys()
    for name in expected:
        assert found[name] == pytest.approx(expected[name], rel=1e-9, abs=1e-9, nan_ok=True), name


@given(arrays(np.float64, st.integers(1, 60), elements=QUARTERS))
def test_statistics_that_count_each_value_once_are_those_of_the_spread(returns):
    agree(_weighted_statistics(np.sort(returns), np.ones(len(returns))), both_routes(returns))


@given(st.lists(st.tuples(QUARTERS, st.integers(0, 3)), min_size=1, max_size=40).filter(lambda p: any(n for _, n in p)))
def test_a_weight_stands_for_so_many_copies(pairs):
    values, weights = (np.array(part, dtype=float) for part in zip(*sorted(pairs)))
    agree(_weighted_statistics(values, weights), both_routes(np.repeat(values, weights.astype(int))))


def test_a_value_on_the_fence_is_no_outlier_however_often_it_is_drawn():
    values = np.array([-5.0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 15])  # quartiles 2.5 and 7.5, fences -5 and 15
    found = _weighted_statistics(values, np.ones(11))
    assert (found["whisker_low"], found["whisker_high"], found["outliers"], found["coverage"]) == (-5, 15, 0, 100)
    found = _weighted_statistics(values, np.array([1.0] * 10 + [0.0]))
    assert (found["max"], found["q1"], found["q3"], found["whisker_low"]) == (9, 2.25, 6.75, -4.5)
    assert (found["outliers"], found["outliers_min"], found["coverage"]) == (1, -5, 90)


def drawn(seed, p, n_resamples):
    rng = np.random.default_rng(seed)
    return [rng.integers(p, size=p) for _ in range(n_resamples)]


@pytest.mark.parametrize("shape", [(1, 7), (7, 1), (12, 30)])
def test_a_resample_is_the_drawn_rows_stacked(shape):
    rng = np.random.default_rng(3)
    returns = rng.normal(15, 2, shape) - 25 * (rng.random(shape) < 0.06)
    frame = resample(returns, n_resamples=25, seed=4)
    assert len(frame) == 25
    for found, rows in zip(frame.to_dict("records"), drawn(4, len(returns), 25), strict=True):
        agree(found, both_routes(np.vstack([returns[i] for i in rows])))


def test_resamples_repeat_with_their_seed():
    returns = np.random.default_rng(0).normal(size=(6, 10))
    one, same, other = (resample(returns, n_resamples=20, seed=seed) for seed in (1, 1, 2))
    assert one.equals(same) and not one.equals(other)
    assert resample(returns, n_resamples=5, seed=1).equals(one[:5]) and len(resample(returns)) == 10_000
    assert resample(np.asfortranarray(returns), n_resamples=20, seed=1).equals(one)


def test_policies_are_resampled_and_not_episodes():
    """Policies with the same return in all episodes: a resample can hold no other mean than one of whole policies."""
    returns = np.repeat(np.array([[0.0], [1.0]]), 9, axis=1)
    assert set(resample(returns, n_resamples=60)["mean"]) == {0.0, 0.5, 1.0}


def test_resamples_of_two_sets_draw_the_same_rows():
    returns = np.random.default_rng(5).normal(size=(8, 20))
    one, other = (resample(values, n_resamples=30) for values in (returns, returns + 4))
    for name in ("mean", "median", "min", "max"):
        assert np.allclose(other[name], one[name] + 4)


def test_the_mean_has_the_interval_that_stacking_gives():
    returns = np.random.default_rng(6).normal(size=(15, 20))
    low, high = resample(returns, n_resamples=400)["mean"].quantile([0.025, 0.975])
    assert (low, high) == pytest.approx(interval(returns, np.mean, n_resamples=400))


def test_resamples_without_outliers_are_nan_where_outliers_are_described():
    returns = np.arange(40.0).reshape(4, 10) % 7
    frame = resample(returns, n_resamples=10)
    described = [name for name in frame if name.startswith("outliers_")]
    assert len(described) == 4 + 2 * 5 and frame[described].isna().all(axis=None)
    assert (frame["outliers"] == 0).all() and (frame["coverage"] == 100).all()
    assert frame.drop(columns=described).notna().all(axis=None)


def test_a_resample_without_the_only_outlier_is_nan_and_the_others_are_not():
    returns = np.tile(np.arange(10.0), (6, 1))
    returns[2, 0] = 1000
    frame, absent = resample(returns, n_resamples=40), np.array([2 not in rows for rows in drawn(0, 6, 40)])
    assert 0 < absent.sum() < 40
    assert np.array_equal(frame["outliers_above_mean"].isna(), absent) and (frame["outliers"][absent] == 0).all()
    assert set(frame["outliers_above_mean"].dropna()) == {1000.0} == set(frame["max"][~absent])
    assert frame["outliers_below_mean"].isna().all() and set(frame["outliers_above_share"].dropna()) == {100.0}
