import dataclasses
import re

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS

from vsp import paper, tables
from vsp.config import EXTENSIONS, Config, preset
from vsp.evaluate import spread
from vsp.policy import VoronoiPolicy
from vsp.tables import (
    as_latex,
    as_text,
    equation_table,
    hyperparameters,
    save_table,
    spread_table,
    text_numbers,
)

FRAME = pd.DataFrame(
    {"name_of": ["a_b", "c & d"], "value": [1 / 3, 1e-4], "count": [10, 2_000_000], "gap": [np.nan, -2.0]}
)


def returns(seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(16, 3, 200), np.concatenate([rng.normal(15, 4, (5, 200)), rng.normal(-10, 0.1, (1, 200))])


def written(out, name="some_table"):
    folder = out / "figures" / "tables"
    return (folder / f"{name}.tex").read_text(encoding="utf-8"), folder / f"{name}.csv"


def balanced(tex):
    bare = tex.replace(r"\{", "").replace(r"\}", "")
    opened, closed = re.findall(r"\\begin\{(\w+)\}", tex), re.findall(r"\\end\{(\w+)\}", tex)
    return bare.count("{") == bare.count("}") and sorted(opened) == sorted(closed) and tex.count("$") % 2 == 0


def unescaped(tex):
    """Special characters that LaTeX would trip over, outside of mathematics and of the label."""
    text = re.sub(r"\\label\{[^}]*\}|\$[^$]*\$", "", tex)
    return re.findall(r"(?<!\\)[_%#^]", text)


def test_both_files_are_there_and_the_printed_form_comes_back(tmp_path):
    shown = save_table(FRAME, "some_table", caption="Numbers.", out=tmp_path)
    assert sorted(p.name for p in (tmp_path / "figures" / "tables").iterdir()) == ["some_table.csv", "some_table.tex"]
    assert shown.equals(as_text(FRAME))


def test_the_latex_is_a_table_of_booktabs(tmp_path):
    save_table(FRAME, "some_table", caption="Numbers of $x_0$.", out=tmp_path)
    tex, _ = written(tmp_path)
    for part in (
        r"\toprule",
        r"\midrule",
        r"\bottomrule",
        r"\caption{Numbers of $x_0$.}",
        r"\label{tab:some_table}",
        r"\centering",
    ):
        assert tex.count(part) == 1
    assert balanced(tex) and not unescaped(tex) and r"a\_b" in tex and r"c \& d" in tex and r"name\_of" in tex
    rows = [line for line in tex.splitlines() if line.endswith(r"\\")]
    assert len(rows) == 3 and all(len(re.findall(r"(?<!\\)&", row)) == 3 for row in rows)


def test_the_csv_parses_back(tmp_path):
    save_table(FRAME, "some_table", caption="", out=tmp_path)
    _, csv = written(tmp_path)
    back = pd.read_csv(csv)
    assert back.columns.tolist() == FRAME.columns.tolist() and back["name_of"].tolist() == FRAME["name_of"].tolist()
    assert np.allclose(back["value"], FRAME["value"], rtol=1e-5) and back["count"].tolist() == [10, 2_000_000]
    assert np.isnan(back["gap"][0]) and b"\r" not in csv.read_bytes()


def test_the_same_table_gives_the_same_bytes(tmp_path):
    for folder in "ab":
        save_table(FRAME, "some_table", caption="c", out=tmp_path / folder)
    (tex_a, csv_a), (tex_b, csv_b) = written(tmp_path / "a"), written(tmp_path / "b")
    assert tex_a == tex_b and csv_a.read_bytes() == csv_b.read_bytes()


@pytest.mark.parametrize(
    "make", [lambda: text_numbers(SIMPLEGOAL, *returns(), cells=13), lambda: hyperparameters(list(TASKS))]
)
def test_numbers_in_a_csv_have_at_most_eight_digits_also_beside_words(tmp_path, make):
    """Digits beyond the eighth differ between processors."""
    save_table(make(), "some_table", caption="", out=tmp_path)
    numbers = re.findall(r"\d+\.\d+", written(tmp_path)[1].read_text())
    assert numbers and max(len(number.replace(".", "").lstrip("0")) for number in numbers) <= 8


def test_as_text_by_hand():
    frame = pd.DataFrame(
        {"a_b": [1.23456, 0.0, np.nan], "n": [1e-4, -2.0, 0.0005], "c": [3, True, "x_y%"]}, dtype=object
    )
    shown = as_text(frame)
    assert shown["a_b"].tolist() == ["1.235", "0.000", tables.MISSING]
    assert shown["n"].tolist() == ["0.0001", "-2.000", "0.0005"] and shown["c"].tolist() == ["3", "True", "x_y%"]


def test_counts_have_no_decimals_and_a_missing_one_is_missing():
    shown = as_text(pd.DataFrame({"cells": [13.0, np.nan], "share": [1.0, 0.5], "steps": [500_000.0, 0.0]}))
    assert shown["cells"].tolist() == ["13", tables.MISSING] and shown["steps"].tolist() == ["500000", "0"]
    assert shown["share"].tolist() == ["1.000", "0.500"]


def test_a_notebook_shows_no_row_numbers():
    page = tables.show(pd.DataFrame({"a": [7.25], "b": ["x < y"]})).data
    assert re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page) == ["a", "b", "7.250", "x &lt; y"]


