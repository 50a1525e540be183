"""The committed results: possible numbers, made with today's settings, teachers and versions; and what is stale."""

import dataclasses
import shutil
from functools import cache
from types import SimpleNamespace

import pandas as pd
import pytest
from support import LUNARLANDER, MOUNTAINCAR, SIMPLEGOAL, TASKS

from studies.benchmarks import fits, lookup
from studies.comparison import kept, method_rows, method_tables, regret, stale_results
from studies.comparison.method_tables import METHODS, WALKERS
from vsp.paper import results as results_module
from vsp.paper import runs
from vsp.paper.readings import ALTERNATIVES
from vsp.paper.results import RESULTS, read_results, write_results
from vsp.paper.runs import paper_experiment
from vsp.paper.studies import interpretations
from vsp.paper.studies import teachers as teachers_module
from vsp.paper.studies.interpretations import CHOOSING, CONFIRMING, N_CONFIRMED, distance, landmarks, ranking
from vsp.paper.studies.teachers import SEEDS
from vsp.run import listed

# Committed


def test_the_committed_results_are_those_of_todays_settings_teachers_and_versions():
    found = stale_results()
    assert not found, "\n".join(found)


@pytest.mark.parametrize("task", TASKS)
def test_the_committed_summaries_of_the_runs_are_too(task):
    made_with = read_results(task)[["settings", "teacher", "version"]].drop_duplicates()
    assert made_with.to_dict("records") == [paper_experiment(task).provenance]


@pytest.fixture(scope="module")
def readings():
    return read_results("readings")


@pytest.fixture(scope="module")
def teachers():
    return read_results("teachers")


def test_the_first_of_the_ranking_were_confirmed(readings):
    chosen, confirmed = (readings[readings["phase"] == phase] for phase in ("choosing", "confirming"))
    first = [name for name in ranking(chosen) if name != "default"][:N_CONFIRMED]
    nearest = [ranking(chosen, task)[0] for task in TASKS]
    expected = {(name, task) for name in ["default", *first, *nearest] for task in (*TASKS, "both")}
    assert set(zip(confirmed["variant"], confirmed["task"])) == expected and len(confirmed) == len(expected)
    assert (confirmed[confirmed["task"] != "both"]["runs"] == len(CONFIRMING)).all()
    assert len(CONFIRMING) >= 10


def test_distances_follow_from_the_other_columns(readings, teachers):
    """So a changed measure of the distance shows, also where no run changed."""
    shipped = teachers[teachers["teacher"] == "shipped"].groupby("task")[["teacher_mean", "teacher_std"]].first()
    for row in readings[readings["task"] != "both"].to_dict("records"):
        own = {"mean": shipped.at[row["task"], "teacher_mean"], "std": shipped.at[row["task"], "teacher_std"]}
        away = distance(interpretations.standing(row, own), landmarks(row["task"]))
        assert row["distance"] == pytest.approx(away, rel=1e-4)


def test_both_studies_saw_the_same_runs(readings, teachers):
    """The default reading and the shipped teacher share seeds, so one file must follow from the other."""
    assert CHOOSING == SEEDS
    for task in TASKS:
        rows = teachers[(teachers["task"] == task) & (teachers["teacher"] == "shipped")]
        chosen = readings[(readings["phase"] == "choosing") & (readings["variant"] == "default")]
        row = chosen.set_index("task").loc[task]
        assert (set(rows["checksum"]), set(rows["version"])) == ({row["teacher"]}, {row["version"]})
        for name in ("mean", "cells", "goal", "pit", "truncated"):
            assert rows[name].mean() == pytest.approx(row[name], abs=2e-6)
        assert (rows["cells"].min(), rows["cells"].max()) == (row["cells_min"], row["cells_max"])
        assert (rows["mean"] > rows["teacher_mean"]).mean() == pytest.approx(row["runs_above_teacher"])


