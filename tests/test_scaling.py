import numpy as np
import pandas as pd
import pytest

from vsp import scaling, study
from vsp.config import preset
from vsp.scaling import Environment, cost, exponents, power_law

SIZES = np.array([1, 10, 100, 1000, 10_000, 100_000])


def test_a_power_law_is_found_again_above_what_any_call_costs():
    sizes, fitted, exponent, half = power_law(SIZES, 3.0 * SIZES**1.5)
    assert sizes.tolist() == SIZES[2:].tolist() and fitted == pytest.approx(3.0 * sizes**1.5)
    assert exponent == pytest.approx(1.5) and half == pytest.approx(0, abs=1e-6)
    assert power_law(SIZES, 50.0 + 3.0 * SIZES**1.5)[2] == pytest.approx(1.5, abs=0.01)


def test_sizes_in_any_order_are_the_same():
    order = np.array([3, 0, 5, 1, 4, 2])
    values = np.random.default_rng(0).lognormal(size=6) * SIZES
    first, second = power_law(SIZES, values), power_law(SIZES[order], values[order])
    assert first[2:] == pytest.approx(second[2:]) and np.array_equal(np.sort(first[1]), np.sort(second[1]))


def test_the_interval_holds_the_exponent_nineteen_times_of_twenty():
    rng, held = np.random.default_rng(0), 0
    for _ in range(400):
        _, _, exponent, half = power_law(SIZES, SIZES**0.7 * rng.lognormal(sigma=0.3, size=6))
        held += abs(exponent - 0.7) <= half
    assert 0.92 < held / 400 < 0.98


def test_too_few_sizes_are_refused():
    with pytest.raises(ValueError, match="expected 4 or more, all positive"):
        power_law(SIZES[:3], SIZES[:3] * 1.0)
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="expected"):
            power_law(SIZES, np.append(SIZES[:5] * 1.0, bad))


def curves(**changes):
    """Rows as scale_study writes them: everything takes a second, or what `changes` says, and a megabyte."""
    what = ("training", "splitting pass", "merging pass", "teacher, 1000 states", "cells, 1000 states")
    rows = [{"what": name, "over": "dimensions", "size": d} for name in what for d in (2, 4, 8, 17)]
    rows += [{"what": name, "over": "steps", "size": n} for name in what[:3] for n in (10, 100, 1000)]
    rows += [{"what": "physics, 1000 steps", "over": "copies", "size": 50}]
    rows += [{"what": name, "over": "workers", "size": n} for name in ("processes", "Dask workers") for n in (1, 2)]
    frame = pd.DataFrame(rows).assign(seconds=1.0, megabytes=1.0)
    for name, value in changes.items():
        frame.loc[frame["what"].str.startswith(name), "seconds"] = value
    return frame


def test_exponents_are_of_what_has_sizes_enough():
    frame = exponents(curves())
    assert len(frame) == 10 and set(frame["quantity"]) == {"seconds", "megabytes"}
    assert frame["exponent"].to_numpy() == pytest.approx(0) and set(frame["over"]) == {"dimensions"}


def test_a_cost_by_hand():
    config = preset("SimpleGoal-v0")
    task = Environment("toy", 3, 1, 100, True)
    frame = cost(curves(teacher=2.0, physics=3.0, training=0.5, cells=7.0), n_runs=36, tasks=[task])
    (row,) = frame.to_dict("records")
    passes = 0.5 + 1 / config.n_split + 1 / config.n_merge
    assert row["teacher"] == pytest.approx(config.n_epochs * 0.1 * 2.0 / 100)
    assert row["physics"] == pytest.approx(config.n_epochs * 0.1 * 3.0 / 100)
    assert row["distillation"] == pytest.approx(config.n_epochs * passes / 100)
    assert row["evaluation"] == pytest.approx(2 * 100 * (3.0 + 7.0) / 100)
    parts = ("teacher", "physics", "distillation", "evaluation")
    assert row["all"] == pytest.approx(sum(row[part] for part in parts))
    numbers = 3000 + config.n_epochs + scaling.N_CELLS * (3 + 4)
    assert row["MB on disk"] == pytest.approx(36 * numbers * 8e-6)


def test_without_an_engine_a_step_is_free_and_dimensions_are_interpolated():
    frame = curves(physics=1e9)
    frame.loc[(frame["what"] == "training") & (frame["over"] == "dimensions"), "seconds"] = frame["size"] * 1.0
    task = Environment("toy", 6, 1, 100, False)
    row = cost(frame, n_runs=1, tasks=[task]).iloc[0]
    config = preset("SimpleGoal-v0")
    assert row["physics"] == 0 and row["all"] < 1e3
    assert row["distillation"] * 3600 == pytest.approx(config.n_epochs * (6 + 1 / config.n_split + 1 / config.n_merge))


