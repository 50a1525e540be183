import dataclasses
import shutil
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, TASKS

from vsp import beyond, readings_study, store, study, teachers_study
from vsp.experiments import paper_experiment
from vsp.readings_study import variants

# Committed


def test_the_committed_results_were_made_with_the_code_and_settings_of_today():
    found = study.stale()
    assert not found, "\n".join(found)


@pytest.fixture(scope="module")
def readings():
    return study.read("readings")


@pytest.fixture(scope="module")
def teachers():
    return study.read("teachers")


def test_every_variant_was_tried_on_both_tasks_ten_times_or_more(readings):
    chosen = readings[readings["phase"] == "choosing"].set_index(["variant", "task"])
    assert chosen.index.is_unique
    assert set(chosen.index) == {(name, task) for name in variants() for task in (*TASKS, "both")}
    assert (chosen.drop("both", level="task")["runs"] >= 10).all()


def test_the_first_of_the_ranking_were_confirmed(readings):
    chosen, confirmed = (readings[readings["phase"] == phase] for phase in ("choosing", "confirming"))
    first = [name for name in readings_study.ranking(chosen) if name != "default"][: readings_study.N_CONFIRMED]
    nearest = [readings_study.ranking(chosen, task)[0] for task in TASKS]
    expected = {(name, task) for name in ["default", *first, *nearest] for task in (*TASKS, "both")}
    assert set(zip(confirmed["variant"], confirmed["task"])) == expected and len(confirmed) == len(expected)
    assert (confirmed[confirmed["task"] != "both"]["runs"] == len(readings_study.CONFIRMING)).all()
    assert len(readings_study.CONFIRMING) >= 10


def test_rows_name_the_settings_that_they_were_made_with(readings):
    single = readings[readings["task"] != "both"]
    for name in ("default", "R4 one_split", "R2 + R3", "algorithms as printed"):
        for task in TASKS:
            found = set(single[(single["variant"] == name) & (single["task"] == task)]["settings"])
            assert found == {readings_study.experiment(task, variants()[name]).id}
    assert single.groupby("settings")["variant"].nunique().eq(1).all()


def test_numbers_of_the_readings_are_possible(readings):
    single, joint = (readings[(readings["task"] == "both") == both] for both in (False, True))
    assert single[["goal", "pit", "truncated"]].sum(axis=1).sub(1).abs().max() < 1e-5
    assert ((single["mean_low"] <= single["mean"]) & (single["mean"] <= single["mean_high"])).all()
    assert ((single["cells_min"] <= single["cells"]) & (single["cells"] <= single["cells_max"])).all()
    default = joint[joint["variant"] == "default"]
    assert len(default) == 2 and (default[["gap", "gap_low", "gap_high"]] == 0).all(axis=None)
    for phase, rows in joint.groupby("phase"):
        away = single[single["phase"] == phase].groupby("variant")["distance"].mean()
        rows = rows.set_index("variant")
        assert np.allclose(rows["distance"], away[rows.index], atol=2e-6)
        assert np.allclose(rows["gap"], rows["distance"] - rows.at["default", "distance"], atol=2e-6)


def test_distances_follow_from_the_other_columns(readings, teachers):
    """So a changed measure of the distance shows, also where no run changed."""
    shipped = teachers[teachers["teacher"] == "shipped"].groupby("task")[["teacher_mean", "teacher_std"]].first()
    for row in readings[readings["task"] != "both"].to_dict("records"):
        own = {"mean": shipped.at[row["task"], "teacher_mean"], "std": shipped.at[row["task"], "teacher_std"]}
        away = readings_study.distance(readings_study.standing(row, own), readings_study.landmarks(row["task"]))
        assert row["distance"] == pytest.approx(away, rel=1e-4)


def test_every_teacher_was_distilled_ten_times_or_more(teachers):
    expected = {(task, name): 10 for task in TASKS for name in teachers_study.teachers(task)}
    assert teachers.groupby(["task", "teacher"])["seed"].nunique().to_dict() == expected and len(expected) >= 2 * 3
    assert teachers[["goal", "pit", "truncated"]].sum(axis=1).sub(1).abs().max() < 1e-5


def test_both_studies_saw_the_same_runs(readings, teachers):
    """The default reading and the shipped teacher share seeds, so one file must follow from the other."""
    assert readings_study.CHOOSING == teachers_study.SEEDS
    for task in TASKS:
        rows = teachers[(teachers["task"] == task) & (teachers["teacher"] == "shipped")]
        chosen = readings[(readings["phase"] == "choosing") & (readings["variant"] == "default")]
        row = chosen.set_index("task").loc[task]
        assert set(rows["settings"]) == {row["settings"]}
        for name in ("mean", "cells", "goal", "pit", "truncated"):
            assert rows[name].mean() == pytest.approx(row[name], abs=2e-6)
        assert (rows["cells"].min(), rows["cells"].max()) == (row["cells_min"], row["cells_max"])
        assert (rows["mean"] > rows["teacher_mean"]).mean() == pytest.approx(row["runs_above_teacher"])