# Stale


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A copy of the committed results, to spoil."""
    shutil.copytree(RESULTS, tmp_path / "results")
    monkeypatch.setattr(results_module, "RESULTS", tmp_path / "results")
    known = cache(paper_experiment)  # a teacher is read once
    for module in (interpretations, teachers_module):
        monkeypatch.setattr(module, "paper_experiment", known)
    return tmp_path / "results"


def says(name, what, target):
    return f"data/results/{name} was made with other {what}: `make {target}` makes it anew"


def test_a_missing_or_damaged_file_is_named(results):
    (results / "teachers.csv").unlink()
    with open(results / "lookup.csv", "ab") as file:
        file.write(b"\n")
    missing, damaged = stale_results()
    assert missing == "data/results/teachers.csv is missing: `make study` makes it"
    assert damaged.startswith(f"{results / 'lookup.csv'}: SHA-256 is ")


def spoil(path, change):
    listed.write_listed(path, change(pd.read_csv(path, dtype=str)).to_csv(index=False))


@pytest.mark.parametrize(
    ("name", "change", "what"),
    [
        ("readings", lambda frame: frame[frame["variant"] != "R4 one_split"], "settings"),
        ("readings", lambda frame: frame.drop(index=frame.index[frame["task"] == MOUNTAINCAR][3]), "settings"),
        ("readings", lambda frame: pd.concat([frame, frame[:1].assign(settings="0123456789")]), "settings"),
        ("teachers", lambda frame: frame.assign(version=2), "version"),
        ("teachers", lambda frame: frame.assign(checksum="0123456789"), "teacher"),
        ("teachers", lambda frame: frame.drop(columns="settings"), "settings"),
        ("teachers", lambda frame: frame.iloc[1:], "rows"),
        ("teachers", lambda frame: pd.concat([frame, frame[:1]]), "rows"),
    ],
    ids=["variant", "task", "more", "version", "teacher", "column", "row", "twice"],
)  # fmt: skip
def test_other_rows_are_stale(results, name, change, what):
    spoil(results / f"{name}.csv", change)
    assert stale_results() == [says(f"{name}.csv", what, "study")]


BEYOND = [says(f"beyond_{task}.csv", "version", "beyond") for task in method_tables.TASKS]
LONG = [says(f"beyond_{LUNARLANDER}.csv", "version", "beyond-long")]
STUDIES = [says(f"{name}.csv", "version", "study") for name in ("readings", "teachers")]


def long_ones(what):
    """Of LunarLander, what holds rows of `refined` or comes from it."""
    names = ("beyond_{}.csv", "tuned_{}.csv", "beyond_{}.policy")
    return [says(name.format(LUNARLANDER), what, "beyond-long") for name in names]


def raised(name):
    return dataclasses.replace(METHODS[name], version=9)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda patch: patch.setattr(runs, "VERSION", 2), STUDIES),
        (lambda patch: patch.setitem(METHODS, "CART", raised("CART")), BEYOND + LONG),
        (lambda patch: patch.setitem(METHODS, "TD-AVQ", raised("TD-AVQ")), BEYOND[:1]),
        (lambda patch: patch.setattr(regret, "VERSION", 2), [says("optimum.csv", "version", "beyond")]),
        (lambda patch: patch.setattr(lookup, "VERSION", 2), [says("lookup.csv", "version", "lookup")]),
        (lambda patch: patch.setattr(fits, "VERSION", 2), [says("fits.csv", "version", "lookup")]),
        (lambda patch: patch.setattr(kept, "SIMPLIFY_VERSION", 2),
         [says(f"beyond_{LUNARLANDER}.policy", "version", "beyond-long")]),
        (lambda patch: patch.setattr(interpretations, "VERSION", 2), [says("readings.csv", "settings", "study")]),
    ],
    ids=["paper", "CART", "TD-AVQ", "optimum", "lookup", "fits", "simplify", "study"],
)  # fmt: skip
def test_results_of_another_version_are_stale(results, monkeypatch, change, expected):
    change(monkeypatch)
    assert stale_results() == expected


def test_results_of_another_preset_are_stale(results, monkeypatch):
    fewer = cache(lambda task: dataclasses.replace(paper_experiment(task), n_episodes=999))
    monkeypatch.setattr(teachers_module, "paper_experiment", fewer)
    monkeypatch.setitem(ALTERNATIVES, "R7", [*ALTERNATIVES["R7"], {"batch_size": 32}])
    best = method_rows.tuned_preset
    changed = {task: dataclasses.replace(best(task), n_steps=99) for task in (SIMPLEGOAL, LUNARLANDER)}
    monkeypatch.setattr(method_rows, "tuned_preset", lambda task: changed.get(task) or best(task))
    assert stale_results() == [
        says("readings.csv", "settings", "study"),
        says("teachers.csv", "settings", "study"),
        says(f"beyond_{SIMPLEGOAL}.csv", "settings", "beyond"),
        says(f"teachers_{SIMPLEGOAL}.csv", "settings", "beyond"),
        *long_ones("settings"),
    ]


def files_of(task):
    """The committed rows of a task, and what is kept beside them."""
    found = []
    for table in method_rows.tables_of(task):
        found += [f"{table}_{task}.csv"] + [f"same_{task}.csv"] * (table == "faithful")
        found += [f"{table}_{task}.policy"] * (table in kept.KEPT)
    return found


def test_results_of_another_teacher_are_stale(results, monkeypatch):
    paths = teachers_module.teachers
    monkeypatch.setattr(teachers_module, "teachers", lambda task: dict(list(paths(task).items())[:-1]))
    monkeypatch.setattr(method_rows, "_teacher", lambda task, agent: SimpleNamespace(digest="f" * 64))
    monkeypatch.setattr(kept, "load_teacher", lambda task: SimpleNamespace(digest="f" * 64))
    assert stale_results() == [
        says("teachers.csv", "teacher", "study"),
        *(says(name, "teacher", "beyond") for task in method_tables.TASKS for name in files_of(task)),
        *(says(name, "teacher", "beyond-long") for task in (LUNARLANDER, *WALKERS) for name in files_of(task)),
        says(f"beyond_{LUNARLANDER}.policy", "teacher", "beyond-long"),
        *(
            says(f"{name}_{task}.csv", "settings and teacher", "beyond-long")  # those of the policy that walks
            for task in WALKERS
            for name in ("gait", "fewest")
        ),
    ]


# On disk and on the command line


def test_ids_are_read_as_they_were_written(tmp_path):
    ids = {"settings": ["0123456789", "12345e6789"], "teacher": ["0000000001", None], "version": [1, None]}
    frame = pd.DataFrame(ids).astype({"version": "Int64"})
    write_results(frame.assign(mean=[1 / 3, 2.0]), "readings", out=tmp_path)
    folder = tmp_path / "data" / "results"
    text = b"settings,teacher,version,mean\n0123456789,0000000001,1,0.333333\n12345e6789,,,2.000000\n"
    assert (folder / "readings.csv").read_bytes() == text
    found = read_results("readings", folder)
    assert found["settings"].tolist() == ["0123456789", "12345e6789"] and found["teacher"][0] == "0000000001"
    assert found["version"][0] == 1 and found["version"].isna()[1]
