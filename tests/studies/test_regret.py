import numpy as np
import pandas as pd
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS

from studies.comparison import all_rows, best_mean, regret, with_regret
from studies.results import read_results
from vsp.evaluation import start_states
from vsp.tasks.registry import get_task


def test_the_best_returns_are_those_of_the_best_policies(monkeypatch):
    """SimpleGoal's in closed form, others as played from coarse grids; of a task without a goal nothing fails."""
    monkeypatch.setattr(regret, "N_REPORTED", 40)
    monkeypatch.setattr(regret, "WAYS", ((SIMPLEGOAL, 1.0), (PENDULUM, 0.2), (PENDULUM, 0.4)))
    frame = regret.optimum()
    assert frame["found"].tolist() == [regret.CLOSED, "72 × 73 points", "144 × 145 points"]
    starts = start_states(get_task(SIMPLEGOAL), 40, regret.REPORT_SEED)
    assert frame["mean"][0] == pytest.approx(np.maximum(10, 10 * np.hypot(*starts.T) + 9).mean(), abs=1e-12)
    assert frame["failing"][0] == 0 and frame["failing"][1:].isna().all()
    assert frame["mean"][1] <= frame["mean"][2] < 0 and (frame["longest"] <= [50, 200, 200]).all()


def test_two_grids_differ_by_less_than_teachers_and_the_best():
    """So the grids are fine enough: their error is small beside what is to be gained."""
    frame = read_results("optimum")
    assert frame["task"].tolist() == [SIMPLEGOAL, *[MOUNTAINCAR] * 2, *[PENDULUM] * 2]
    assert frame["failing"].dropna().eq(0).all()
    for task in (MOUNTAINCAR, PENDULUM):
        coarse, fine = frame.loc[frame["task"] == task, "mean"]
        rows = all_rows(task)
        own = rows.loc[rows["method"] == "teacher", "mean"].iloc[0]
        assert 0 <= fine - coarse < 0.05 * (fine - own)
        assert best_mean(task) == fine


@pytest.mark.parametrize("task", (*TASKS, PENDULUM))
def test_nothing_returns_more_than_the_best(task):
    assert (with_regret(all_rows(task), task)["regret"] > 0).all()


def test_of_a_task_without_an_optimum_the_regret_is_not_known():
    table = with_regret(pd.DataFrame({"mean": [1.0, 2.0]}), LUNARLANDER)
    assert table["regret"].tolist() == ["not known"] * 2
    known = with_regret(pd.DataFrame({"mean": [1.0]}), SIMPLEGOAL)
    assert known["regret"][0] == best_mean(SIMPLEGOAL) - 1.0
