import numpy as np
import pandas as pd
import pytest

from vsp import figures_trust
from vsp.scaling import TEN_TASKS


def measured(n=5):
    sizes = 10 ** np.arange(n)
    frame = pd.DataFrame({"what": "a", "over": "cells", "size": sizes, "seconds": 2.0 * sizes, "megabytes": 1.0})
    return pd.concat([frame, frame.assign(what="b", seconds=3.0)])


def test_growth_has_marks_and_a_fitted_line_for_each_thing(ax):
    figures_trust.growth(ax, measured())
    marks = [line for line in ax.lines if line.get_marker() not in ("", "None")]
    assert [line.get_ydata().tolist() for line in marks] == [[2, 20, 200, 2000, 20000], [3.0] * 5]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a, $n^{1.0}$", "b, $n^{0.0}$"]
    assert (ax.get_xscale(), ax.get_yscale(), ax.get_xlabel()) == ("log", "log", "$n$ = cells") and len(ax.lines) == 4


def test_an_axis_of_few_decades_has_numbers_between_them(ax):
    frame = measured(5)
    figures_trust.growth(ax, frame[frame["size"] < 100])
    ax.figure.canvas.draw()
    for axis, label in ((ax.xaxis, "5"), (ax.yaxis, "20")):
        shown = [text.get_text() for text in axis.get_ticklabels(which="both")]
        assert label in shown and not any("times" in text for text in shown)


def test_few_sizes_are_joined_and_not_fitted(ax):
    figures_trust.growth(ax, measured(2), "megabytes")
    assert len(ax.lines) == 2 and ax.get_ylabel() == "megabytes"
    ax.clear()
    figures_trust.growth(ax, measured(), law=False)
    assert len(ax.lines) == 2 and ax.lines[0].get_linestyle() == "-"


def test_what_has_no_such_quantity_is_not_drawn(ax):
    figures_trust.growth(ax, pd.concat([measured(), measured().assign(what="c", seconds=np.nan)]))
    assert len(ax.get_legend().get_texts()) == 2


def test_kills_that_held_and_others(ax):
    frame = pd.DataFrame(
        {"moment": [1.0, 2.0, 3.0], "again": [9.0, 8.0, 7.0], "undisturbed": 10.0, "wrong": [None, "x", None]}
    )
    figures_trust.kills(ax, frame)
    line, held, other = ax.lines
    assert held.get_xydata().tolist() == [[0.1, 0.9], [0.3, 0.7]] and other.get_xydata().tolist() == [[0.2, 0.8]]
    assert set(line.get_ydata()) == {1} and ax.get_ylim()[0] == 0
    ax.clear()
    assert len(figures_trust.kills(ax, frame.assign(wrong=None)).lines) == 2


ROWS = pd.DataFrame(
    {
        "what": ["C against the teacher's, here, MountainCarContinuous-v0", "memory", "evaluation"],
        "to hold": ["1000 times", "bounded", "100 times"],
        "measured": ["5400 times (5000 to 6000): 1 s against 2 s", "2 MB", "72.5 times (70 to 80)"],
        "held": ["yes", "yes", "no"],
    }
)


def test_ratios_are_read_where_both_columns_tell_one(ax):
    frame = figures_trust.told(ROWS)
    assert frame["times"].tolist() == [5400, 72.5] and frame["wanted"].tolist() == [1000, 100]
    assert frame["what"].tolist() == ["C, MountainCar", "evaluation"]
    figures_trust.ratios(ax, frame)
    assert [patch.get_width() for patch in ax.patches] == [5400, 72.5] and ax.get_xscale() == "log"
    assert ax.lines[0].get_xdata().tolist() == [1000, 100]
    assert [text.get_text() for text in ax.texts] == ["5,400×", "72.5×"]


def test_costs_add_up(ax):
    parts = ("teacher", "physics", "distillation", "evaluation")
    frame = pd.DataFrame([{"task": task.name, "d": task.d} for task in TEN_TASKS]).assign(
        **{part: np.arange(10.0) + i for i, part in enumerate(parts)}
    )
    figures_trust.costs(ax, frame)
    ends = [bar.get_x() + bar.get_width() for bar in ax.containers[-1]]
    assert ends == pytest.approx(frame[list(parts)].sum(axis=1).tolist()) and len(ax.containers) == 4
