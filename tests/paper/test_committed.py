"""The committed results of the paper and of its studies, and how they are written."""

import pandas as pd
import pytest
from support import MOUNTAINCAR, TASKS

from studies.reproduction import interpretations, simpler
from studies.reproduction import teachers as teachers_study
from studies.reproduction.interpretations import CHOOSING, CONFIRMING, N_CONFIRMED, distance, landmarks, ranking
from studies.reproduction.teachers import SEEDS
from vsp.paper.results import read_results, write_results
from vsp.paper.runs import N_RUNS, paper_experiment
from vsp.protocol.job import PROVENANCE


@pytest.mark.parametrize("task", TASKS)
def test_the_committed_summaries_of_the_runs_are_too(task):
    made_with = read_results(task)[["settings", "teacher", "version"]].drop_duplicates()
    assert made_with.to_dict("records") == [paper_experiment(task).provenance]


def made_today(name, frame):
    """What the rows of a study are made with today. Of the readings, the rows show which were confirmed."""
    if name == "readings":
        confirmed = set(frame.loc[frame["phase"] == "confirming", "variant"])
        for (variant, _), one in interpretations.experiments(interpretations.variants()).items():
            for seeds in (CHOOSING, CONFIRMING)[: 1 + (variant in confirmed)]:
                yield interpretations.provenance_of(one, seeds)
    elif name == "teachers":
        for one in teachers_study.experiments().values():
            yield from ({**teachers_study.provenance_of(one), "seed": seed} for seed in SEEDS)
    elif name == "hub_teacher":
        made_with = teachers_study.provenance_of(paper_experiment(MOUNTAINCAR)) | {"teacher": frame["checksum"][0]}
        yield from ({**made_with, "seed": seed} for seed in range(N_RUNS[MOUNTAINCAR]))
    else:
        yield from (simpler.provenance_of(paper_experiment(task)) for task in TASKS)


@pytest.mark.parametrize("name", ["readings", "teachers", "hub_teacher", "simpler"])
def test_the_committed_studies_were_made_with_todays_settings_teachers_and_versions(name):
    frame = read_results(name)
    now = pd.DataFrame(made_today(name, frame)).astype(str)
    made = frame.assign(teacher=frame["checksum"]) if "checksum" in frame else frame
    made = made[[*now]].dropna(subset=[*PROVENANCE]).astype(str)
    assert {*now.itertuples(index=False)} == {*made.itertuples(index=False)}, "`make study` makes it anew"


@pytest.fixture(scope="module")
def readings():
    return read_results("readings")


@pytest.fixture(scope="module")
def teachers():
    return read_results("teachers")


def test_distances_follow_from_the_other_columns(readings, teachers):
    """So a changed measure of the distance shows, also where no run changed."""
    shipped = teachers[teachers["teacher"] == "shipped"].groupby("task")[["teacher_mean", "teacher_std"]].first()
    for row in readings[readings["task"] != "both"].to_dict("records"):
        own = {"mean": shipped.at[row["task"], "teacher_mean"], "std": shipped.at[row["task"], "teacher_std"]}
        away = distance(interpretations.standing(row, own), landmarks(row["task"]))
        assert row["distance"] == pytest.approx(away, rel=1e-4)


def test_the_first_of_the_ranking_were_confirmed(readings):
    chosen, confirmed = (readings[readings["phase"] == phase] for phase in ("choosing", "confirming"))
    first = [name for name in ranking(chosen) if name != "default"][:N_CONFIRMED]
    assert {"default", *first, *(ranking(chosen, task)[0] for task in TASKS)} == set(confirmed["variant"])


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
