import dataclasses

import pandas as pd
import pytest
from support import LUNARLANDER, PENDULUM, SIMPLEGOAL

from vsp import beyond, comparison, measure, paper, store
from vsp.beyond import ABLATION, METHODS, Job, jobs_of
from vsp.config import Refinement, preset
from vsp.envs import get_task
from vsp.evaluate import start_states
from vsp.methods import Budget
from vsp.policy import VoronoiPolicy
from vsp.rollouts import play
from vsp.teachers import load_teacher

SMALL = Refinement(
    n_cells=2, n_episodes=20, n_restarts=2, n_steps=100, batch_size=64, n_corrections=2, n_correction_episodes=10,
    n_generations=1, n_tuning_episodes=10, n_validation=20,
)  # fmt: skip


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(beyond, "SEEDS", range(2))
    monkeypatch.setattr(measure, "N_REPORTED", 30)
    monkeypatch.setattr(measure, "N_ERROR", 10)
    monkeypatch.setattr(beyond, "preset", lambda task, kind: SMALL)
    two = {"CART": dataclasses.replace(METHODS["CART"], sizes=(1, 3)), "teacher": METHODS["teacher"]}
    monkeypatch.setattr(beyond, "METHODS", two)
    monkeypatch.setattr(beyond, "ABLATION", {})
    return monkeypatch


# What is compared


@pytest.mark.parametrize("task", beyond.TASKS)
def test_every_method_is_there_at_every_size_with_twenty_seeds(task):
    found = jobs_of(task)
    assert len(set(found)) == len(found) == len({job.key for job in found})
    for name, method in METHODS.items():
        own = {(job.size, job.seed) for job in found if job.method == name}
        seeds, wanted = range(20 if method.chance else 1), method.tasks is None or task in method.tasks
        assert own == ({(size, seed) for size in method.sizes for seed in seeds} if wanted else set())
        assert method.sizes in ((1, 2, 3, 4, 8, 13, 32), (2, 4, 8, 32), (3, 4), (13,), (0,))
    for part in ABLATION:
        own = {(job.size, job.seed) for job in found if job.method == f"refined, {part}"}
        assert {(preset(task, "best").n_cells, seed) for seed in range(20)} <= own


def test_methods_that_know_one_task_are_not_asked_about_others():
    own = {task: {job.method for job in jobs_of(task)} for task in beyond.TASKS}
    assert all(("the paper's method" in own[task]) == (task in paper.TASKS) for task in beyond.TASKS)
    assert [task for task in beyond.TASKS if "TD-AVQ" in own[task]] == [SIMPLEGOAL]
    assert [task for task in beyond.TASKS if "heuristic" in own[task]] == [PENDULUM]
    assert METHODS["heuristic"].tasks == (PENDULUM, LUNARLANDER)


# Rows


def test_a_row_holds_what_is_measured(small):
    job = Job(SIMPLEGOAL, "CART", 3, 1)
    about = beyond.make_row(job)
    teacher, task = load_teacher(SIMPLEGOAL), get_task(SIMPLEGOAL)
    policy = METHODS["CART"].make(Budget(teacher, task, SMALL), 3, 1)
    assert about["row"] == measure.measure(policy, teacher, task) and about["row"]["cells"] == 3
    assert about["job"] == dataclasses.asdict(job) and about["seconds"] > 0


def test_missing_rows_are_made_and_others_are_not(small, tmp_path):
    beyond.make_all(tmp_path, tasks=[SIMPLEGOAL])
    frame, seconds = beyond.rows(tmp_path, SIMPLEGOAL)
    assert len(frame) == 2 * 2 + 1 == len(seconds) and frame["method"].tolist() == ["CART"] * 4 + ["teacher"]
    assert frame["key"].tolist() == [job.key for job in jobs_of(SIMPLEGOAL)] and (seconds["task"] == SIMPLEGOAL).all()
    made, original = [], beyond.make_row
    small.setattr(beyond, "make_row", lambda job: (made.append(job), original(job))[1])
    jobs_of(SIMPLEGOAL)[2].path(tmp_path).unlink()
    beyond.make_all(tmp_path, tasks=[SIMPLEGOAL])
    assert made == [jobs_of(SIMPLEGOAL)[2]] and beyond.rows(tmp_path, SIMPLEGOAL)[0].equals(frame)


