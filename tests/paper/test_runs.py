import dataclasses
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import support
from support import MOUNTAINCAR, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, called, network_teacher, same_arrays
from threadpoolctl import threadpool_limits

from vsp import distill
from vsp.evaluation import rollout_from_seed
from vsp.paper import make_runs as command
from vsp.paper import read_results, spread, tables
from vsp.paper import runs as runs_module
from vsp.paper.readings import Readings
from vsp.paper.runs import EVALUATION_SEED, N_RUNS, Distillation, Results, make_runs, paper_results
from vsp.protocol import job
from vsp.run import atomic, sealed
from vsp.tasks import GOAL, PIT, TRUNCATED

CONFIG = support.tiny(n_epochs=30, n_freeze=5)
SMALL = runs_module.Experiment(SIMPLEGOAL, CONFIG, CurvedTeacher(), n_episodes=20)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three runs, in a folder that tests only read."""
    runs = tmp_path_factory.mktemp("runs")
    return runs, make_runs(SMALL, range(3), runs=runs)


def files(runs, experiment=SMALL):
    return {path.name: path.read_bytes() for path in sorted(experiment.folder(runs).iterdir())}


def changed(**changes):
    return dataclasses.replace(SMALL, **changes)


# Making runs


def test_a_run_is_a_distillation_and_its_evaluation(made):
    run = made[1][1]
    policy, history = distill(SMALL.teacher, SIMPLEGOAL, CONFIG, seed=1)
    seeds = EVALUATION_SEED, runs_module.VALIDATION_SEED
    on_shared, on_validation = (rollout_from_seed(policy, SIMPLEGOAL, 20, seed=seed) for seed in seeds)
    assert run.seed == 1 and EVALUATION_SEED != runs_module.VALIDATION_SEED
    assert same_arrays(
        (run.policy.codewords, policy.codewords), (run.policy.coefficients, policy.coefficients),
        (run.outcomes.returns, on_shared.returns), (run.outcomes.lengths, on_shared.lengths),
        (run.outcomes.outcomes, on_shared.outcomes), (run.cells, np.array(history.cells)),
    )  # fmt: skip
    assert run.validation_mean == on_validation.returns.mean() != on_shared.returns.mean()
    assert (run.splits, run.merges) == tuple(sum(e.kind == k for e in history.events) for k in ("split", "merge"))


def test_runs_come_in_the_order_of_the_seeds(made):
    runs, in_order = made
    assert [run.seed for run in in_order] == [0, 1, 2]
    assert [run.seed for run in make_runs(SMALL, iter([2, 0]), runs=runs)] == [2, 0]


def test_a_resumed_experiment_makes_the_missing_runs_alone(made, tmp_path, monkeypatch):
    shutil.copytree(made[0], tmp_path / "runs")
    (SMALL.folder(tmp_path / "runs") / "0001.run").unlink()
    times = {p: p.stat().st_mtime_ns for p in SMALL.folder(tmp_path / "runs").iterdir()}
    seeds, original = [], Distillation.make
    monkeypatch.setattr(Distillation, "make", lambda run: (seeds.append(run.seed), original(run))[1])
    make_runs(SMALL, range(3), runs=tmp_path / "runs")
    assert seeds == [1] and files(tmp_path / "runs") == files(made[0])
    assert all(path.stat().st_mtime_ns == time for path, time in times.items())
    make_runs(SMALL, range(3), runs=tmp_path / "runs")
    assert seeds == [1]


OTHER = dataclasses.replace(SMALL, config=dataclasses.replace(CONFIG, n_split=5))


@pytest.mark.parametrize("jobs", [1, 2])
def test_runs_of_several_experiments_are_those_made_one_by_one(made, tmp_path, jobs):
    work = [(OTHER, 0), (SMALL, 2), (SMALL, 0), (OTHER, 3)]
    job.make_all((Distillation(*one) for one in work), tmp_path / "all", "both", jobs=jobs)
    make_runs(OTHER, [3, 0], runs=tmp_path / "one")
    assert files(tmp_path / "all", OTHER) == files(tmp_path / "one", OTHER)
    before = files(made[0])
    assert files(tmp_path / "all") == {name: before[name] for name in ("0000.run", "0002.run")}


# Which runs belong to an experiment


@pytest.mark.parametrize(
    "other",
    [
        changed(config=dataclasses.replace(CONFIG, n_reset=26)),
        changed(readings=Readings(split_lookup="kept")),
        changed(n_episodes=21),
    ],
)
def test_changed_settings_and_teachers_use_another_folder(made, other):
    assert other.provenance != SMALL.provenance and other.folder(made[0]) != SMALL.folder(made[0])
    with pytest.raises(FileNotFoundError, match="0000.run"):
        Distillation(other, 0).run(made[0])


OF_A_RUN = {
    "0000": lambda experiment, runs: make_runs(experiment, [0], runs=runs),
    "teacher": lambda experiment, runs: runs_module.teacher_outcomes(experiment, runs=runs),
}


@pytest.mark.parametrize("name", OF_A_RUN)
@pytest.mark.parametrize(
    ("other", "why"),
    [
        (changed(task=MOUNTAINCAR, teacher=PumpingTeacher()), f"task '{MOUNTAINCAR}', expected '{SIMPLEGOAL}'"),
        (changed(teacher=network_teacher(SIMPLEGOAL)), "teacher '.*', expected '.*'"),
    ],
)
def test_a_file_of_another_experiment_is_refused(tmp_path, name, other, why):
    """Copied to the place of one of this experiment, with a checksum that fits."""
    for experiment in (SMALL, other):
        OF_A_RUN[name](experiment, tmp_path)
    own, theirs = (one.folder(tmp_path) / f"{name}.run" for one in (SMALL, other))
    shutil.copy(theirs, own)
    message = f"^{re.escape(str(own))}: made with {why}: delete it to make it again$"
    with pytest.raises(atomic.DamagedFile, match=message):
        OF_A_RUN[name](SMALL, tmp_path)
    own.unlink()
    OF_A_RUN[name](SMALL, tmp_path)


def test_a_run_whose_returns_are_no_numbers_is_refused(tmp_path):
    make_runs(SMALL, [0], runs=tmp_path)
    one = Distillation(SMALL, 0)
    arrays, about = one.load(tmp_path)
    arrays["returns"][3] = np.nan
    sealed.save_arrays(one.path(tmp_path), arrays, about)
    with pytest.raises(ValueError, match="0000.run: returns"):
        one.run(tmp_path)


def test_a_run_of_another_seed_is_refused_and_a_failing_one_keeps_the_others(tmp_path, monkeypatch):
    make = Distillation.make
    monkeypatch.setattr(Distillation, "make", lambda run: make(run) if run.seed == 0 else 1 / 0)
    with pytest.raises(ZeroDivisionError):
        make_runs(SMALL, [0, 1], runs=tmp_path)
    assert [*files(tmp_path)] == ["0000.run"]
    (SMALL.folder(tmp_path) / "0000.run").rename(SMALL.folder(tmp_path) / "0005.run")
    with pytest.raises(atomic.DamagedFile, match="0005.run: made with seed 0, expected 5"):
        Distillation(SMALL, 5).run(tmp_path)


# What is made of runs


@pytest.fixture(scope="module")
def results(made):
    return Results(SMALL, made[1], rollout_from_seed(SMALL.teacher, SIMPLEGOAL, 20, seed=EVALUATION_SEED))


def test_best_goes_by_the_validation_starts_and_then_by_the_seed(results):
    ranked = zip(results.runs, (1.0, 3.0, 3.0))
    first, second, third = (dataclasses.replace(run, validation_mean=mean) for run, mean in ranked)
    most = dataclasses.replace(first, outcomes=dataclasses.replace(first.outcomes, returns=np.full(20, 1e6)))
    for runs in ([most, second, third], [third, second, most]):
        assert dataclasses.replace(results, runs=runs).best.seed == 1


def test_quick_results_of_the_paper(tmp_path, monkeypatch):
    monkeypatch.setattr(runs_module, "QUICK_RUNS", 1)
    found = paper_results(SIMPLEGOAL, runs=tmp_path, quick=True, jobs=1)
    with threadpool_limits(1):
        again = rollout_from_seed(found.experiment.teacher, SIMPLEGOAL, 100, seed=EVALUATION_SEED)
    assert found.returns.shape == (1, 100) and np.array_equal(found.teacher_returns, again.returns)
    monkeypatch.setattr(runs_module, "rollout_from_seed", None)  # what is kept is not played again
    kept = paper_results(SIMPLEGOAL, runs=tmp_path, quick=True, jobs=1).teacher_outcomes
    assert same_arrays((kept.returns, again.returns), (kept.lengths, again.lengths), (kept.outcomes, again.outcomes))


def test_overview_and_comparison_by_hand(results):
    table = tables.run_overview(results)
    cells = [len(run.policy) for run in results.runs]
    assert table.loc["cells"].tolist() == [np.mean(cells), min(cells), max(cells)]
    facts, means = tables.teacher_beside_runs(results).T, results.returns.mean(axis=1)
    teacher, whole, _, gap, median = facts.T.to_numpy()
    assert (teacher[0], median[0]) == (results.teacher_returns.mean(), np.median(means))
    for (mean, low, high), value in ((whole, means.mean()), (gap, means.mean() - teacher[0])):
        assert low <= mean <= high and mean == pytest.approx(value)
    half = 1.96 * results.returns.std(ddof=1) / np.sqrt(60)
    assert facts.iloc[:, 2].tolist() == pytest.approx([means.mean(), means.mean() - half, means.mean() + half])


def test_summary_tells_each_run_and_is_written(results, tmp_path):
    frame = tables.run_summary(results.runs, SMALL)
    assert (frame[list(SMALL.provenance)] == list(SMALL.provenance.values())).all(axis=None)
    for row, run in zip(frame.to_dict("records"), results.runs, strict=True):
        assert row["seed"] == run.seed and row["cells"] == len(run.policy) == 1 + row["splits"] - row["merges"]
        assert {name: row[name] for name in spread(run.outcomes.returns)} == spread(run.outcomes.returns)
        for name, code in {"goal": GOAL, "pit": PIT, "truncated": TRUNCATED}.items():
            assert row[name] == np.mean(run.outcomes.outcomes == code)
    tables.write_summary(results, out=tmp_path)
    written = read_results(SIMPLEGOAL, tmp_path / "data" / "results")
    pd.testing.assert_frame_equal(written, frame, check_dtype=False, atol=1e-6, rtol=0)


# The command


@pytest.mark.parametrize(("options", "quick", "jobs"), [(["--quick", "--jobs", "2"], True, 2), ([], False, -1)])
def test_the_command_makes_the_runs(tmp_path, monkeypatch, options, quick, jobs):
    made = []
    monkeypatch.setattr(command, "paper_results", lambda task, **named: made.append((task, named)) or results)
    results = SimpleNamespace(runs=[])
    called(command.main, "--out", tmp_path, *options)
    named = {"runs": tmp_path / "data" / "runs", "quick": quick, "jobs": jobs}
    assert made == [(task, named) for task in N_RUNS]
