import re

import numpy as np
import pandas as pd
import pytest
from vsp.paper.shown import MISSING, as_text, present, show_table

from vsp.show import captions


def cells(page):
    """The texts of a table's cells, headers first."""
    return re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)


# Numbers


def test_as_text_by_hand():
    values = {"a_b": [1.23456, 0.0, np.nan], "n": [1e-4, -2.0, 0.0005], "c": [3, True, "x_y%"]}
    shown = as_text(pd.DataFrame(values, dtype=object))
    assert shown["a_b"].tolist() == ["1.235", "0.000", MISSING]
    assert shown["n"].tolist() == ["0.0001", "-2.000", "0.0005"] and shown["c"].tolist() == ["3", "True", "x_y%"]


def test_a_column_has_as_few_decimals_as_hold_it():
    shown = as_text(pd.DataFrame({"cells": [13.0, np.nan], "median": [11.5, 2.0], "share": [1 / 3, 0.5]}))
    assert shown.values.tolist() == [["13", "11.5", "0.333"], [MISSING, "2.0", "0.500"]]


@pytest.mark.parametrize(
    ("value", "text"),
    [(99.1234, "99.123"), (-148.60412, "-148.60"), (8371.0716, "8371.1"), (123456.78, "123,457"),
     (1_600_000, "1,600,000"), (9999, "9999"), (np.int64(10_000), "10,000"), (np.inf, "inf")],
)  # fmt: skip
def test_five_digits_stand(value, text):
    assert as_text(pd.DataFrame({"a": [value, 0.12345]}, dtype=object))["a"][0] == text


# What a reader sees


def test_a_notebook_shows_no_row_numbers():
    page = show_table(pd.DataFrame({"a": [7.25], "b": ["x < y"]})).data
    assert cells(page) == ["a", "b", "7.25", "x &lt; y"]
    odd = pd.DataFrame({"a": [7.25, 1.5]}, index=[4, 2])
    assert cells(show_table(odd).data) == ["a", "7.25", "1.50"]


def test_rows_with_names_keep_them():
    named = pd.DataFrame({"a": [1, 2]}, index=["x", "y"])
    assert cells(show_table(named).data) == ["", "a", "x", "1", "y", "2"]
    assert cells(show_table(named.rename_axis("input")).data)[:2] == ["input", "a"]
    nested = pd.concat({"one": named, "two": named})
    assert cells(show_table(nested).data)[3:6] == ["one", "x", "1"]


def test_counts_have_no_decimals_where_each_row_is_another_quantity():
    frame = pd.DataFrame(
        {"quantity": ["outliers", "mean"], "here": [24.0, 1.5], "low": [20.0, 1.25], "high": [30.0, 2.25]}
    )
    assert as_text(present(frame)).values.tolist() == [["outliers", "24", "20 to 30"], ["mean", "1.5", "1.25 to 2.25"]]
    same = frame.rename(columns={"quantity": "task"})
    assert as_text(present(same)).values.tolist()[0] == ["outliers", "24.0", "20.00 to 30.00"]


def test_no_is_said_among_other_values_only():
    found = present(pd.DataFrame({"wide": [True, False], "default": pd.Series([False, "raw"], dtype=object)}))
    assert found.values.tolist() == [["yes", "no"], ["", "raw"]]


def test_headings_are_words_and_shares_are_per_cent():
    found = present(
        pd.DataFrame({"mean": [1.0], "failing": [0.00025], "task": ["MountainCarContinuous-v0"], "wide": [True]})
    )
    assert found.to_dict("records") == [
        {"mean return": 1.0, "failed (%)": "0.025", "task": "MountainCar", "wide": "yes"},
    ]  # fmt: skip
    assert present(pd.DataFrame({"wide": [False], "good": [np.nan]})).values.tolist() == [["", MISSING]]


def test_an_interval_is_one_column():
    rows = {"mean": [2.0], "low": [1.25], "high": [2.5], "both_low": [0.831], "both_high": [1.0]}
    found = present(pd.DataFrame(rows))
    assert found.columns.tolist() == ["mean return", "95 % interval", "both (%): 95 % interval"]
    assert found.iloc[0].tolist() == [2.0, "1.25 to 2.5", "83.1 to 100"]
    assert present(pd.DataFrame({"low": [np.nan], "high": [np.nan]})).iloc[0].tolist() == [MISSING]


def test_the_frame_that_came_in_stays_as_it_is():
    frame = pd.DataFrame({"failing": [0.5], "low": [1.0], "high": [2.0]})
    before = frame.copy()
    present(frame)
    assert frame.equals(before)


# Captions


@pytest.fixture
def book(tmp_path, monkeypatch):
    path = tmp_path / "captions.toml"
    path.write_text(
        '[01_x.figures.a]\ncaption = "A < B."\nalt = "a"\n[01_x.tables.a]\ncaption = "T."\n'
        '[01_x.figures.b]\ncaption = "B."\nalt = "b"\n[02_y.tables.c]\ncaption = "C."\n'
    )
    monkeypatch.setattr(captions, "BOOK", path)
    captions._book.cache_clear()
    yield
    captions._book.cache_clear()


def test_figures_and_tables_are_numbered_apart_in_each_notebook(book):
    labels = [captions.caption_of(kind, name).label for kind, name in
              (("figures", "a"), ("tables", "a"), ("figures", "b"), ("tables", "c"))]  # fmt: skip
    assert labels == ["Figure 1.1", "Table 1.1", "Figure 1.2", "Table 2.1"]
    assert (
        captions.caption_of("figures", "a").to_html("figcaption")
        == "<figcaption><b>Figure 1.1.</b> A &lt; B.</figcaption>"
    )


def test_a_table_stands_below_its_caption(book):
    frame = pd.DataFrame({"a": [1]})
    assert re.search(r"<table[^>]*>\s*<caption><b>Table 2.1.</b> C.</caption>", show_table(frame, "c").data)
    assert "<caption>Mine.</caption>" in show_table(frame, caption="Mine.").data
    assert "caption" not in show_table(frame, "unknown").data


def test_a_figure_of_ones_own_says_what_it_shows(book):
    assert captions.caption_of("figures", "mine", text="Seen.", alt="x") == captions.Caption("", "Seen.", "x")
    with pytest.raises(ValueError, match="figure 'mine' has no alternative text: pass alt= or add it to notebooks"):
        captions.caption_of("figures", "mine")
