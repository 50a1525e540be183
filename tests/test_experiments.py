import dataclasses
import os
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, alive, same_arrays, tiny, until

from vsp import baselines, experiments, store, workers
from vsp.evaluate import outcomes
from vsp.experiments import (
    EVALUATION_SEED,
    N_RUNS,
    VALIDATION_SEED,
    Experiment,
    best,
    code_id,
    load_run,
    load_runs,
    make_all,
    make_runs,
    paper_experiment,
    paper_runs,
    returns,
)

CONFIG = tiny(n_epochs=30, n_freeze=5)
SMALL = Experiment(SIMPLEGOAL, CONFIG, CurvedTeacher(), n_episodes=20)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three runs, in a folder that tests only read."""
    runs = tmp_path_factory.mktemp("runs")
    return runs, make_runs(SMALL, range(3), runs=runs)


def test_a_run_keeps_the_class_of_its_sub_policies(tmp_path):
    for name in ("constant", "network"):
        (run,) = make_runs(changed(config=dataclasses.replace(CONFIG, sub_policy=name)), [0], runs=tmp_path)
        assert run.policy.form.name == name and len(run.outcomes.returns) == 20


def files(runs, experiment=SMALL):
    return {path.name: path.read_bytes() for path in sorted(experiment.folder(runs).iterdir())}


def changed(**changes):
    return dataclasses.replace(SMALL, **changes)


# Making runs


def test_a_run_is_a_distillation_and_its_evaluation(made):
    run = made[1][1]
    policy, history = experiments.distill(SMALL.teacher, SIMPLEGOAL, CONFIG, seed=1)
    on_shared, on_validation = (outcomes(policy, SIMPLEGOAL, 20, seed=s) for s in (EVALUATION_SEED, VALIDATION_SEED))
    assert run.seed == 1 and EVALUATION_SEED != VALIDATION_SEED
    assert same_arrays(
        (run.policy.codewords, policy.codewords), (run.policy.coefficients, policy.coefficients),
        (run.outcomes.returns, on_shared.returns), (run.outcomes.lengths, on_shared.lengths),
        (run.outcomes.codes, on_shared.codes), (run.cells, np.array(history.cells)),
    )  # fmt: skip
    assert run.validation_mean == on_validation.returns.mean() != on_shared.returns.mean()
    assert (run.splits, run.merges) == tuple(sum(e.kind == k for e in history.events) for k in ("split", "merge"))


def test_runs_come_in_the_order_of_the_seeds(made):
    runs, in_order = made
    assert [run.seed for run in in_order] == [0, 1, 2] == [run.seed for run in load_runs(SMALL, runs=runs)]
    assert [run.seed for run in make_runs(SMALL, [2, 0], runs=runs)] == [2, 0]


def test_seeds_may_be_any_iterable(made):
    assert [run.seed for run in make_runs(SMALL, iter([2, 0]), runs=made[0])] == [2, 0]


@pytest.mark.parametrize(("jobs", "order"), [(1, [2, 1, 0]), (2, [0, 1, 2]), (2, [2, 1, 0])])
def test_workers_and_order_have_no_say_in_the_bytes(made, tmp_path, jobs, order):
    make_runs(SMALL, order, runs=tmp_path, jobs=jobs)
    assert files(tmp_path) == files(made[0])


def test_a_resumed_experiment_makes_the_missing_runs_alone(made, tmp_path, monkeypatch):
    shutil.copytree(made[0], tmp_path / "runs")
    (SMALL.folder(tmp_path / "runs") / "0001.run").unlink()
    times = {p: p.stat().st_mtime_ns for p in SMALL.folder(tmp_path / "runs").iterdir()}
    seeds, original = [], experiments.make_run
    monkeypatch.setattr(experiments, "make_run", lambda e, seed: (seeds.append(seed), original(e, seed))[1])
    make_runs(SMALL, range(3), runs=tmp_path / "runs")
    assert seeds == [1] and files(tmp_path / "runs") == files(made[0])
    assert all(path.stat().st_mtime_ns == time for path, time in times.items())
    make_runs(SMALL, range(3), runs=tmp_path / "runs")
    assert seeds == [1]


OTHER = dataclasses.replace(SMALL, config=dataclasses.replace(CONFIG, n_split=5))


@pytest.mark.parametrize("jobs", [1, 2])
def test_runs_of_several_experiments_are_those_made_one_by_one(made, tmp_path, jobs):
    work = [(OTHER, 0), (SMALL, 2), (SMALL, 0), (OTHER, 3)]
    assert make_all(iter(work), runs=tmp_path / "all", jobs=jobs, label="both") is None
    make_runs(OTHER, [3, 0], runs=tmp_path / "one")
    assert files(tmp_path / "all", OTHER) == files(tmp_path / "one", OTHER)
    before = files(made[0])
    assert files(tmp_path / "all") == {name: before[name] for name in ("0000.run", "0002.run")}


def test_all_that_is_there_is_made_no_more(made, tmp_path, monkeypatch, capsys):
    shutil.copytree(made[0], tmp_path, dirs_exist_ok=True)
    asked, original = [], experiments.make_run
    monkeypatch.setattr(experiments, "make_run", lambda e, seed: (asked.append((e, seed)), original(e, seed))[1])
    make_all([(SMALL, 1), (SMALL, 2)], runs=tmp_path, label="a study")
    assert not asked and capsys.readouterr().err == ""
    make_all([(SMALL, 1), (OTHER, 1), (SMALL, 4)], runs=tmp_path, label="a study")
    shown = capsys.readouterr().err
    assert asked == [(OTHER, 1), (SMALL, 4)] and "a study" in shown and "3 of 3 runs" in shown
    make_all([], runs=tmp_path, label="a study")
    assert len(asked) == 2 and files(tmp_path).keys() == {f"000{seed}.run" for seed in (0, 1, 2, 4)}


def test_progress_says_how_many_are_done(tmp_path, capsys):
    make_runs(SMALL, [0], runs=tmp_path)
    capsys.readouterr()
    make_runs(SMALL, [0, 1], runs=tmp_path)
    shown = capsys.readouterr().err
    assert SIMPLEGOAL in shown and "2 of 2 runs" in shown
    make_runs(SMALL, [0, 1], runs=tmp_path)
    assert capsys.readouterr().err == ""


def test_an_interrupted_write_leaves_no_torn_run(tmp_path, monkeypatch):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make_runs(SMALL, [0], runs=tmp_path)
    assert not files(tmp_path)


def test_what_a_killed_writer_left_is_no_run(made, tmp_path):
    """A killed process cannot tidy up: its temporary file stays and must not be taken for a run."""
    folder = SMALL.folder(tmp_path)
    shutil.copytree(SMALL.folder(made[0]), folder)

    with store.atomic_path(folder / "0003.run") as temporary:
        temporary.write_bytes(b"half a run")
        assert [run.seed for run in load_runs(SMALL, runs=tmp_path)] == [0, 1, 2]


# Which runs belong to an experiment


@pytest.mark.parametrize(
    "other",
    [
        changed(config=dataclasses.replace(CONFIG, n_reset=26)),
        changed(config=dataclasses.replace(CONFIG, max_pol_loss=0.0200001)),
        changed(config=dataclasses.replace(CONFIG, split_lookup="kept")),
        changed(n_episodes=21),
        changed(teacher=PumpingTeacher()),
        changed(task=MOUNTAINCAR),
    ],
)
def test_changed_settings_use_another_folder(made, other):
    assert other.id != SMALL.id and other.folder(made[0]) != SMALL.folder(made[0])
    with pytest.raises(FileNotFoundError, match="no runs, expected one or more"):
        load_runs(other, runs=made[0])


def test_equal_settings_use_the_same_folder():
    assert Experiment(SIMPLEGOAL, dataclasses.replace(CONFIG), CurvedTeacher(), 20).id == SMALL.id
    assert SMALL.folder("runs").parts[:2] == ("runs", SIMPLEGOAL)


@pytest.mark.parametrize(
    "name", ["distill", "envs", "geometry", "policy", "subpolicies", "buffers", "rollouts", "teachers"]
)
def test_changed_code_uses_another_folder(name, monkeypatch):
    compute, kind, before = code_id.__wrapped__, type(store.ROOT), code_id()
    read = kind.read_text

    def add(text):
        monkeypatch.setattr(kind, "read_text", lambda path, **how: read(path, **how) + text * (path.stem == name))
        return compute()

    assert compute() == before and add("\nx = 1\n") != before
    assert add("\n# a comment\n") == before == add('\n"""A string that explains."""\n')


def test_a_run_with_other_settings_is_refused_with_both_values(made, tmp_path):
    other = changed(config=dataclasses.replace(CONFIG, n_split=5))
    make_runs(other, [0], runs=tmp_path)
    shutil.copy(other.folder(tmp_path) / "0000.run", tmp_path / "0000.run")
    with pytest.raises(
        ValueError, match="(?s)0000.run: made with config = .*'n_split': 5.*expected .*'n_split': 4.*delete it"
    ):
        load_run(tmp_path / "0000.run", SMALL)
    shutil.copytree(SMALL.folder(made[0]), SMALL.folder(tmp_path))
    shutil.copy(tmp_path / "0000.run", SMALL.folder(tmp_path) / "0007.run")
    for read in (lambda: load_runs(SMALL, runs=tmp_path), lambda: make_runs(SMALL, [7], runs=tmp_path)):
        with pytest.raises(ValueError, match="0007.run: made with config"):
            read()


def test_a_run_under_the_name_of_another_seed_is_refused(made, tmp_path):
    shutil.copytree(made[0], tmp_path / "runs")
    folder = SMALL.folder(tmp_path / "runs")
    shutil.copy(folder / "0000.run", folder / "0005.run")
    with pytest.raises(ValueError, match="seed"):
        load_runs(SMALL, runs=tmp_path / "runs")


def test_a_damaged_run_is_named(made, tmp_path):
    shutil.copytree(made[0], tmp_path / "runs")
    path = SMALL.folder(tmp_path / "runs") / "0001.run"
    content = path.read_bytes()
    for damaged in (content[:-1], b"", content[:300] + bytes([content[300] ^ 4]) + content[301:]):
        path.write_bytes(damaged)
        with pytest.raises(store.DamagedFile, match="0001.run: SHA-256"):
            load_runs(SMALL, runs=tmp_path / "runs")


def test_an_empty_folder_is_one_clear_error(tmp_path):
    for _ in range(2):
        with pytest.raises(FileNotFoundError, match=f"{SIMPLEGOAL}.*: no runs, expected one or more: `make runs`"):
            load_runs(SMALL, runs=tmp_path)
        assert not list(tmp_path.iterdir())
        tmp_path = tmp_path / "missing"
        tmp_path.mkdir()


def test_a_failing_run_writes_nothing_and_keeps_the_others(tmp_path, monkeypatch):
    original = experiments.make_run

    def fails(experiment, seed):
        if seed == 1:
            raise ValueError("the policy's actions hold nan")
        return original(experiment, seed)

    monkeypatch.setattr(experiments, "make_run", fails)
    with pytest.raises(ValueError, match="hold nan"):
        make_runs(SMALL, [0, 1], runs=tmp_path)
    assert list(files(tmp_path)) == ["0000.run"]


# What is made of runs


def test_best_goes_by_the_validation_starts_and_then_by_the_seed(made):
    first, second, third = (
        dataclasses.replace(run, validation_mean=mean) for run, mean in zip(made[1], (1.0, 3.0, 3.0))
    )
    assert best([first, second, third]).seed == best([third, second, first]).seed == 1
    most = dataclasses.replace(first, outcomes=dataclasses.replace(first.outcomes, returns=np.full(20, 1e6)))
    assert best([most, second]).seed == 1


def test_returns_has_a_row_per_run(made):
    table = returns(made[1])
    assert table.shape == (3, 20) and np.array_equal(table[2], made[1][2].outcomes.returns)


@pytest.fixture(scope="module")
def results(made):
    return experiments.Results(SMALL, made[1], outcomes(SMALL.teacher, SIMPLEGOAL, 20, seed=EVALUATION_SEED))


def test_results_gather_what_figures_need(results, made):
    assert results.returns.shape == results.codes.shape == (3, 20) and results.teacher_returns.shape == (20,)
    assert np.array_equal(results.codes[1], made[1][1].outcomes.codes) and results.best is best(made[1])


def test_quick_results_of_the_paper(tmp_path, monkeypatch):
    monkeypatch.setattr(experiments, "QUICK_RUNS", 1)
    found = experiments.paper_results(SIMPLEGOAL, runs=tmp_path, quick=True, jobs=1)
    again = outcomes(found.experiment.teacher, SIMPLEGOAL, 100, seed=EVALUATION_SEED)
    assert found.returns.shape == (1, 100) and np.array_equal(found.teacher_returns, again.returns)
    monkeypatch.setattr(experiments, "outcomes", None)  # what is kept is not played again
    kept = experiments.paper_results(SIMPLEGOAL, runs=tmp_path, quick=True, jobs=1).teacher_outcomes
    assert same_arrays((kept.returns, again.returns), (kept.lengths, again.lengths), (kept.codes, again.codes))


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR])
def test_the_papers_experiment(task):
    paper, quick = paper_experiment(task), paper_experiment(task, quick=True)
    assert paper.config == experiments.preset(task) and paper.n_episodes == 1000
    assert quick.config == paper.config.quick() and quick.n_episodes == 100 and quick.id != paper.id
    assert N_RUNS == {SIMPLEGOAL: 85, MOUNTAINCAR: 40}
    with pytest.raises(ValueError, match="no preset for task 'Pendulum-v1', expected one of"):
        paper_runs("Pendulum-v1", runs="unused")


# The command


def test_the_command_clears_away_what_a_kill_left(made, tmp_path, monkeypatch):
    """And nothing else."""
    folder = SMALL.folder(tmp_path / "data" / "runs")
    shutil.copytree(made[0], tmp_path / "data" / "runs")
    before = files(tmp_path / "data" / "runs")
    (folder / ".0001-a1b2c3d_.run").write_text("torn")
    monkeypatch.setattr(experiments, "N_RUNS", {})
    monkeypatch.setattr(sys, "argv", ["experiments", "--out", str(tmp_path)])
    experiments.main()
    assert files(tmp_path / "data" / "runs") == before


@pytest.mark.parametrize(
    ("options", "quick", "n_fits", "jobs"), [(["--quick", "--jobs", "2"], True, 2, 2), ([], False, 20, -1)]
)
def test_the_command_makes_the_runs_and_what_stands_beside_them(tmp_path, monkeypatch, options, quick, n_fits, jobs):
    made, runs = [], tmp_path / "data" / "runs"
    results = SimpleNamespace(runs=[])
    monkeypatch.setattr(experiments, "paper_results", lambda task, **named: made.append((task, named)) or results)
    monkeypatch.setattr(baselines, "kept_comparison", lambda *given, **named: made.append((given, named)))
    monkeypatch.setattr(sys, "argv", ["experiments", "--out", str(tmp_path), *options])
    experiments.main()
    beside = (results, n_fits), {"runs": runs, "jobs": jobs}
    first, second = ((task, {"runs": runs, "quick": quick, "jobs": jobs}) for task in N_RUNS)
    assert made == [first, beside, second, beside]


def test_an_end_by_signal_ends_the_workers_too(tmp_path):
    """Else they would wait for ever, with open pipes, to hand over their next run.

    As `make` calls it: a module run as a script has another name than the one workers know it by.
    """
    command = [sys.executable, "-m", "vsp.experiments", "--jobs", "2", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    until(lambda: list(tmp_path.rglob("[0-9]*.run")))
    children = subprocess.check_output(["pgrep", "-P", str(process.pid)], text=True).split()
    process.terminate()
    assert "error: interrupted." in process.communicate(timeout=30)[1] and process.returncode == 1
    until(lambda: not any(alive(int(pid)) for pid in children))
    assert len(children) >= 2


def test_a_killed_worker_ends_the_notebooks_of_this_make(tmp_path, monkeypatch):
    def dies(*arguments, **named):
        raise workers.WorkerDied("a worker process was killed")

    ended = []
    monkeypatch.setattr(experiments, "paper_results", dies)
    monkeypatch.setattr(store, "end_others", ended.append)
    monkeypatch.setattr(sys, "argv", ["experiments", "--out", str(tmp_path)])
    with pytest.raises(workers.WorkerDied):
        experiments.main()
    assert ended == [tmp_path / "build" / "locks"]
