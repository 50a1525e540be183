import dataclasses
import shutil
from collections import Counter

import numpy as np
import pandas as pd
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, WALKER

from studies import make_rows
from studies.comparison import kept, kept_robots, measure, method_rows
from studies.comparison.method_rows import Job, jobs_of, make_all, make_row, rows, tables_of
from studies.comparison.method_summary import read_rows
from studies.comparison.method_tables import ABLATION, LIKE, METHODS, ROBOTS, TABLES, TASKS, TUNED_SIZES, UNTUNED, Table
from studies.comparison.methods import Budget
from studies.robots import Walking
from vsp.evaluation import start_states
from vsp.paper import printed
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout
from vsp.run import atomic, listed, sealed
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import load_teacher
from vsp_beyond.few_cells.config import Faithful, Tuned, faithful_preset, tuned_preset

SMALL = Tuned(
    n_cells=2, n_episodes=20, n_restarts=2, n_steps=100, batch_size=64, n_corrections=2, n_correction_episodes=10,
    n_generations=1, n_tuning_episodes=10, n_validation=20,
)  # fmt: skip


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(measure, "N_REPORTED", 30)
    monkeypatch.setattr(measure, "N_ERROR", 10)
    monkeypatch.setattr(method_rows, "tuned_preset", lambda task: SMALL)
    two = {"CART": dataclasses.replace(METHODS["CART"], sizes=(1, 3)), "teacher": METHODS["teacher"]}
    monkeypatch.setattr(method_rows, "METHODS", two)
    for module in (method_rows, make_rows):
        monkeypatch.setattr(module, "TABLES", {"methods": Table(two, seeds=range(2), fewer=range(2))})
    monkeypatch.setattr(method_rows, "ABLATION", {})
    return monkeypatch


def name_of(job):
    """All that its file is called."""
    return tuple(job.about().values())


# What is compared


@pytest.mark.parametrize("task", TASKS)
def test_every_method_is_there_at_every_size_with_twenty_seeds(task):
    found = jobs_of(task)
    assert len(set(found)) == len(found) == len({name_of(job) for job in found})
    for name, method in METHODS.items():
        own = {(job.size, job.seed) for job in found if job.method == name}
        seeds, wanted = range(20 if method.chance else 1), method.tasks is None or task in method.tasks
        assert own == ({(size, seed) for size in method.sizes for seed in seeds} if wanted else set())
        assert method.sizes in ((1, 2, 3, 4, 8, 13, 32), (2, 4, 8, 32), (3, 4), (13,), (0,))
    for part in ABLATION:
        own = {(job.size, job.seed) for job in found if job.method == f"refined, {part}"}
        assert {(tuned_preset(task).n_cells, seed) for seed in range(20)} <= own


@pytest.mark.parametrize("task", TASKS)
def test_every_rival_is_tuned_at_every_size_and_untuned_too(task):
    found = jobs_of(task, "tuned")
    for name in UNTUNED:
        sizes = {(job.size, job.seed) for job in found if job.method == f"{name}, tuned"}
        seeds, own = TABLES["tuned"].seeds, (0,) if name == "one linear map" else TUNED_SIZES
        assert sizes == {(size, seed) for size in own for seed in seeds}
        assert name in METHODS or any(job.method == name for job in found)
    assert not {job.method for job in found} & {job.method for job in jobs_of(task)}


@pytest.mark.parametrize("task", TASKS)
def test_other_teachers_are_distilled_at_the_size_of_the_preset(task):
    found = jobs_of(task, "teachers")
    assert {job.agent for job in found} == {1, 2} and len({name_of(job) for job in found}) == len(found)
    sizes = {(job.method, job.size) for job in found}
    assert {("faithful", faithful_preset(task).n_cells), ("refined", tuned_preset(task).n_cells)} <= sizes
    assert len(sizes) == 5 and ("one linear map, tuned", 0) in sizes


def test_a_file_names_its_teacher_by_checksum():
    one, other = (Job(SIMPLEGOAL, "CART", 3, 0, agent) for agent in (0, 1))
    assert one.about().keys() == {"task", "method", "size", "seed", "settings", "teacher", "version"}
    assert one.about() | {"teacher": ""} == other.about() | {"teacher": ""} and one.path("") != other.path("")


def test_all_seeds_are_those_of_the_size_of_the_preset():
    found = jobs_of(SIMPLEGOAL, "faithful")
    n = {size: sum(job.size == size for job in found) for size in {job.size for job in found}}
    own = faithful_preset(SIMPLEGOAL).n_cells
    assert n[own] == len(TABLES["faithful"].seeds) > n[own - 1] == len(TABLES["faithful"].fewer)