@pytest.mark.parametrize("text", ["5 %", "a_b", "c & d"])
def test_specials_of_latex_are_escaped(tmp_path, text):
    save_table(pd.DataFrame({"c": [text, "end"]}), "some_table", caption="c", out=tmp_path)
    row = written(tmp_path)[0].split("\\midrule\n")[1].split(r" \\")[0]
    assert row != text and not re.findall(r"(?<!\\)[_%&]", row)


def test_latex_code_is_left_as_it_is(tmp_path):
    latex = pd.DataFrame({"$x_0$": [r"$\Delta x_1$"]})
    save_table(pd.DataFrame({"x": [1.0]}), "some_table", caption="c", out=tmp_path, latex=latex)
    assert "$x_0$" in written(tmp_path)[0] and r"$\Delta x_1$" in written(tmp_path)[0]


def test_hyperparameters_stand_beside_the_papers(tmp_path):
    frame = hyperparameters(list(TASKS))
    assert frame["hyperparameter"].tolist() == list(paper.hyperparameters(SIMPLEGOAL)) and frame.shape == (9, 5)
    for task in TASKS:
        assert frame[f"{tables.SHORT[task]}, paper"].tolist() == frame[f"{tables.SHORT[task]}, here"].tolist()
    row = frame.set_index("hyperparameter").loc["n_epochs"]
    assert row["SimpleGoal, here"] == 5000 and row["MountainCar, here"] == 2000
    save_table(frame, "some_table", caption="c", out=tmp_path)
    tex, _ = written(tmp_path)
    assert r"n\_epochs" in tex and not unescaped(tex) and balanced(tex) and "0.0001" in tex


@pytest.mark.parametrize("task", TASKS)
def test_a_equation_table_is_a_row_of_equations_per_cell(tmp_path, task):
    policy = paper.published_policy(task)
    shown = equation_table(policy, swatch=task == MOUNTAINCAR)
    assert len(shown) == len(policy) and shown.shape[1] == 1 + len(policy.task.outputs)
    first = [float(c) for c in re.findall(r"-?\d+\.\d+", shown["codeword"][0])]
    assert first == pytest.approx(policy.codewords[0], abs=5e-4)
    equation = shown.iloc[0, 1].split("}} ")[-1]
    signed = [float(s.replace(" ", "")) for s in re.findall(r"[+-]? ?\d+\.\d+", equation)]
    assert signed == pytest.approx(policy.coefficients[0, :, 0], abs=5e-4)
    save_table(policy.to_frame(), "some_table", caption="c", out=tmp_path, latex=shown)
    tex, csv = written(tmp_path)
    assert balanced(tex) and not unescaped(tex)
    back = pd.read_csv(csv).to_numpy()
    assert np.allclose(back[:, : len(policy.task.low)], policy.codewords, rtol=1e-5)


def test_a_swatch_has_the_colour_of_the_force_at_the_codeword():
    left, none, right = ([0, 0, f] for f in (-1.0, 0.0, 5.0))
    policy = VoronoiPolicy([[-1, 0], [-0.5, 0], [0, 0]], np.array([left, none, right])[:, :, None], task=MOUNTAINCAR)
    colours = [
        re.search(r"\\textcolor\[HTML\]\{([0-9A-F]{6})\}", row)[1] for row in equation_table(policy, swatch=True)["$F$"]
    ]
    assert len(set(colours)) == 3
    red, blue = ([int(c[i : i + 2], 16) for c in colours] for i in (0, 4))
    assert blue[0] > red[0] and red[2] > blue[2] and min(int(colours[1][i : i + 2], 16) for i in (0, 2, 4)) > 230


