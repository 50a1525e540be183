import dataclasses
import re

import numpy as np
import pandas as pd
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS

from vsp.config import EXTENSIONS, Config
from vsp.paper import printed as printed_module
from vsp.paper import tables
from vsp.paper.printed import PREFIX, printed_hyperparameters, printed_spread, printed_text_numbers
from vsp.paper.readings import Readings
from vsp.paper.tables import as_text, equation_table, hyperparameter_table, present, save_table, text_number_table
from vsp.policy import VoronoiPolicy
from vsp.show import captions

FRAME = pd.DataFrame(
    {"name_of": ["a_b", "c & d"], "value": [1 / 3, 1e-4], "count": [10, 2_000_000], "gap": [np.nan, -2.0]}
)


def returns(seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(16, 3, 200), np.concatenate([rng.normal(15, 4, (5, 200)), rng.normal(-10, 0.1, (1, 200))])


def saved(out, frame=FRAME, caption="", **shown):
    """The LaTeX that is written for a frame, and the path of its CSV."""
    save_table(frame, "some_table", caption=caption, out=out, **shown)
    folder = out / "figures" / "tables"
    return (folder / "some_table.tex").read_text(encoding="utf-8"), folder / "some_table.csv"


def balanced(tex):
    bare = tex.replace(r"\{", "").replace(r"\}", "")
    opened, closed = re.findall(r"\\begin\{(\w+)\}", tex), re.findall(r"\\end\{(\w+)\}", tex)
    return bare.count("{") == bare.count("}") and sorted(opened) == sorted(closed) and tex.count("$") % 2 == 0


def unescaped(tex):
    """Special characters that LaTeX would trip over, outside of mathematics and of the label."""
    text = re.sub(r"\\label\{[^}]*\}|\$[^$]*\$", "", tex)
    return re.findall(r"(?<!\\)[_%#^]", text)


def test_the_latex_is_a_table_of_booktabs(tmp_path):
    tex, _ = saved(tmp_path, caption="Numbers of $x_0$.")
    parts = [r"\toprule", r"\midrule", r"\bottomrule", r"\label{tab:some_table}", r"\centering"]
    assert [tex.count(part) for part in [*parts, r"\caption{Numbers of $x_0$.}"]] == [1] * 6
    assert balanced(tex) and not unescaped(tex) and r"a\_b" in tex and r"c \& d" in tex and r"name\_of" in tex
    rows = [line for line in tex.splitlines() if line.endswith(r"\\")]
    assert len(rows) == 3 and all(len(re.findall(r"(?<!\\)&", row)) == 3 for row in rows)


def test_the_csv_parses_back(tmp_path):
    _, csv = saved(tmp_path)
    back = pd.read_csv(csv)
    assert back.columns.tolist() == FRAME.columns.tolist() and back["name_of"].tolist() == FRAME["name_of"].tolist()
    assert np.allclose(back["value"], FRAME["value"], rtol=1e-5) and back["count"].tolist() == [10, 2_000_000]
    assert np.isnan(back["gap"][0]) and b"\r" not in csv.read_bytes()


@pytest.mark.parametrize(
    "make", [lambda: text_number_table(SIMPLEGOAL, *returns(), cells=13), lambda: hyperparameter_table(list(TASKS))]
)
def test_numbers_in_a_csv_have_at_most_eight_digits_also_beside_words(tmp_path, make):
    """Digits beyond the eighth differ between processors."""
    numbers = re.findall(r"\d+\.\d+", saved(tmp_path, make())[1].read_text())
    assert numbers and max(len(number.replace(".", "").lstrip("0")) for number in numbers) <= 8


@pytest.mark.parametrize("task", TASKS)
def test_a_equation_table_is_a_row_of_equations_per_cell(tmp_path, task):
    policy = printed_module.published_policy(task)
    shown = equation_table(policy)
    assert len(shown) == len(policy) and shown.shape[1] == 1 + len(policy.task.outputs)
    first = [float(c) for c in re.findall(r"-?\d+\.\d+", shown["codeword"][0])]
    assert first == pytest.approx(policy.codewords[0], abs=5e-4)
    signed = [float(s.replace(" ", "")) for s in re.findall(r"[+-]? ?\d+\.\d+", shown.iloc[0, 1])]
    assert signed == pytest.approx(policy.coefficients[0, :, 0], abs=5e-4)
    tex, csv = saved(tmp_path, policy.to_frame(), shown=shown)
    assert balanced(tex) and not unescaped(tex)
    back = pd.read_csv(csv).to_numpy()
    assert np.allclose(back[:, : len(policy.task.low)], policy.codewords, rtol=1e-5)


def test_a_shown_policy_says_where_its_equations_hold_and_what_limits_them():
    maps = np.array([[[1.0], [0.5], [0.25]], [[-2.0], [0.0], [0.0]]])
    two = VoronoiPolicy([[-1.0, 0.0], [0.0, 0.0]], maps, task=MOUNTAINCAR, scale=[0.5, 0.02], metric="euclidean")
    page = tables.show_policy(two, caption="A car.").data
    distance = "(Euclidean distance of states divided by (0.5, 0.02))"
    limits = "Limits: F from -1 to 1."
    assert f"<caption>A car. Each row holds where its codeword is the nearest {distance}. {limits}</caption>" in page
    assert page.count("<tr") == 3 and "1.000 x + 0.500 v + 0.250" in page
    one = VoronoiPolicy([[0.0, 0.0]], maps[:1], task=MOUNTAINCAR)
    page = tables.show_policy(one).data
    assert "One map for all states. Limits" in page and "codeword" not in page


@pytest.mark.parametrize("task", TASKS)
def test_the_spread_table_stands_beside_the_papers(task):
    teacher, runs = returns()
    frame = tables.spread_table(task, teacher, runs).set_index("metric")
    printed = printed_spread(task)
    assert frame.index.tolist() == printed.index.tolist() and frame.shape == (9, 4)
    assert frame["teacher, paper"].tolist() == printed["drl"].tolist()
    assert frame["distilled, paper"].tolist() == printed["ours"].tolist()


@pytest.mark.parametrize("task", TASKS)
def test_the_text_numbers_stand_beside_the_papers(task):
    teacher, runs = returns()
    frame = text_number_table(task, teacher, runs, cells=17).set_index("id")
    known = [name for name in frame.index if not pd.isna(frame.at[name, "paper"])]
    printed = printed_text_numbers().query("task == @task")["value"]
    assert len(known) > 8 and all(frame.at[name, "paper"] == printed[name] for name in known)
    results = [name for name in printed.dropna().index if re.match("(sg|mc)_(drl|ours)_|(sg|mc)_cells", name)]
    assert len(results) > 15 and set(results) <= set(frame.index)  # none that the paper's text prints is left out
    share = 100 * np.mean(runs.mean(axis=1) > teacher.mean())
    assert frame.at[f"{PREFIX[task]}_ours_runs_above_teacher_share", "here"] == pytest.approx(share)


def test_hyperparameters_per_cent_and_names_of_rows(tmp_path):
    assert hyperparameter_table(list(TASKS)).iloc[0].tolist() == ["n_epochs", 5000, 5000, 2000, 2000]
    tex, _ = saved(tmp_path, caption="5 %")
    assert r"5 \%" in tex and "$-$2" in tex
    named = pd.DataFrame({"a": [1]}, index=pd.Index(["x"], name="who"))
    assert cells(tables.show_table(named).data) == ["who", "a", "x", "1"]


def test_readings_are_the_fields_that_the_papers_table_does_not_print():
    frame = tables.interpretation_table(SIMPLEGOAL).set_index("reading")["default"]
    assert frame["split_lookup"] == Readings().split_lookup and "n_epochs" not in frame
    others = [*printed_hyperparameters(SIMPLEGOAL), *EXTENSIONS]
    fields = [field.name for kind in (Config, Readings) for field in dataclasses.fields(kind)]
    assert sorted([*frame.index, *others]) == sorted(fields)


def test_a_long_table_is_whole_in_the_csv_and_in_part_in_print(tmp_path):
    shown = save_table(FRAME, "some_table", caption="c", out=tmp_path, shown=FRAME[["value"]][:1])
    tex, csv = saved(tmp_path, shown=FRAME[["value"]][:1])
    assert "0.333" in shown.data and "a_b" not in shown.data
    assert "0.333" in tex and "a\\_b" not in tex and len(pd.read_csv(csv).columns) == 4


@pytest.mark.parametrize(("rows", "environment"), [(40, "table"), (41, "longtable")])
def test_a_table_of_more_than_a_page_is_a_longtable(tmp_path, rows, environment):
    tex, csv = saved(tmp_path, pd.DataFrame({"n": range(rows)}), "Many numbers.")
    assert f"\\begin{{{environment}}}" in tex and ("longtable" in tex) == (environment == "longtable")
    assert balanced(tex) and tex.count(r"\label{tab:some_table}") == 1 and tex.count(r"\caption{Many numbers.}") == 1
    assert len(pd.read_csv(csv)) == rows and f"\n{rows - 1} \\\\\n" in tex


# Tables for readers


def cells(page):
    """The texts of a table's cells, headers first."""
    return re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)


