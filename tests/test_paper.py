import ast
import csv
import math
import re
import shutil

import numpy as np
import pytest

from vsp import paper, store
from vsp.evaluate import spread

SIMPLEGOAL, MOUNTAINCAR = "SimpleGoal-v0", "MountainCarContinuous-v0"
FILES = sorted(path.name for path in paper.FOLDER.glob("*.csv"))


@pytest.mark.parametrize("file", FILES)
def test_every_row_says_where_it_was_read(file):
    with open(paper.FOLDER / file, encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert rows and all(row["where"].strip() for row in rows)
    assert all(None not in row and None not in row.values() for row in rows), "ragged row"
    if file == "text_numbers.csv":
        assert len({row["id"] for row in rows}) == len(rows)
    else:
        assert len({row["where"] for row in rows}) == len(rows)


def test_hyperparameters():
    assert paper.hyperparameters(SIMPLEGOAL) == {
        "n_epochs": 5000, "n_split": 20, "n_merge": 100, "n_freeze": 1000, "n_reset": 500,
        "min_param_distance": 0.5, "min_pol_distance": 0.3, "max_pol_loss": 1e-4, "one_split": False,
    }  # fmt: skip
    assert paper.hyperparameters(MOUNTAINCAR) == {
        "n_epochs": 2000, "n_split": 50, "n_merge": 100, "n_freeze": 400, "n_reset": 500,
        "min_param_distance": 0.3, "min_pol_distance": 0.04, "max_pol_loss": 1e-5, "one_split": False,
    }  # fmt: skip
    assert type(paper.hyperparameters(SIMPLEGOAL)["one_split"]) is bool
    assert type(paper.hyperparameters(SIMPLEGOAL)["n_epochs"]) is int


def test_spread():
    simplegoal, mountaincar = paper.spread(SIMPLEGOAL), paper.spread(MOUNTAINCAR)
    metrics = ["Min", "Max", "Mean", "Std", "Q1", "Median/Q2", "Q3", "IQR", "Coverage"]
    assert simplegoal.index.tolist() == mountaincar.index.tolist() == metrics
    assert simplegoal["drl"].tolist() == [-10.0, 22.667, 16.599, 3.117, 14.542, 16.956, 18.687, 4.145, 97.6]
    assert simplegoal["ours"].tolist() == [-11.79, 22.798, 12.657, 8.436, 12.298, 15.382, 17.646, 5.348, 86.17]
    assert mountaincar["drl"].tolist() == [93.36, 93.622, 93.481, 0.075, 93.403, 93.476, 93.548, 0.145, 100.0]
    assert mountaincar["ours"].tolist() == [71.05, 94.68, 93.534, 1.345, 93.403, 93.476, 93.548, 0.145, 92.18]
    assert simplegoal["unit"].tolist() == ["return"] * 8 + ["percent"]


@pytest.mark.parametrize(("task", "prefix"), [(SIMPLEGOAL, "sg"), (MOUNTAINCAR, "mc")])
@pytest.mark.parametrize("who", ["drl", "ours"])
def test_text_and_spread_table_print_the_same_values(task, prefix, who):
    for metric in ("Min", "Max", "Mean", "Std"):
        assert paper.value(f"{prefix}_{who}_{metric.lower()}") == paper.spread(task).at[metric, who]


@pytest.mark.parametrize(
    ("id", "expected"),
    [
        ("sg_training_steps", 500_000),
        ("sg_policies", 85),
        ("mc_policies", 40),
        ("sg_text_policies", 40),  # the results text swaps the two counts
        ("mc_text_policies", 85),
        ("sg_ours_outliers", 11067),
        ("sg_ours_outliers_mean", -8.042),
        ("sg_drl_outliers_max", 10.364),
        ("mc_drl_outliers", 0),
        ("mc_ours_outliers", 3130),
        ("mc_ours_outliers_below_share", 73.19),
        ("mc_ours_whisker_low", 93.313),
        ("mc_ours_whisker_high", 94.130),
        ("sg_cells", 13),
        ("mc_cells", 32),
    ],
)
def test_value(id, expected):
    assert paper.value(id) == expected


def test_text_numbers_are_what_is_printed():
    frame = paper.text_numbers()
    assert not (frame[["task", "quantity", "subject", "printed", "where"]] == "").any(axis=None)
    spelled = {"sg_training_steps": 500_000, "initial_subpolicies": 1, "mc_drl_outliers": 0}  # 500.000, one, no
    for id, row in frame.iterrows():
        if math.isnan(row["value"]):
            assert id in ("machine_chip", "pytorch_version", "python_version")
        else:
            assert row["value"] == spelled.get(id) or row["value"] == float(row["printed"].rstrip("%")), id
        assert (row["unit"] == "percent") == row["printed"].endswith("%"), id


def test_text_numbers_of_one_task():
    frame = paper.text_numbers(SIMPLEGOAL)
    assert set(frame["task"]) == {SIMPLEGOAL, "both"}
    both = (frame["task"] == "both").sum()
    assert len(frame) + len(paper.text_numbers(MOUNTAINCAR)) - both == len(paper.text_numbers()) == 99


def test_tdavq_comparison():
    frame = paper.tdavq_comparison()
    assert frame["TD-AVQ"].tolist() == ["No", "No", "No", "Accumulated reward"]
    assert frame["Ours"].tolist() == ["Yes", "Yes", "Yes", "Prediction loss"]


def test_linear_policies_by_hand():
    simplegoal, mountaincar = paper.linear_policies(SIMPLEGOAL), paper.linear_policies(MOUNTAINCAR)
    assert len(simplegoal) == paper.value("sg_cells") == 13
    assert len(mountaincar) == paper.value("mc_cells") == 32
    names = ["codeword_x", "codeword_y", "dx_x", "dx_y", "dx_bias", "dy_x", "dy_y", "dy_bias"]
    assert simplegoal.loc[0, names].tolist() == [0.891, 0.628, -0.148, -0.021, -0.055, -0.420, 0.231, -1.095]
    assert simplegoal.loc[2, names].tolist() == [0.407, 0.150, 0.0, 3.175, -1.000, 0.0, -4.127, -0.710]
    assert simplegoal.loc[9, names].tolist() == [0.034, 0.496, -0.649, -0.652, -0.076, 0.706, -0.6946, -0.463]
    assert simplegoal.loc[12, names].tolist() == [0.195, 0.970, 0.327, -0.246, 0.349, 0.620, -0.077, -0.882]
    names = ["codeword_x", "codeword_v", "F_x", "F_v", "F_bias", "colour"]
    assert mountaincar.loc[0, names].tolist() == [-0.592, 0.0, -0.375, 3.004, -1.205, "BlueViolet"]
    assert mountaincar.loc[4, names].tolist() == [-0.575, -0.024, 0.8357, 0.7049, -0.514, "BlueViolet"]
    assert mountaincar.loc[21, names].tolist() == [-0.752, -0.011, 0.871, -0.737, 0.018, "Violet"]
    assert mountaincar.loc[31, names].tolist() == [-0.465, 0.039, -0.155, 0.835, 0.602, "Goldenrod"]
    colours = mountaincar["colour"].value_counts().to_dict()
    assert colours == {"Goldenrod": 19, "BlueViolet": 9, "LimeGreen": 3, "Violet": 1}


@pytest.mark.parametrize(("task", "inputs", "outputs"), [(SIMPLEGOAL, "xy", ["dx", "dy"]), (MOUNTAINCAR, "xv", ["F"])])
def test_printed_expressions_give_the_numeric_columns(task, inputs, outputs):
    for _, row in paper.linear_policies(task).iterrows():
        for output in outputs:
            expression = row[f"{output}_printed"]
            python = re.sub(r"(?<=\d)(?=[a-z])", "*", expression)  # 3.175y -> 3.175*y

            def at(*point, python=python):
                assert re.fullmatch(r"[-+.*\dxyv]+", python)
                return eval(python, {"__builtins__": {}}, dict(zip(inputs, point, strict=True)))

            bias = at(0.0, 0.0)
            assert row[f"{output}_bias"] == bias
            assert row[f"{output}_{inputs[0]}"] == pytest.approx(at(1.0, 0.0) - bias, abs=1e-12)
            assert row[f"{output}_{inputs[1]}"] == pytest.approx(at(0.0, 1.0) - bias, abs=1e-12)


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR])
def test_codewords_lie_in_the_state_space_and_differ(task):
    frame = paper.linear_policies(task)
    codewords = frame[[name for name in frame if name.startswith("codeword_")]].to_numpy()
    low, high = ([0, 0], [1, 1]) if task == SIMPLEGOAL else ([-1.2, -0.07], [0.6, 0.07])
    assert ((codewords >= low) & (codewords <= high)).all()
    assert len(np.unique(codewords, axis=0)) == len(codewords)