# Stale


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A copy of the committed results, to spoil."""
    for name in study.STUDIES:
        shutil.copy(study.RESULTS / f"{name}.csv", tmp_path)
    store.list_folder(tmp_path)
    monkeypatch.setattr(study, "RESULTS", tmp_path)
    known = cache(paper_experiment)  # a teacher is read once
    for module in (readings_study, teachers_study):
        monkeypatch.setattr(module, "paper_experiment", known)
    return tmp_path


def spoil(path, change):
    frame = pd.read_csv(path, dtype=str)
    store.write_listed(path, change(frame).to_csv(index=False))


def test_a_missing_file_is_named(results):
    assert study.stale() == []
    (results / "teachers.csv").unlink()
    assert study.stale() == ["data/results/teachers.csv is missing: `make study` makes it"]


def test_a_damaged_file_is_named(results):
    with open(results / "teachers.csv", "ab") as file:
        file.write(b"\n")
    (found,) = study.stale()
    assert found.startswith(f"{results / 'teachers.csv'}: SHA-256 is ")


def says(name, what):
    return f"data/results/{name}.csv was made with other {what}: `make study` makes it anew"


@pytest.mark.parametrize(
    "change",
    [
        lambda frame: frame[frame["variant"] != "R4 one_split"],
        lambda frame: frame[(frame["variant"] != "R4 one_split") | (frame["task"] != MOUNTAINCAR)],
        lambda frame: frame.assign(settings=frame["settings"].replace(frame["settings"][0], "0123456789")),
        lambda frame: pd.concat([frame, frame[:1].assign(settings="0123456789")]),
    ],
    ids=["variant", "task", "other", "more"],
)
def test_results_of_other_settings_are_stale(results, change):
    spoil(results / "readings.csv", change)
    assert study.stale() == [says("readings", "settings")]


def test_results_of_another_configuration_are_stale(results, monkeypatch):
    monkeypatch.setitem(readings_study.READINGS, "R7", [*readings_study.READINGS["R7"], {"batch_size": 32}])
    assert study.stale() == [says("readings", "settings")]


def test_results_of_fewer_episodes_are_stale(results, monkeypatch):
    fewer = cache(lambda task: dataclasses.replace(paper_experiment(task), n_episodes=999))
    monkeypatch.setattr(teachers_study, "paper_experiment", fewer)
    assert study.stale() == [says("teachers", "settings")]


def test_results_of_another_teacher_are_stale(results, monkeypatch):
    paths = teachers_study.teachers
    monkeypatch.setattr(teachers_study, "teachers", lambda task: dict(list(paths(task).items())[:-1]))
    assert study.stale() == [says("teachers", "settings")]


def test_results_of_other_code_are_stale(results, monkeypatch):
    monkeypatch.setattr(teachers_study, "code", lambda: "0000000000")
    assert study.stale() == [says("teachers", "code")]
    monkeypatch.setattr(readings_study, "code", lambda: "0000000000")
    assert study.stale() == [says("readings", "code"), says("teachers", "code")]
    spoil(results / "teachers.csv", lambda frame: frame.assign(code="0000000000"))
    assert study.stale() == [says("readings", "code")]


def test_results_of_two_codes_are_stale(results):
    spoil(results / "readings.csv", lambda frame: frame.assign(code=frame["code"].mask(frame.index == 5, "0" * 10)))
    spoil(results / "teachers.csv", lambda frame: frame.assign(code="0" * 10, settings="0" * 10))
    assert study.stale() == [says("readings", "code"), says("teachers", "settings and code")]


# On disk

FRAME = pd.DataFrame({"settings": ["0123456789", "12345e6789"], "code": ["0000000001", "1e5"], "mean": [1 / 3, 2.0]})


def test_settings_and_code_are_read_as_they_were_written(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "RESULTS", tmp_path)
    store.write_listed(tmp_path / "readings.csv", FRAME.to_csv(index=False))
    assert study.read("readings").equals(FRAME)


def test_make_study_writes_what_was_found(tmp_path, monkeypatch):
    asked = {}

    def studied(name, frame):
        return SimpleNamespace(study=lambda runs, *, jobs: (asked.update({name: (runs, jobs)}), frame)[1])

    found = {"readings": FRAME, "teachers": FRAME[:1]}
    monkeypatch.setattr(study, "STUDIES", {name: studied(name, frame) for name, frame in found.items()})
    monkeypatch.setattr("sys.argv", ["x", "--out", str(tmp_path), "--jobs", "3"])
    study.main()
    assert asked == dict.fromkeys(found, (tmp_path / "build" / "study", 3))
    text = (tmp_path / "data" / "results" / "readings.csv").read_bytes()
    assert text == b"settings,code,mean\n0123456789,0000000001,0.333333\n12345e6789,1e5,2.000000\n"
    names = [path.name for path in sorted((tmp_path / "data" / "results").iterdir())]
    assert names == [store.MANIFEST, "readings.csv", "teachers.csv"]


def test_a_check_says_what_is_stale_and_makes_nothing(results, tmp_path, monkeypatch, capsys):
    for module in (readings_study, teachers_study):
        monkeypatch.delattr(module, "study")
    monkeypatch.setattr("sys.argv", ["x", "--check", "--out", str(tmp_path / "out")])
    monkeypatch.setattr(beyond, "stale", lambda folder: [f"all of {folder.name}"])
    study.main()
    assert capsys.readouterr().out == f"all of {results.name}\n"
    monkeypatch.setattr(beyond, "stale", lambda folder: [])
    study.main()
    assert capsys.readouterr().out == ""
    (results / "readings.csv").unlink()
    study.main()
    assert capsys.readouterr().out == "data/results/readings.csv is missing: `make study` makes it\n"
    assert not (tmp_path / "out").exists()