# Numbers


def test_as_text_by_hand():
    values = {"a_b": [1.23456, 0.0, np.nan], "n": [1e-4, -2.0, 0.0005], "c": [3, True, "x_y%"]}
    shown = as_text(pd.DataFrame(values, dtype=object))
    assert shown["a_b"].tolist() == ["1.235", "0.000", tables.MISSING]
    assert shown["n"].tolist() == ["0.0001", "-2.000", "0.0005"] and shown["c"].tolist() == ["3", "True", "x_y%"]
    few = as_text(pd.DataFrame({"cells": [13.0, np.nan], "median": [11.5, 2.0]}))
    assert few.values.tolist() == [["13", "11.5"], [tables.MISSING, "2.0"]]  # as few decimals as hold a column


@pytest.mark.parametrize(
    ("value", "text"),
    [(99.1234, "99.123"), (-148.60412, "-148.60"), (123456.78, "123,457"), (np.int64(10_000), "10,000")],
)  # fmt: skip
def test_five_digits_stand(value, text):
    assert as_text(pd.DataFrame({"a": [value, 0.12345]}, dtype=object))["a"][0] == text


# What a reader sees


def test_a_notebook_shows_no_row_numbers():
    page = tables.show_table(pd.DataFrame({"a": [7.25], "b": ["x < y"]})).data
    assert cells(page) == ["a", "b", "7.25", "x &lt; y"]
    odd = pd.DataFrame({"a": [7.25, 1.5]}, index=[4, 2])
    assert cells(tables.show_table(odd).data) == ["a", "7.25", "1.50"]


