"""`make agents` and `make hub-teacher`: agents in a folder, what is kept of them, and what is refused in one line."""

import functools
import shutil

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, PENDULUM, called, tiny

from studies import make_study
from studies import zoo as agents
from studies.committed import RESULTS
from vsp.evaluation import likeness
from vsp.paper.runs import Experiment, make_runs
from vsp.run import command, listed
from vsp.teachers.teacher import load_teacher
from vsp_beyond.few_cells import Faithful

ROWS = pd.read_csv(RESULTS / "agents.csv")


@pytest.fixture
def small(monkeypatch):
    """Short distillations of the shipped teacher, whatever the zip."""
    settings = {"n_episodes": 20, "n_states": 500, "n_restarts": 1, "n_generations": 0, "n_validation": 5}
    settings["n_tuning_episodes"] = 1
    monkeypatch.setattr(agents, "faithful_preset", lambda task, *, n_cells: Faithful(n_cells=n_cells, **settings))
    monkeypatch.setattr(agents, "N_EPISODES", 10)
    monkeypatch.setattr(agents, "SEEDS", range(2))
    monkeypatch.setattr(agents, "paper_preset", lambda task: tiny(n_epochs=30, n_freeze=5))
    monkeypatch.setattr(agents, "read", lambda path, task: load_teacher(task))


def folder_of(tmp_path, *names):
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
    return tmp_path


def test_agents_are_named_by_file_or_by_folder(tmp_path):
    names = f"ppo-{PENDULUM}.zip", f"trpo/{PENDULUM}_1/{PENDULUM}.zip", f"trpo/{PENDULUM}_2/{PENDULUM}.zip"
    found = agents.agents_in(folder_of(tmp_path, *names))
    assert found == {("ppo", PENDULUM): tmp_path / names[0], ("trpo", PENDULUM): tmp_path / names[2]}


def test_the_fewest_cells_that_act_like_the_agent_are_kept(small, tmp_path):
    path = folder_of(tmp_path, "x.zip") / "x.zip"
    arrays, made = agents.Study("td3", MOUNTAINCAR, path).make()
    about = made["row"]
    assert (about["cells"], len(arrays["codewords"]), about["numbers"]) == (2, 2, 10) and about["r2"] >= 0.95
    agent = load_teacher(MOUNTAINCAR)
    returns = likeness(agent, agent, MOUNTAINCAR, 10).returns["agent"]
    assert (about["agent"], about["agent_failing"], about["weights"]) == (returns.mean(), 0, 121801)
    assert np.array_equal(arrays["actions"], agent.predict(agents.plane(MOUNTAINCAR)[2])[0])


def test_what_is_refused_or_slow_has_a_reason(small, monkeypatch, tmp_path):
    path = folder_of(tmp_path, "x.zip") / "x.zip"
    assert agents.Study("ppo", "Nothing-v0", path).make()[1]["row"]["reason"].startswith("unknown task 'Nothing-v0'")
    monkeypatch.setattr(agents, "SECONDS", 0)
    row = {"checksum": agents.atomic.sha256(path), "algorithm": "td3", "task": PENDULUM}
    row["reason"] = "slower than 0 minutes"
    assert agents.Study("td3", PENDULUM, path).make() == ({}, {"row": row, "papers": []})


def test_the_command_writes_table_policies_and_maps_and_resumes(small, monkeypatch, tmp_path):
    """First from its files, then from the committed results: there only the agent that has none is left to do."""
    given = folder_of(tmp_path / "given", f"td3-{MOUNTAINCAR}.zip", "sac-Nothing-v0.zip")
    run = functools.partial(called, agents.main, given, "--out", tmp_path, "--jobs", 1)
    run()
    folder, make, asked = tmp_path / "data" / "beyond", agents.Study.make, []
    written = [(folder / f"{name}.csv").read_bytes() for name in ("agents", "agents_paper")]
    monkeypatch.setattr(agents.Study, "make", None)  # nothing is left to do
    run()
    for where in ("studies.zoo", "studies.committed"):
        monkeypatch.setattr(f"{where}.RESULTS", folder)
    shutil.copy(RESULTS / "zoo.csv", folder)
    listed.list_folder(folder)
    shutil.rmtree(tmp_path / "build")
    monkeypatch.setattr(agents.Study, "make", lambda one: (asked.append(one.algorithm), make(one))[1])
    run()
    assert asked == ["sac"]
    assert written == [(folder / f"{name}.csv").read_bytes() for name in ("agents", "agents_paper")]
    car, unknown = pd.read_csv(folder / "agents.csv").sort_values("task").to_dict("records")
    assert unknown["reason"].startswith("unknown task") and (car["zoo"], car["cells"]) == (93.483, 2)
    assert len(agents.policy_of("td3", MOUNTAINCAR)) == 2
    assert agents.actions_of("td3", MOUNTAINCAR).shape == (agents.POINTS**2, 1)
    with pytest.raises(command.CommandError, match="no .zip below it, expected a folder of agents"):
        called(agents.main, tmp_path / "none")