def test_published_policy_by_hand():
    policy = paper.published_policy(SIMPLEGOAL)
    assert policy.codewords.shape == (13, 2) and policy.coefficients.shape == (13, 3, 2)
    # (0.9, 0.6) is nearest to the first codeword: dx = -0.1332 - 0.0126 - 0.055, dy = -0.378 + 0.1386 - 1.095 < -1
    np.testing.assert_allclose(policy.predict(np.array([0.9, 0.6]))[0], [-0.2008, -1.0], atol=1e-6)
    # (0.4, 0.15) is nearest to the third: dx = 0.47625 - 1, dy = -0.61905 - 0.71 < -1
    np.testing.assert_allclose(policy.predict(np.array([0.4, 0.15]))[0], [-0.52375, -1.0], atol=1e-6)

    policy = paper.published_policy(MOUNTAINCAR)
    assert policy.codewords.shape == (32, 2) and policy.coefficients.shape == (32, 3, 1)
    # at rest at -0.47 the second codeword is nearest: F = -0.78208 - 0.211
    np.testing.assert_allclose(policy.predict(np.array([-0.47, 0.0]))[0], [-0.99308], atol=1e-6)


@pytest.mark.parametrize(("task", "inputs", "outputs"), [(SIMPLEGOAL, "xy", ["dx", "dy"]), (MOUNTAINCAR, "xv", ["F"])])
def test_published_policy_acts_as_the_table_says(task, inputs, outputs):
    rows = [row for _, row in paper.linear_policies(task).iterrows()]
    low, high = ([0.0, 0.0], [1.0, 1.0]) if task == SIMPLEGOAL else ([-1.2, -0.07], [0.6, 0.07])
    states = np.random.default_rng(0).uniform(low, high, size=(200, 2))
    a, b = inputs
    expected = []
    for s, t in states:
        cell = min(rows, key=lambda row: abs(row[f"codeword_{a}"] - s) + abs(row[f"codeword_{b}"] - t))
        raw = [cell[f"{name}_{a}"] * s + cell[f"{name}_{b}"] * t + cell[f"{name}_bias"] for name in outputs]
        expected.append([min(max(action, -1.0), 1.0) for action in raw])
    actions, _ = paper.published_policy(task).predict(states)
    np.testing.assert_allclose(actions, expected, atol=1e-6)