def test_a_table_differs_by_task_where_rows_take_long():
    n = {task: Counter(job.size for job in jobs_of(task, "limit")) for task in TASKS}
    assert n[SIMPLEGOAL] == {4: 20, 1: 3, 2: 3, 3: 3, 8: 3, 12: 3}
    assert n[MOUNTAINCAR] == {3: 5, 4: 3} and n[PENDULUM] == {8: 10, 12: 3}
    assert [task for task in TASKS if "starts" in tables_of(task)] == [MOUNTAINCAR]
    assert len(jobs_of(MOUNTAINCAR, "starts")) == 6


def test_of_tasks_that_take_long_fewer_rows_are_asked_and_their_tail():
    found = {table: jobs_of(LUNARLANDER, table) for table in tables_of(LUNARLANDER)}
    assert list(found) == ["methods", "tuned", "faithful", "limit"]
    assert {job.size for table in ("tuned", "faithful") for job in found[table]} == {0, 1, 2, 4, 8}
    assert {table: {job.tail for job in jobs} for table, jobs in found.items()} == {
        "methods": {False}, "tuned": {True}, "faithful": {True}, "limit": {False}
    }  # fmt: skip
    n_seeds = {table: len({job.seed for job in jobs}) for table, jobs in found.items()}
    assert n_seeds == {"methods": 5, "tuned": 3, "faithful": 10, "limit": 2}
    assert sum(job.size == faithful_preset(LUNARLANDER).n_cells for job in found["faithful"]) == 10


def test_a_row_with_its_tail_is_another_row(small):
    plain, tailed = (Job(SIMPLEGOAL, "CART", 3, 1, tail=tail) for tail in (False, True))
    assert plain.path("") != tailed.path("") and plain.provenance["teacher"] == tailed.provenance["teacher"]
    row = make_row(tailed)[1]["row"]
    assert row.pop("worst") <= row["mean"] and row == make_row(plain)[1]["row"]


