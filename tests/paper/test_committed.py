"""The committed results of the paper and of its studies, and how they are written."""

import pandas as pd
import pytest
from support import TASKS

from studies.reproduction import hidden, simpler
from vsp.paper.results import read_results, write_results
from vsp.paper.runs import paper_experiment


@pytest.mark.parametrize("task", TASKS)
def test_the_committed_summaries_of_the_runs_are_too(task):
    made_with = read_results(task)[["settings", "teacher", "version"]].drop_duplicates()
    assert made_with.to_dict("records") == [paper_experiment(task).provenance]


def test_the_committed_studies_were_made_with_todays_settings_teachers_and_versions():
    now = [simpler.provenance_of(paper_experiment(task)) for task in TASKS]
    assert read_results("simpler")[[*now[0]]].drop_duplicates().to_dict("records") == now
    for task in TASKS:
        for row in read_results(f"hidden_{task}").iloc[::50].to_dict("records"):
            assert hidden.provenance_of(task, row["stage"], row["k"]).items() <= row.items()


# On disk and on the command line


def test_ids_are_read_as_they_were_written(tmp_path):
    ids = {"settings": ["0123456789", "12345e6789"], "teacher": ["0000000001", None], "version": [1, None]}
    frame = pd.DataFrame(ids).astype({"version": "Int64"})
    write_results(frame.assign(mean=[1 / 3, 2.0]), "simpler", out=tmp_path)
    folder = tmp_path / "data" / "results"
    text = b"settings,teacher,version,mean\n0123456789,0000000001,1,0.333333\n12345e6789,,,2.000000\n"
    assert (folder / "simpler.csv").read_bytes() == text
    found = read_results("simpler", folder)
    assert found["settings"].tolist() == ["0123456789", "12345e6789"] and found["teacher"][0] == "0000000001"
    assert found["version"][0] == 1 and found["version"].isna()[1]