@pytest.mark.parametrize(
    "function", [paper.hyperparameters, paper.spread, paper.text_numbers, paper.linear_policies, paper.published_policy]
)
def test_unknown_task(function):
    with pytest.raises(ValueError, match="'CartPole-v1', expected one of .*SimpleGoal-v0.*MountainCarContinuous-v0"):
        function("CartPole-v1")


def test_value_refuses_unknown_ids_and_texts():
    with pytest.raises(ValueError, match="unknown id 'sg_drl_mena', expected one of .*sg_drl_mean"):
        paper.value("sg_drl_mena")
    with pytest.raises(ValueError, match="'pytorch_version' is the text '2.3.1'"):
        paper.value("pytorch_version")


def test_missing_and_altered_files_are_named(tmp_path, monkeypatch):
    folder = paper.FOLDER
    monkeypatch.setattr(paper, "FOLDER", tmp_path)
    with pytest.raises(FileNotFoundError, match="spread.csv: no such file; `git checkout"):
        paper.spread(SIMPLEGOAL)
    for name in ("spread.csv", store.MANIFEST):
        shutil.copy(folder / name, tmp_path)
    paper.spread(SIMPLEGOAL)
    copy = tmp_path / "spread.csv"
    copy.write_text(copy.read_text(encoding="utf-8").replace("16.599", "16.598"), encoding="utf-8")
    with pytest.raises(ValueError, match="spread.csv: SHA-256 is .* `make manifest` .*lists it so"):
        paper.spread(SIMPLEGOAL)
    store.list_folder(tmp_path)  # as `make manifest` does: the edit is accepted
    assert paper.spread(SIMPLEGOAL).at["Mean", "drl"] == 16.598


# Every printed value


@pytest.fixture(scope="module")
def printed():
    return paper.printed_values().set_index("id")


def test_every_printed_value_is_there_once(printed):
    assert printed.columns.tolist() == ["task", "where", "quantity", "subject", "paper", "value"]
    assert printed.index.is_unique and not (printed.drop(columns="value") == "").any(axis=None)
    kinds = printed.index.str.extract("^.._(spread|hyper|cell)_", expand=False).fillna("text")
    coefficients = sum(
        (frame[[name for name in frame if name.startswith("codeword_")]].size)
        + sum(len(re.findall(r"[0-9]*\.[0-9]+", text)) for name in frame if "printed" in name for text in frame[name])
        for frame in map(paper.linear_policies, (SIMPLEGOAL, MOUNTAINCAR))
    )
    assert kinds.value_counts().to_dict() == {"text": 99, "spread": 2 * 2 * 9, "hyper": 2 * 9, "cell": coefficients}


