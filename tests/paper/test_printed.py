import ast
import csv
import math
import re
import shutil

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL

from vsp.paper import printed as printed_module
from vsp.paper.printed import FOLDER, printed_hyperparameters, printed_spread, printed_text_numbers
from vsp.paper.statistics import spread
from vsp.run import listed

FILES = sorted(path.name for path in FOLDER.glob("*.csv"))


@pytest.mark.parametrize("file", FILES)
def test_every_row_says_where_it_was_read(file):
    with open(FOLDER / file, encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert rows and all(row["where"].strip() for row in rows)
    assert all(None not in row and None not in row.values() for row in rows), "ragged row"
    if file == "text_numbers.csv":
        assert len({row["id"] for row in rows}) == len(rows)
    else:
        assert len({row["where"] for row in rows}) == len(rows)


def test_text_numbers_are_what_is_printed():
    frame = printed_text_numbers()
    assert not (frame[["task", "quantity", "subject", "printed", "where"]] == "").any(axis=None)
    spelled = {"sg_training_steps": 500_000, "initial_subpolicies": 1, "mc_drl_outliers": 0}  # 500.000, one, no
    for id, row in frame.iterrows():
        if math.isnan(row["value"]):
            assert id in ("machine_chip", "pytorch_version", "python_version")
        else:
            assert row["value"] == spelled.get(id) or row["value"] == float(row["printed"].rstrip("%")), id
        assert (row["unit"] == "percent") == row["printed"].endswith("%"), id


def test_tdavq_comparison():
    frame = printed_module.printed_tdavq_comparison()
    assert frame["TD-AVQ"].tolist() == ["No", "No", "No", "Accumulated reward"]
    assert frame["Ours"].tolist() == ["Yes", "Yes", "Yes", "Prediction loss"]


def test_missing_and_altered_files_are_named(tmp_path, monkeypatch):
    folder = FOLDER
    monkeypatch.setattr(printed_module, "FOLDER", tmp_path)
    with pytest.raises(FileNotFoundError, match="spread.csv: no such file"):
        printed_spread(SIMPLEGOAL)
    for name in ("spread.csv", listed.MANIFEST):
        shutil.copy(folder / name, tmp_path)
    printed_spread(SIMPLEGOAL)
    copy = tmp_path / "spread.csv"
    copy.write_text(copy.read_text(encoding="utf-8").replace("16.599", "16.598"), encoding="utf-8")
    with pytest.raises(ValueError, match="spread.csv: SHA-256 is .* `python -m vsp.run.manifest .*accepts it"):
        printed_spread(SIMPLEGOAL)


# Every printed value


@pytest.fixture(scope="module")
def printed():
    return printed_module.printed_values().set_index("id")


def test_every_printed_value_is_there_once(printed):
    assert printed.columns.tolist() == ["task", "where", "quantity", "subject", "paper", "value"]
    assert printed.index.is_unique and not (printed.drop(columns="value") == "").any(axis=None)
    kinds = printed.index.str.extract("^.._(spread|hyper|cell)_", expand=False).fillna("text")
    coefficients = sum(
        (frame[[name for name in frame if name.startswith("codeword_")]].size)
        + sum(len(re.findall(r"[0-9]*\.[0-9]+", text)) for name in frame if "printed" in name for text in frame[name])
        for frame in map(printed_module.linear_policies, (SIMPLEGOAL, MOUNTAINCAR))
    )
    assert kinds.value_counts().to_dict() == {"text": 99, "spread": 2 * 2 * 9, "hyper": 2 * 9, "cell": coefficients}


@pytest.mark.parametrize(("task", "prefix"), [(SIMPLEGOAL, "sg"), (MOUNTAINCAR, "mc")])
def test_values_of_the_tables_are_among_the_printed(printed, task, prefix):
    for subject, who in (("drl", "DRL"), ("ours", "Ours")):
        for metric, row in printed_spread(task).iterrows():
            found = printed.loc[printed_module.spread_id(task, subject, metric)]
            assert (found["task"], found["quantity"], found["subject"]) == (task, metric, who)
            assert found["value"] == float(found["paper"]) == row[subject] and found["where"] == row["where"]
    for name, value in printed_hyperparameters(task).items():
        found = printed.loc[f"{prefix}_hyper_{name}"]
        literal = ast.literal_eval(found["paper"])
        assert (found["task"], found["value"], literal, type(literal)) == (task, float(value), value, type(value))
    cells = printed[printed.index.str.startswith(f"{prefix}_cell_")]
    frame = printed_module.linear_policies(task)
    for id, found in cells.iterrows():
        k, name = re.fullmatch(r".._cell_(\d+)_(\w+)", id).groups()
        row = frame.loc[int(k) - 1]
        assert found["value"] == float(found["paper"]) == row[name] and found["where"] == row["where"]
        assert (found["task"], found["quantity"], found["subject"]) == (task, name, "Ours")


def test_digits_and_terms_are_those_that_the_paper_prints(printed):
    assert "sg_cell_3_dx_x" not in printed.index and printed.at["sg_cell_3_dx_bias", "paper"] == "-1.000"
    assert printed.at["mc_spread_ours_min", "paper"] == "71.050"  # its last digit decides on its verdict


def test_a_column_of_the_spread_tables_has_the_names_of_our_spread():
    assert printed_module.printed_spread_values(MOUNTAINCAR, "ours")["median"] == 93.476
    assert printed_module.printed_spread_values(SIMPLEGOAL, "ours").keys() <= spread(np.arange(5.0)).keys()