def test_at_the_limit_a_slow_task_is_played_from_all_report_starts(small):
    slow = dataclasses.replace(get_task(SIMPLEGOAL), slowness=10)
    small.setattr(method_rows, "get_task", lambda name: slow)
    policy, played = VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task=SIMPLEGOAL), []
    small.setattr(measure, "rollout", lambda *given: played.append(len(given[2])) or rollout(*given))
    for name, whole in (("at the limit", True), ("CART", False)):
        job = Job(SIMPLEGOAL, name, 3, 0)
        assert job.whole == whole
        measure.measure(policy, policy, slow, whole=job.whole)
    assert played == [measure.N_REPORTED, measure.N_REPORTED // 10]
    assert measure.settings(whole=True) == measure.settings() | {"whole": True}


def test_a_tuned_row_depends_on_the_settings_of_the_tuning(small):
    jobs = [Job(SIMPLEGOAL, name, 3, 0) for name in ("CART, DAgger", "CART, DAgger, tuned", "refined")]
    small.setattr(method_rows, "METHODS", METHODS)
    before = [job.provenance for job in jobs]
    small.setattr(method_rows, "tuned_preset", lambda task: dataclasses.replace(SMALL, tuning_step=0.2))
    assert [job.provenance == known for job, known in zip(jobs, before)] == [True, False, False]


def test_methods_that_know_one_task_are_not_asked_about_others():
    own = {task: {job.method for job in jobs_of(task)} for task in TASKS}
    assert all(("the paper's method" in own[task]) == (task in printed.TASKS) for task in TASKS)
    assert [task for task in TASKS if "TD-AVQ" in own[task]] == [SIMPLEGOAL]
    assert [task for task in TASKS if "heuristic" in own[task]] == [PENDULUM]
    assert METHODS["heuristic"].tasks == (PENDULUM, LUNARLANDER)


# Rows


def test_a_row_holds_what_is_measured(small):
    job = Job(SIMPLEGOAL, "CART", 3, 1)
    _, about = make_row(job)
    teacher, task = load_teacher(SIMPLEGOAL), get_task(SIMPLEGOAL)
    policy = METHODS["CART"].make(Budget(teacher, task, SMALL), 3, 1)
    assert about["row"] == measure.measure(policy, teacher, task) and about["row"]["cells"] == 3
    assert all(about[name] == value for name, value in job.about().items()) and about["seconds"] > 0


def test_missing_rows_are_made_and_others_are_not(small, tmp_path):
    make_all(tmp_path, jobs_of(SIMPLEGOAL))
    frame, seconds = rows(tmp_path, jobs_of(SIMPLEGOAL))
    assert len(frame) == 2 * 2 + 1 == len(seconds) and frame["method"].tolist() == ["CART"] * 4 + ["teacher"]
    assert frame[["settings", "teacher", "version"]].to_dict("records") == [j.provenance for j in jobs_of(SIMPLEGOAL)]
    assert (seconds["task"] == SIMPLEGOAL).all()
    made, original = [], make_row
    small.setattr(method_rows, "make_row", lambda job: (made.append(job), original(job))[1])
    jobs_of(SIMPLEGOAL)[2].path(tmp_path).unlink()
    make_all(tmp_path, jobs_of(SIMPLEGOAL))
    assert made == [jobs_of(SIMPLEGOAL)[2]] and rows(tmp_path, jobs_of(SIMPLEGOAL))[0].equals(frame)


@pytest.mark.parametrize(
    ("of", "why"),
    [(Job(SIMPLEGOAL, "CART", 1, 0), "size 1, expected 3"), (Job(SIMPLEGOAL, "CART", 3, 1), "seed 1, expected 0"),
     (Job(SIMPLEGOAL, "teacher", 0, 0), "method 'teacher', expected 'CART'")],
)  # fmt: skip
def test_a_file_of_another_row_is_refused(small, tmp_path, of, why):
    make_all(tmp_path, jobs_of(SIMPLEGOAL))
    path = Job(SIMPLEGOAL, "CART", 3, 0).path(tmp_path)
    shutil.copy(of.path(tmp_path), path)
    with pytest.raises(atomic.DamagedFile, match=f"{path.name}: made with {why}: delete it"):
        rows(tmp_path, jobs_of(SIMPLEGOAL))


def test_other_settings_and_other_versions_are_other_rows(small):
    job = Job(SIMPLEGOAL, "CART", 3, 1)
    one = name_of(job)
    others = [dataclasses.replace(job, **change) for change in ({"method": "teacher"}, {"size": 2}, {"seed": 0})]
    assert len({one, *map(name_of, others)}) == 4
    for change in ({"settings": {"depth": 3}}, {"version": 2}):
        small.setattr(method_rows, "METHODS", {"CART": dataclasses.replace(METHODS["CART"], **change)})
        assert name_of(job) != one
    small.setattr(method_rows, "METHODS", METHODS)
    assert name_of(job) == one
    small.setattr(measure, "VERSION", 2)
    assert name_of(job) != one


def test_a_row_depends_on_the_settings_that_its_method_reads(small):
    jobs = [Job(SIMPLEGOAL, name, size, 0) for name, size in (("CART", 3), ("refined", 3), ("teacher", 0))]
    small.setattr(method_rows, "METHODS", METHODS)
    before = [job.provenance for job in jobs]
    for change, equal in (({"n_steps": 99}, [True, False, True]), ({"n_episodes": 99}, [False, False, True])):
        small.setattr(method_rows, "tuned_preset", lambda task, change=change: dataclasses.replace(SMALL, **change))
        assert [job.provenance == known for job, known in zip(jobs, before)] == equal


def test_an_ablated_row_is_that_of_the_changed_settings(monkeypatch):
    job, whole = Job(SIMPLEGOAL, "refined, no leak", 3, 0), Job(SIMPLEGOAL, "refined", 3, 0)
    assert job.how.settings == ABLATION["no leak"] and job.provenance["settings"] != whole.provenance["settings"]
    monkeypatch.setitem(METHODS, "refined", dataclasses.replace(METHODS["refined"], version=5))
    assert job.provenance["version"] == whole.provenance["version"] == 5


def test_the_command_writes_results_and_times_apart(small, tmp_path):
    small.setattr(make_rows, "TASKS", (SIMPLEGOAL,))
    small.setattr(make_rows, "optimum", lambda: pd.DataFrame({"seconds": [0.5]}))
    small.setattr("sys.argv", ["x", "--out", str(tmp_path), "--jobs", "1"])
    make_rows.main()
    results = tmp_path / "data" / "beyond"
    frame = read_rows(SIMPLEGOAL, results)
    assert len(frame) == 5 and "seconds" not in frame
    assert len(pd.read_csv(results / "methods_seconds.csv")) == 5
    assert (results / "optimum.csv").read_text() == "seconds\n0.500000\n"
    listed.write_listed(results / "methods_Pendulum-v1.csv", frame.assign(failing=1.0).to_csv(index=False))
    assert read_rows("Pendulum-v1", results)["failing"].isna().all()


def test_of_faithful_rows_the_policies_are_kept_and_compared(small, tmp_path):
    quick = Faithful(
        n_cells=2, tolerance=0.1, n_episodes=50, n_restarts=2, n_generations=1, n_tuning_episodes=5, n_validation=20
    )
    like = {"faithful": dataclasses.replace(LIKE["faithful"], sizes=(1, 2))}
    small.setattr(method_rows, "faithful_preset", lambda task: quick)
    small.setattr(make_rows, "TASKS", (SIMPLEGOAL,))
    for module in (method_rows, make_rows):
        small.setattr(module, "TABLES", {"faithful": Table(like, seeds=range(2), fewer=range(2))})
    small.setattr("sys.argv", ["x", "--out", str(tmp_path), "--jobs", "1", "--tables", "faithful"])
    make_rows.main()
    found, same = (pd.read_csv(tmp_path / f"data/beyond/{name}_SimpleGoal-v0.csv") for name in ("faithful", "same"))
    assert found["size"].tolist() == [1, 1, 2, 2] and found["r2"].between(-1, 1).all() and (found["cells"] <= 2).all()
    assert same[["size", "seed", "other"]].to_numpy().tolist() == [[1, 0, 1], [2, 0, 1]]
    assert np.isnan(same["index"][0]) and (same["ratio"] < 2).all()
    kept = VoronoiPolicy.load(tmp_path / "data/beyond/faithful_SimpleGoal-v0.policy")
    first = found[(found["size"] == 2) & (found["seed"] == 0)].iloc[0]
    starts = start_states(get_task(SIMPLEGOAL), measure.N_REPORTED, measure.REPORT_SEED)
    assert rollout(kept, SIMPLEGOAL, starts).returns.mean() == pytest.approx(first["mean"], abs=1e-6)


def test_the_long_command_keeps_a_simplified_policy(small, tmp_path):
    for module in (method_rows, make_rows):
        small.setattr(module, "LONG", (SIMPLEGOAL,))
        small.setattr(module, "WALKERS", ())
    small.setattr(method_rows, "LONG_TABLES", method_rows.TABLES)
    small.setattr("sys.argv", ["x", "--long", "--out", str(tmp_path), "--jobs", "1"])
    make_rows.main()
    results = tmp_path / "data" / "beyond"
    policy = VoronoiPolicy.load(results / "methods_SimpleGoal-v0.policy")
    _, about = sealed.load_arrays(results / "methods_SimpleGoal-v0.policy", kind="VoronoiPolicy")
    assert 1 <= len(policy) <= SMALL.n_cells and about.items() >= kept.simplest_provenance(SIMPLEGOAL).items()
    assert len(pd.read_csv(results / "methods_seconds_long.csv")) == 5
    assert not (results / "optimum.csv").exists()
    listed.read_listed(results / "methods_SimpleGoal-v0.policy")  # not as a policy: as what `sha256sum -c` sees


def test_of_a_robot_a_policy_and_its_gait_are_kept(small, tmp_path):
    robots = {"cells": dataclasses.replace(ROBOTS["cells"], sizes=(2,)), "robot's teacher": ROBOTS["robot's teacher"]}
    walking = Walking(n_cells=2, n_episodes=1, n_corrections=0, n_states=300, n_restarts=1, n_validation=1)
    small.setattr(method_rows, "walking_preset", lambda task: walking)
    small.setattr(method_rows, "ROBOTS", robots)
    for module in (method_rows, make_rows):
        small.setattr(module, "LONG", ())
        small.setattr(module, "WALKERS", (WALKER,))
        small.setattr(module, "ROBOT_TABLES", {"robots": Table(robots, seeds=range(1))})
    small.setitem(kept.KEPT, "robots", "cells")
    small.setattr(measure, "N_ERROR", 20)
    small.setitem(kept_robots.GAIT, "n_steps", 20)
    small.setattr(kept_robots, "fewest", lambda policy: pd.DataFrame({"cells": [len(policy)]}))
    small.setattr("sys.argv", ["x", "--long", "--out", str(tmp_path), "--jobs", "1"])
    make_rows.main()
    found = {name: pd.read_csv(tmp_path / f"data/beyond/{name}_{WALKER}.csv") for name in ("robots", "gait", "fewest")}
    assert found["robots"]["method"].tolist() == list(robots) and found["robots"]["r2"][1] == 1
    assert len(found["gait"]) == 20 and found["fewest"]["cells"].tolist() == [2]
    policy = VoronoiPolicy.load(tmp_path / f"data/beyond/robots_{WALKER}.policy")
    assert policy.task.name == WALKER and len(pd.read_csv(tmp_path / "data/beyond/robots_seconds_long.csv")) == 2


def test_the_simplified_policy_may_lose_its_share(small):
    asked = []
    small.setattr(kept, "simplify", lambda *given, **settings: asked.append((given, settings)) or ("policy", None))
    assert kept.simplest(SIMPLEGOAL) == "policy"
    ((teacher, task, config), settings) = asked[0]
    starts = start_states(get_task(SIMPLEGOAL), SMALL.n_validation, 0)
    own = rollout(teacher, get_task(SIMPLEGOAL), starts).returns.mean()
    assert (task, config, settings) == (SIMPLEGOAL, SMALL, {"tolerance": pytest.approx(0.02 * own), "seed": 0})