def test_values_of_text_and_captions_are_among_the_printed(printed):
    text = paper.text_numbers()
    rows = printed.loc[text.index]
    assert rows["paper"].tolist() == text["printed"].tolist() and rows["where"].tolist() == text["where"].tolist()
    assert np.array_equal(rows["value"], text["value"], equal_nan=True)
    assert rows[["task", "quantity", "subject"]].equals(text[["task", "quantity", "subject"]])


@pytest.mark.parametrize(("task", "prefix"), [(SIMPLEGOAL, "sg"), (MOUNTAINCAR, "mc")])
def test_values_of_the_tables_are_among_the_printed(printed, task, prefix):
    for subject, who in (("drl", "DRL"), ("ours", "Ours")):
        for metric, row in paper.spread(task).iterrows():
            found = printed.loc[paper.spread_id(task, subject, metric)]
            assert (found["task"], found["quantity"], found["subject"]) == (task, metric, who)
            assert found["value"] == float(found["paper"]) == row[subject] and found["where"] == row["where"]
    for name, value in paper.hyperparameters(task).items():
        found = printed.loc[f"{prefix}_hyper_{name}"]
        assert (found["task"], found["value"], ast.literal_eval(found["paper"])) == (task, float(value), value)
    cells = printed[printed.index.str.startswith(f"{prefix}_cell_")]
    frame = paper.linear_policies(task)
    for id, found in cells.iterrows():
        k, name = re.fullmatch(r".._cell_(\d+)_(\w+)", id).groups()
        row = frame.loc[int(k) - 1]
        assert found["value"] == float(found["paper"]) == row[name] and found["where"] == row["where"]
        assert (found["task"], found["quantity"], found["subject"]) == (task, name, "Ours")


def test_terms_that_the_paper_does_not_print_are_no_printed_values(printed):
    frame = paper.linear_policies(SIMPLEGOAL)
    assert frame.at[2, "dx_printed"] == "3.175y-1.000"  # no x
    assert "sg_cell_3_dx_x" not in printed.index and printed.at["sg_cell_3_dx_y", "paper"] == "3.175"
    assert printed.at["sg_cell_3_dx_bias", "paper"] == "-1.000"
    assert printed.at["mc_cell_1_codeword_v", "paper"] == "0.000"  # printed, though zero


def test_printed_values_keep_the_papers_digits(printed):
    spelled = {
        "sg_ours_min": "-11.790", "mc_ours_outliers_below_share": "73.19%", "mc_drl_outliers": "no",
        "initial_subpolicies": "one", "sg_training_steps": "500.000", "mc_spread_ours_min": "71.050",
        "mc_hyper_max_pol_loss": "0.00001", "pytorch_version": "2.3.1",
    }  # fmt: skip
    assert {id: printed.at[id, "paper"] for id in spelled} == spelled
    assert printed.index[printed["value"].isna()].tolist() == ["machine_chip", "pytorch_version", "python_version"]


@pytest.mark.parametrize(
    ("asked", "id"),
    [
        ((SIMPLEGOAL, "ours", "Median/Q2"), "sg_spread_ours_median"),
        ((MOUNTAINCAR, "drl", "Coverage"), "mc_spread_drl_coverage"),
        ((MOUNTAINCAR, "ours", "q1"), "mc_spread_ours_q1"),
    ],
)
def test_ids_of_the_spread_tables(asked, id):
    assert paper.spread_id(*asked) == id
    with pytest.raises(ValueError, match="unknown task 'CartPole-v1'"):
        paper.spread_id("CartPole-v1", *asked[1:])


def test_a_column_of_the_spread_tables_has_the_names_of_our_spread():
    assert paper.spread_values(SIMPLEGOAL, "drl") == {
        "min": -10.0, "max": 22.667, "mean": 16.599, "std": 3.117, "q1": 14.542, "median": 16.956, "q3": 18.687,
        "iqr": 4.145, "coverage": 97.6,
    }  # fmt: skip
    assert paper.spread_values(MOUNTAINCAR, "ours")["median"] == 93.476
    assert paper.spread_values(SIMPLEGOAL, "ours").keys() <= spread(np.arange(5.0)).keys()
    with pytest.raises(ValueError, match="subject is 'theirs', expected one of"):
        paper.spread_values(SIMPLEGOAL, "theirs")