def test_the_committed_agents_are_those_of_the_collection_and_within_what_was_published():
    good = ROWS[ROWS["reason"].isna()]
    assert len(ROWS) == len(good) == 14 and set(good["task"]) == {MOUNTAINCAR, PENDULUM}
    sampling = 3 * np.hypot(good["zoo_std"] / np.sqrt(150), good["agent_std"] / np.sqrt(1000))
    assert (abs(good["agent"] - good["zoo"]) <= sampling).all()
    for row in good.itertuples():
        policy, actions = agents.policy_of(row.algorithm, row.task), agents.actions_of(row.algorithm, row.task)
        assert len(policy) <= row.cells and len(actions) == agents.POINTS**2
        assert (row.r2 >= agents.ENOUGH) or row.cells == max(agents.SIZES)
    assert "MIT License" in (RESULTS / "agents" / "LICENSE").read_text()


@pytest.mark.parametrize("row", ROWS.itertuples(), ids=lambda row: f"{row.algorithm}-{row.task}")
def test_kept_actors_are_those_of_the_rows(row):
    agent = agents.agent_of(row.algorithm, row.task)
    assert agent.digest[:10] == row.teacher and agent.card["checksum of the zip"] == row.checksum
    assert np.abs(agent.predict(agents.plane(row.task)[2])[0] - agents.actions_of(row.algorithm, row.task)).max() < 1e-5


def test_an_agent_that_nobody_has_is_one_line(tmp_path):
    with pytest.raises(command.CommandError, match="^agent for Pendulum-v1 is 'td3', expected 'a2c', 'ars', 'ddpg', "):
        agents.agent_of("td3", PENDULUM)
    with pytest.raises(command.CommandError, match="cells is 2.0, expected a whole number from 1 to 16$") as caught:
        command.check_parameter("cells", 2.0, range(1, 17))
    assert caught.value._render_traceback_() == [f"error: {caught.value}"]  # what Jupyter shows


# The paper's part with another teacher


def test_another_teacher_gets_the_papers_rows_and_ledger(small, monkeypatch, tmp_path):
    config = tiny(n_epochs=30, n_freeze=5)
    monkeypatch.setattr(make_study, "N_RUNS", {MOUNTAINCAR: 2})
    monkeypatch.setattr(make_study, "paper_experiment", lambda task: Experiment(task, config, None, n_episodes=9))
    monkeypatch.setattr(make_study, "read", lambda path, task: load_teacher(task))
    called(make_study.main, "--agent", "an_agent.zip", "--out", tmp_path, "--jobs", 1)
    folder = tmp_path / "data" / "results"
    ledger = pd.read_csv(folder / "hub_teacher_ledger.csv")
    mean = ledger.set_index("id").loc["mc_spread_ours_mean"]
    one = Experiment(MOUNTAINCAR, config, load_teacher(MOUNTAINCAR), n_episodes=9)
    returns = [run.outcomes.returns for run in make_runs(one, range(2), runs=tmp_path / "build" / "study")]
    assert mean["here"] == pytest.approx(np.mean(returns), abs=1e-6) and float(mean["paper"]) == 93.534


def test_an_agent_of_another_task_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(make_study, "read", lambda path, task: load_teacher(PENDULUM, task))
    with pytest.raises(command.CommandError, match="load it for the task it was trained on"):
        called(make_study.main, "--agent", tmp_path / "none.zip", "--out", tmp_path)
    assert not list(tmp_path.iterdir())