def test_other_settings_and_other_code_are_other_rows(small):
    job = Job(SIMPLEGOAL, "CART", 3, 1)
    key = job.key
    others = [dataclasses.replace(job, **change) for change in ({"method": "teacher"}, {"size": 2}, {"seed": 0})]
    assert len({key, *(other.key for other in others)}) == 4
    changed = dataclasses.replace(METHODS["CART"], settings={"fit": None})
    small.setattr(beyond, "METHODS", {"CART": changed})
    assert job.key != key
    small.setattr(beyond, "METHODS", {"CART": dataclasses.replace(METHODS["CART"], code=())})
    assert job.key != key
    small.setattr(beyond, "METHODS", METHODS)
    assert job.key == key


def test_a_row_depends_on_the_settings_that_its_method_reads(small):
    tree, own, teacher = (
        Job(SIMPLEGOAL, name, size, 0) for name, size in (("CART", 3), ("refined", 3), ("teacher", 0))
    )
    small.setattr(beyond, "METHODS", METHODS)
    before = [job.key for job in (tree, own, teacher)]
    small.setattr(beyond, "preset", lambda task, kind: dataclasses.replace(SMALL, n_steps=99))
    assert [job.key == key for job, key in zip((tree, own, teacher), before)] == [True, False, True]
    small.setattr(beyond, "preset", lambda task, kind: dataclasses.replace(SMALL, n_episodes=99))
    assert [job.key == key for job, key in zip((tree, own, teacher), before)] == [False, False, True]


def test_an_ablated_row_is_that_of_the_changed_settings():
    job, whole = Job(SIMPLEGOAL, "refined, no leak", 3, 0), Job(SIMPLEGOAL, "refined", 3, 0)
    assert job.how.settings == ABLATION["no leak"] and job.how.code == whole.how.code and job.key != whole.key


def test_the_command_writes_results_and_times_apart(small, tmp_path):
    small.setattr(beyond, "TASKS", (SIMPLEGOAL,))
    small.setattr(beyond, "race", lambda: pd.DataFrame({"seconds": [0.5]}))
    small.setattr("sys.argv", ["x", "--out", str(tmp_path), "--jobs", "1"])
    small.setattr(beyond, "LONG", ())
    assert beyond.stale(tmp_path / "data" / "results") == [
        "data/results/beyond_SimpleGoal-v0.csv is missing: `make beyond` makes it"
    ]
    beyond.main()
    results = tmp_path / "data" / "results"
    frame = pd.read_csv(results / "beyond_SimpleGoal-v0.csv")
    assert len(frame) == 5 and "seconds" not in frame and beyond.stale(results) == []
    assert comparison.read(SIMPLEGOAL, results).equals(frame)
    store.write_listed(results / "beyond_Pendulum-v1.csv", frame.assign(failing=1.0).to_csv(index=False))
    assert comparison.read("Pendulum-v1", results)["failing"].isna().all()
    assert len(pd.read_csv(results / "beyond_seconds.csv")) == 5
    assert (results / "beyond_race.csv").read_text() == "seconds\n0.500000\n"
    (results / "beyond_Pendulum-v1.csv").write_text("x")
    with pytest.raises(store.DamagedFile, match="`make beyond` makes it anew"):
        comparison.read("Pendulum-v1", results)
    small.setattr(beyond, "SEEDS", range(3))
    assert "was made with other settings or code" in beyond.stale(results)[0]


def test_the_long_command_keeps_a_simplified_policy(small, tmp_path):
    small.setattr(beyond, "LONG", (SIMPLEGOAL,))
    small.setattr("sys.argv", ["x", "--long", "--out", str(tmp_path), "--jobs", "1"])
    beyond.main()
    results = tmp_path / "data" / "results"
    policy = VoronoiPolicy.load(results / "beyond_SimpleGoal-v0.policy")
    assert 1 <= len(policy) <= SMALL.n_cells
    assert len(pd.read_csv(results / "beyond_seconds_long.csv")) == 2 * 5 + 1  # few seeds
    assert not (results / "beyond_race.csv").exists()
    store.read_listed(results / "beyond_SimpleGoal-v0.policy")  # not as a policy: as what `sha256sum -c` sees


def test_the_simplified_policy_may_lose_its_share(small):
    asked = []
    small.setattr(beyond, "simplify", lambda *given, **settings: asked.append((given, settings)) or ("policy", None))
    assert beyond.simplest(SIMPLEGOAL) == "policy"
    ((teacher, task, config), settings) = asked[0]
    starts = start_states(get_task(SIMPLEGOAL), SMALL.n_validation, 0)
    own = play(teacher, get_task(SIMPLEGOAL), starts).returns.mean()
    assert (task, config, settings) == (SIMPLEGOAL, SMALL, {"tolerance": pytest.approx(0.02 * own), "seed": 0})