@pytest.mark.parametrize("task", TASKS)
def test_the_spread_table_stands_beside_the_papers(task):
    teacher, runs = returns()
    frame = spread_table(task, teacher, runs).set_index("metric")
    printed = paper.spread(task)
    assert frame.index.tolist() == printed.index.tolist() and frame.shape == (9, 4)
    assert frame["TD3, paper"].tolist() == printed["drl"].tolist()
    assert frame["distilled, paper"].tolist() == printed["ours"].tolist()
    assert frame.at["Mean", "TD3, here"] == teacher.mean() and frame.at["Q1", "distilled, here"] == spread(runs)["q1"]
    assert frame.at["Median/Q2", "TD3, here"] == np.median(teacher)
    assert frame.at["Coverage", "distilled, here"] == pytest.approx(100 * spread(runs)["coverage"]) != 100


@pytest.mark.parametrize("task", TASKS)
def test_the_text_numbers_stand_beside_the_papers(task):
    teacher, runs = returns()
    frame = text_numbers(task, teacher, runs, cells=17).set_index("id")
    prefix = paper.PREFIX[task]
    known = [name for name in frame.index if not pd.isna(frame.at[name, "paper"])]
    printed = paper.text_numbers(task)["value"]
    assert len(known) > 8 and all(frame.at[name, "paper"] == printed[name] for name in known)
    assert frame.at[f"{prefix}_cells", "here"] == 17 and frame.at[f"{prefix}_drl_mean", "here"] == teacher.mean()
    means = runs.mean(axis=1)
    assert frame.at[f"{prefix}_ours_lowest_run_mean", "here"] == means.min()
    assert frame.at[f"{prefix}_ours_runs_above_teacher_share", "here"] == pytest.approx(
        100 * np.mean(means > teacher.mean())
    )


@pytest.mark.parametrize("task", TASKS)
def test_no_result_that_the_papers_text_prints_is_left_out(task):
    ours = set(text_numbers(task, *returns(), cells=17)["id"])
    printed = paper.text_numbers(task)["value"].dropna().index
    results = [name for name in printed if re.match("(sg|mc)_(drl|ours)_|(sg|mc)_cells", name)]
    assert len(results) > 15 and not sorted(set(results) - ours)


def test_readings_are_the_fields_that_the_papers_table_does_not_print():
    frame = tables.readings(SIMPLEGOAL).set_index("reading")["default"]
    assert frame["split_lookup"] == preset(SIMPLEGOAL).split_lookup and "n_epochs" not in frame
    others = [*paper.hyperparameters(SIMPLEGOAL), *EXTENSIONS]
    assert sorted([*frame.index, *others]) == sorted(field.name for field in dataclasses.fields(Config))


def test_a_frame_as_latex_is_what_the_table_holds(tmp_path):
    shown = as_latex(FRAME)
    assert shown.columns.tolist() == [r"name\_of", "value", "count", "gap"]
    assert shown[r"name\_of"].tolist() == [r"a\_b", r"c \& d"] and shown["gap"].tolist() == [tables.MISSING, "$-$2"]
    assert shown["value"].tolist() == ["0.333", "0.0001"] and shown["count"].tolist() == ["10", "2000000"]
    for name, latex in (("plain", None), ("given", shown)):
        save_table(FRAME, name, caption="c", out=tmp_path, latex=latex)
    (plain, _), (given, csv) = written(tmp_path, "plain"), written(tmp_path, "given")
    assert plain.replace("plain", "given") == given and len(pd.read_csv(csv)) == 2


def test_a_long_table_is_whole_in_the_csv_and_in_part_in_the_latex(tmp_path):
    shown = save_table(FRAME, "some_table", caption="c", out=tmp_path, latex=as_latex(FRAME[["value"]][:1]))
    tex, csv = written(tmp_path)
    assert shown.shape == (1, 1) and "0.333" in tex and "a\\_b" not in tex and len(pd.read_csv(csv).columns) == 4


@pytest.mark.parametrize(("rows", "environment"), [(40, "table"), (41, "longtable")])
def test_a_table_of_more_than_a_page_is_a_longtable(tmp_path, rows, environment):
    save_table(pd.DataFrame({"n": range(rows)}), "some_table", caption="Many numbers.", out=tmp_path)
    tex, csv = written(tmp_path)
    assert f"\\begin{{{environment}}}" in tex and ("longtable" in tex) == (environment == "longtable")
    assert balanced(tex) and tex.count(r"\label{tab:some_table}") == 1 and tex.count(r"\caption{Many numbers.}") == 1
    assert len(pd.read_csv(csv)) == rows and f"\n{rows - 1} \\\\\n" in tex


def test_every_printed_value_can_stand_in_latex(tmp_path):
    save_table(paper.printed_values().drop(columns="value"), "some_table", caption="c", out=tmp_path)
    tex, _ = written(tmp_path)
    assert balanced(tex) and not unescaped(tex) and r"73.19\%" in tex
