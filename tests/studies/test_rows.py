import dataclasses
import shutil
from collections import Counter

import numpy as np
import pandas as pd
import pytest
from small import SMALL
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, WALKER, Constant, called

from studies import make_rows
from studies.committed import RESULTS, keys, read_results
from studies.comparison import beside, measure, read_rows, rows
from studies.comparison.methods import METHODS, PRESETS, TABLES, TASKS, Entry, Table
from studies.comparison.rows import Row, jobs_of, make_all
from studies.robots import Walking
from vsp import VoronoiPolicy, get_task, load_teacher, rollout, start_states
from vsp_beyond import Faithful

CART, CART_3 = Row(SIMPLEGOAL, "CART", 1, 0), Row(SIMPLEGOAL, "CART", 3, 1)


@pytest.fixture
def small(monkeypatch):
    """SimpleGoal has a table of two methods, with small settings and few starts."""
    monkeypatch.setattr(measure, "N_REPORTED", 30)
    monkeypatch.setattr(measure, "N_ERROR", 10)
    monkeypatch.setitem(PRESETS, "tuned", lambda task: SMALL)
    only(monkeypatch, SIMPLEGOAL, "methods", Table(range(2), methods=("CART", "teacher"), sizes=(0, 1, 3)))
    return monkeypatch


def only(patch, task, name, table):
    """Leave one table of one task."""
    patch.setattr(make_rows, "TABLES", {task: {name: table}})
    patch.setitem(TABLES, task, {name: table})


def command(*arguments):
    called(make_rows.main, *arguments, "--jobs", 1)


# What is compared


def test_a_table_differs_by_task_where_rows_take_long():
    n = {task: Counter(job.size for job in jobs_of(task, "limit")) for task in TASKS}
    assert n[SIMPLEGOAL] == {4: 20, 1: 3, 2: 3, 3: 3, 8: 3, 12: 3}
    assert n[MOUNTAINCAR] == {3: 5, 4: 3} and n[PENDULUM] == {8: 10, 12: 3}
    assert len(jobs_of(MOUNTAINCAR, "starts")) == 6
    lander = {table: jobs_of(LUNARLANDER, table) for table in TABLES[LUNARLANDER]}
    assert {table: len({job.seed for job in jobs}) for table, jobs in lander.items()} == {
        "methods": 5, "tuned": 3, "faithful": 10, "limit": 2
    }  # fmt: skip
    assert {job.size for table in ("tuned", "faithful") for job in lander[table]} == {0, 1, 2, 4, 8}


# What identifies a row


def test_other_arguments_settings_teachers_and_versions_are_other_rows(small):
    job, know = CART_3, lambda: tuple(job.about().values())
    known = know()
    changes = ({"method": "teacher"}, {"size": 2}, {"seed": 0}, {"agent": 1})
    others = [dataclasses.replace(job, **change) for change in changes]
    assert len({known, *(tuple(other.about().values()) for other in others)}) == 5
    assert job.path("") != others[3].path("")
    for change in ({"settings": {"depth": 3}}, {"version": 2}):
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(METHODS, "CART", dataclasses.replace(METHODS["CART"], **change))
            assert know() != known
    small.setattr(measure, "VERSION", 2)
    assert know() != known


def test_a_row_depends_on_the_settings_that_its_method_reads(small):
    names = ("CART", "CART, DAgger, tuned", "our cells, tuned", "our cells, one restart", "teacher")
    jobs = [Row(SIMPLEGOAL, name, 3, 0) for name in names]
    before = [job.provenance for job in jobs]
    assert before[2]["settings"] != before[3]["settings"]
    for change, changed in (
        ({"n_steps": 99}, [False, False, True, True, False]),
        ({"tuning_step": 0.2}, [False, True, True, True, False]),
        ({"n_episodes": 99}, [True, True, True, True, False]),
    ):
        small.setitem(PRESETS, "tuned", lambda task, change=change: dataclasses.replace(SMALL, **change))
        assert [job.provenance != known for job, known in zip(jobs, before)] == changed