QUANTITIES = {"here": [24.0, 1.5], "low": [20.0, 1.25], "high": [30.0, 2.25]}
SHOWN = [  # a table's columns, their headings, its texts
    ({"quantity": ["outliers", "mean"]} | QUANTITIES, ["quantity", "here", "95 % interval"],
     [["outliers", "24", "20 to 30"], ["mean", "1.5", "1.25 to 2.25"]]),  # each row another quantity: counts
    ({"task": ["a", "b"]} | QUANTITIES, ["task", "here", "95 % interval"],
     [["a", "24.0", "20.00 to 30.00"], ["b", "1.5", "1.25 to 2.25"]]),
    ({"wide": [True, False], "default": [False, "raw"]}, ["wide", "default"], [["yes", "no"], ["", "raw"]]),
    ({"wide": [False], "good": [np.nan]}, ["wide", "as good (%)"], [["", tables.MISSING]]),
    ({"mean": [1.0], "failing": [0.00025], "task": ["MountainCarContinuous-v0"]},
     ["mean return", "failed (%)", "task"], [["1", "0.025", "MountainCar"]]),
    ({"mean": [2.0], "low": [1.25], "high": [2.5], "both_low": [0.831], "both_high": [1.0]},
     ["mean return", "95 % interval", "both (%): 95 % interval"], [["2", "1.25 to 2.5", "83.1 to 100"]]),
    ({"low": [np.nan], "high": [np.nan]}, ["95 % interval"], [[tables.MISSING]]),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "headings", "texts"), SHOWN)
def test_a_reader_sees_words_shares_in_per_cent_and_intervals(columns, headings, texts):
    frame = pd.DataFrame(columns)
    before, found = frame.copy(), present(frame)
    assert found.columns.tolist() == headings and as_text(found).values.tolist() == texts and frame.equals(before)


# Captions


def test_figures_and_tables_are_numbered_apart_in_each_notebook():
    names = ("figures", "teacher_policies"), ("figures", "voronoi_example"), ("tables", "hyperparameters")
    assert [captions.caption_of(*name).label for name in names] == ["Figure 1.2", "Figure 2.1", "Table 4.6"]
    caption = captions.Caption("Figure 1.1", "A < B.")
    assert caption.to_html("figcaption") == "<figcaption><b>Figure 1.1.</b> A &lt; B.</figcaption>"


def test_what_goes_beyond_the_paper_has_folders_of_its_own():
    places = [captions.file_of(kind, name, "") for kind in ("figures", "tables") for name in ("x", "beyond/x")]
    parts = "figures/x", "figures/beyond/x", "figures/tables/x", "figures/beyond/tables/x"
    assert [place.as_posix() for place in places] == [*parts]


def test_numbers_have_true_minus_signs_and_intervals_do_not_wrap():
    row = {"low": [-2.5], "high": [-1.25], "task": ["Pendulum-v1"], "code": ["$x-1$"], "name": ["1-2 to -3"]}
    page = tables.show_table(pd.DataFrame(row)).data
    assert cells(page)[-4:] == ["−2.5\xa0to\xa0−1.25", "Pendulum", "$x-1$", "1-2\xa0to\xa0−3"] and "95\xa0%" in page


def test_a_table_stands_below_its_caption_and_a_long_one_is_folded():
    page = tables.show_table(pd.DataFrame({"a": range(13)}), "hyperparameters").data
    assert re.match(r"<details><summary><b>Table 4.6.</b> \w.*</summary>\n<table", page) and "13 rows</caption>" in page
    assert "<details>" not in tables.show_table(pd.DataFrame({"a": range(12)}), caption="Mine.").data
    frame = pd.DataFrame({"a": [1]})
    page = tables.show_table(frame, "hyperparameters").data
    assert re.search(r"<table[^>]*>\s*<caption><b>Table 4.6.</b> \w.*</caption>", page)
    assert "<caption>Mine.</caption>" in tables.show_table(frame, caption="Mine.").data
    assert "caption" not in tables.show_table(frame, "unknown").data