def test_a_longer_episode_costs_what_its_steps_do():
    frame = curves()
    frame.loc[(frame["what"] == "splitting pass") & (frame["over"] == "steps"), "seconds"] = frame["size"] / 50.0
    config = preset("SimpleGoal-v0")
    for steps, times in ((100, 1), (1000, 10), (250, 2.5)):
        row = cost(frame, n_runs=1, tasks=[Environment("toy", 4, 1, steps, False)]).iloc[0]
        expected = config.n_epochs * (1 + times / config.n_split + 1 / config.n_merge)
        assert row["distillation"] * 3600 == pytest.approx(expected)


def test_memory_is_the_bound_of_the_buffers_by_hand():
    config = preset("SimpleGoal-v0")
    row = cost(curves(), tasks=[Environment("toy", 3, 1, 100, False)]).iloc[0]
    rows = config.n_reset * 100
    expected = rows * 16 * 5 + rows * 8 * scaling.N_CELLS + 500 * 100 * 8 * 4 + 40 * config.n_epochs
    expected += (500 + 250 + 50) * (2000 + 8 * scaling.N_CELLS * (3 + 4))  # 5000 iterations, passes every 20 and 100
    assert row["MB in memory"] == pytest.approx(expected / 1e6)


@pytest.mark.parametrize(("d", "steps"), [(1, 100), (18, 100), (4, 5), (4, 2000)])
def test_a_task_outside_what_was_measured_is_refused(d, steps):
    with pytest.raises(ValueError, match="(dimensions|steps) are .*, as was measured"):
        cost(curves(), tasks=[Environment("toy", d, 1, steps, False)])


def test_the_cost_of_a_run_is_near_what_a_run_took():
    """The made-up teacher's run has fewer cells than `N_CELLS`, and its time is measured in another way."""
    frame = study.read("scale")
    taken = frame[frame["what"] == "distillation"].dropna(subset=["seconds"]).sort_values("size")
    seconds = np.interp(preset("SimpleGoal-v0").n_epochs, taken["size"], taken["seconds"])
    row = cost(frame, n_runs=1, tasks=scaling.TEN_TASKS[:1]).iloc[0]
    assert 1 / 3 < row["distillation"] * 3600 / seconds < 3


def test_memory_at_most_is_more_than_a_run_took():
    """Of the made-up teacher, which has no network."""
    frame = study.read("scale")
    taken = frame[frame["what"] == "distillation"].dropna(subset=["megabytes"]).sort_values("size")
    megabytes = np.interp(preset("SimpleGoal-v0").n_epochs, taken["size"], taken["megabytes"])
    assert megabytes < cost(frame, tasks=scaling.TEN_TASKS[:1])["MB in memory"].iloc[0] < 5 * megabytes


@pytest.mark.parametrize(("changes", "what"), [({"n_runs": -3}, "n_runs"), ({"n_runs": 1.5}, "n_runs"),
                                               ({"tasks": [Environment("toy", 3, -50, 100, False)]}, "m")])  # fmt: skip
def test_what_is_no_count_is_refused(changes, what):
    with pytest.raises(ValueError, match=f"^{what} is .*, expected an integer from 1 on"):
        cost(curves(), **changes)


def test_workers_have_no_exponent():
    frame = pd.concat(
        [curves(), pd.DataFrame({"what": "processes", "over": "workers", "size": [4, 8, 16], "seconds": 1.0})]
    )
    assert "workers" not in set(exponents(frame)["over"])


def test_ten_tasks_are_ten_within_the_measured_dimensions():
    assert len({task.name for task in scaling.TEN_TASKS}) == 10
    assert {task.d for task in scaling.TEN_TASKS} <= set(range(2, 18))


def test_what_a_second_worker_adds_by_hand():
    frame = curves()
    frame.loc[(frame["what"] == "Dask workers") & (frame["size"] == 2), "seconds"] = 1 / 1.75
    assert scaling.second_worker(frame) == pytest.approx(0.75)
    assert scaling.second_worker(frame, "processes") == 0


def test_exponents_in_words():
    text = scaling.in_words(curves())
    assert text.startswith("with these exponents: over dimensions ") and "0.0 for training" in text and text[-1] == "."


def test_a_part_of_the_measured_figures_is_one_table():
    frame = pd.DataFrame(
        {"table": ["a", "b", "a"], "what": [1, 2, 3], "to hold": "x", "measured": "y", "held": "yes", "machine": "m"}
    )
    assert scaling.part(frame, "a")["what"].tolist() == [1, 3]
    assert list(scaling.part(frame, "a")) == ["what", "to hold", "measured", "held"]