def test_at_the_limit_a_slow_task_is_played_from_all_report_starts(small):
    slow = dataclasses.replace(get_task(SIMPLEGOAL), slowness=10)
    small.setattr(rows, "get_task", lambda name: slow)
    policy, played = VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task=SIMPLEGOAL), []
    small.setattr(measure, "rollout", lambda *given: played.append(len(given[2])) or rollout(*given))
    for name, seed in (("at the limit", measure.LIMIT_SEED), ("CART", measure.REPORT_SEED)):
        job = Row(SIMPLEGOAL, name, 3, 0)
        assert job.start_seed == seed
        measure.measure(policy, policy, slow, seed)
    assert played == [measure.N_REPORTED, measure.N_REPORTED // 10]


# Rows


def test_a_row_holds_what_is_measured(small):
    _, about = CART_3.make()
    teacher, task = load_teacher(SIMPLEGOAL), get_task(SIMPLEGOAL)
    policy = METHODS["CART"].make(teacher, task, dataclasses.replace(SMALL, n_cells=3), 1)
    assert about["row"] == measure.measure(policy, teacher, task) and about["row"]["cells"] == 3
    assert {*about} == {"row", "seconds"} and about["seconds"] > 0


def test_missing_rows_are_made_and_others_are_not(small, tmp_path):
    jobs, made = jobs_of(SIMPLEGOAL), []
    make_all(tmp_path, jobs)
    found = [job.row(tmp_path) for job in jobs]
    assert [row["method"] for row in found] == ["CART"] * 4 + ["teacher"] and found[0]["task"] == SIMPLEGOAL
    for row, job in zip(found, jobs, strict=True):
        assert {name: row[name] for name in ("settings", "teacher", "version")} == job.provenance
    watch(small, made)
    jobs[2].path(tmp_path).unlink()
    make_all(tmp_path, jobs)
    again = [job.row(tmp_path) | {"seconds": row["seconds"]} for job, row in zip(jobs, found)]
    assert made == [jobs[2]] and again == found


def watch(patch, made):
    """Note in `made` which rows are made."""
    make = Row.make
    patch.setattr(Row, "make", lambda job: (made.append(job), make(job))[1])


# Whole commands


def test_of_one_more_method_just_its_rows_are_made(small, tmp_path):
    """Rows of other methods are read from the committed tables, and written as they were."""
    made, results = [], tmp_path / "data" / "beyond"
    for where in ("studies.committed", "studies.comparison.beside"):
        small.setattr(f"{where}.RESULTS", results)
    watch(small, made)
    command("--out", tmp_path)
    files = [results / "methods_SimpleGoal-v0.csv", results / "methods_seconds.csv"]
    before = [file.read_text() for file in files]
    assert "seconds" not in before[0] and len(read_rows(SIMPLEGOAL, results)) == 5 == before[1].count("\n") - 1
    shutil.rmtree(tmp_path / "build")
    still = Entry(lambda teacher, task, config, seed: Constant(0.5, 0.5), sizes=(1, 3))
    small.setitem(METHODS, "still", still)
    only(small, SIMPLEGOAL, "methods", Table(range(2), methods=("CART", "still", "teacher"), sizes=(0, 1, 3)))
    command("--out", tmp_path)
    after = [file.read_text() for file in files]
    assert [job.method for job in made] == [*"CART CART teacher CART CART".split(), *["still"] * 4]
    assert ["".join(line for line in text.splitlines(True) if "still" not in line) for text in after] == before
    assert [text.count("still") for text in after] == [4, 4]
    small.setattr(Row, "make", None)  # nothing is left to do
    command("--out", tmp_path / "elsewhere")
    assert [(tmp_path / "elsewhere" / file.relative_to(tmp_path)).read_text() for file in files] == after


def test_of_faithful_rows_the_policies_are_kept_and_compared(small, tmp_path):
    quick = Faithful(
        n_cells=2, tolerance=0.1, n_episodes=50, n_restarts=2, n_generations=1, n_tuning_episodes=5, n_validation=20
    )
    small.setitem(PRESETS, "faithful", lambda task: quick)
    only(small, SIMPLEGOAL, "faithful", Table(range(2), sizes=(1, 2), keeps="faithful"))
    command("--out", tmp_path)
    frame, same = (pd.read_csv(tmp_path / f"data/beyond/{name}_SimpleGoal-v0.csv") for name in ("faithful", "same"))
    assert frame["size"].tolist() == [1, 1, 2, 2] and frame["r2"].between(-1, 1).all() and (frame["cells"] <= 2).all()
    assert same[["size", "seed", "other"]].to_numpy().tolist() == [[1, 0, 1], [2, 0, 1]]
    assert np.isnan(same["index"][0]) and (same["ratio"] < 2).all()
    kept = VoronoiPolicy.load(tmp_path / "data/beyond/faithful_SimpleGoal-v0.policy")
    first = frame[(frame["size"] == 2) & (frame["seed"] == 0)].iloc[0]
    starts = start_states(get_task(SIMPLEGOAL), measure.N_REPORTED, measure.REPORT_SEED)
    assert rollout(kept, SIMPLEGOAL, starts).returns.mean() == pytest.approx(first["mean"], abs=1e-6)


def test_of_a_robot_a_policy_and_its_gait_are_kept(small, tmp_path):
    walking = Walking(n_cells=2, n_episodes=1, n_corrections=0, n_states=300, n_restarts=1, n_validation=1)
    small.setitem(PRESETS, "walking", lambda task: walking)
    small.setattr(measure, "N_ERROR", 20)  # the walker is slow: a twentieth of them
    small.setattr(beside, "CHEETAH", WALKER)
    gait = pd.DataFrame({"step": range(3)})
    small.setattr(beside, "record_gait", lambda policy, task, **how: gait.assign(cells=len(policy)))
    only(small, WALKER, "robots", Table(range(1), methods=("cells", "robot's teacher"), sizes=(0, 2), keeps="cells"))
    command("--long", "--out", tmp_path)
    made = {name: pd.read_csv(tmp_path / f"data/beyond/{name}_{WALKER}.csv") for name in ("robots", "gait")}
    assert made["robots"]["method"].tolist() == ["cells", "robot's teacher"] and made["robots"]["r2"][1] == 1
    assert made["gait"]["cells"].tolist() == [2] * 3 and made["gait"]["version"].tolist() == [beside.GAIT_VERSION] * 3
    assert VoronoiPolicy.load(tmp_path / f"data/beyond/robots_{WALKER}.policy").task.name == WALKER


def test_kept_policies_are_the_first_of_the_presets_size_and_of_some_others():
    ((name, job),) = beside.kept_jobs(WALKER, "robots").items()
    assert (name, job.method, job.size, job.seed) == (f"robots_{WALKER}.policy", "cells, trained further", 8, 0)
    for task in (*TASKS, LUNARLANDER):
        assert {*beside.kept_jobs(task, "faithful").values()} <= {*jobs_of(task, "faithful")}


@pytest.mark.parametrize("table", ["faithful", "limit"])
def test_a_kept_policy_acts_as_its_row_says(table):
    """Returns, failures and, of a faithful one, R² on new states of the teacher."""
    rows, task, teacher = read_results(f"{table}_{SIMPLEGOAL}"), get_task(SIMPLEGOAL), load_teacher(SIMPLEGOAL)
    for file, job in beside.kept_jobs(SIMPLEGOAL, table).items():
        policy, row = VoronoiPolicy.load(RESULTS / file), rows[rows["size"] == job.size].iloc[0]  # of seed 0
        played = measure.measure(policy, teacher, task) | measure.fidelity(policy, teacher, task)
        assert all(played[name] == pytest.approx(row[name], abs=1e-5) for name in {*played} & {*row.index})


# The best policies


def test_the_best_returns_are_those_of_the_best_policies(monkeypatch, tmp_path):
    """SimpleGoal's in closed form, others as played from coarse grids; of a task without a goal nothing fails."""
    monkeypatch.setattr(measure, "N_REPORTED", 40)
    monkeypatch.setattr(beside, "WAYS", ((SIMPLEGOAL, 1.0), (PENDULUM, 0.2), (PENDULUM, 0.4)))
    *_, file = beside.beside(SIMPLEGOAL, "limit")
    file.write(tmp_path, tmp_path)
    frame = read_results("optimum", tmp_path / "data" / "beyond")
    assert frame["found"].tolist() == ["closed form", "72 × 73 points", "144 × 145 points"]
    assert keys(frame) == keys(file.today)
    starts = start_states(get_task(SIMPLEGOAL), 40, measure.REPORT_SEED)
    assert frame["mean"][0] == pytest.approx(np.maximum(10, 10 * np.hypot(*starts.T) + 9).mean(), abs=1e-6)
    assert frame["failing"][0] == 0 and frame["failing"][1:].isna().all()
    assert frame["mean"][1] <= frame["mean"][2] < 0 and (frame["longest"] <= [50, 200, 200]).all()
