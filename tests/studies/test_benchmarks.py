import numpy as np
import pandas as pd
from drawn import named

from studies.benchmarks import lookup
from studies.show import benchmarks


def test_times_over_dimension_mark_where_a_method_was_given_up(ax):
    taken = {2: 1e-3, 6: 1.0, 8: np.nan, 11: np.nan}
    rows = [("Delaunay", "euclidean", d, seconds) for d, seconds in taken.items()]
    rows += [("kd-tree", "manhattan", d, 1e-2) for d in taken]
    benchmarks.times_over_dimension(ax, pd.DataFrame(rows, columns=["method", "metric", "d", "seconds"]), limit=5.0)
    lines = named(ax)
    assert list(lines) == ["Delaunay", "kd-tree, Manhattan"] and lines["kd-tree, Manhattan"].get_linestyle() == "--"
    assert lines["Delaunay"].get_xydata()[:2].tolist() == [[2, 1e-3], [6, 1.0]]
    (cross,) = (line for line in ax.lines if line.get_marker() == "x")
    assert cross.get_xydata().tolist() == [[8, 5.0]] and cross.get_color() == lines["Delaunay"].get_color()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert [t.get_text() for t in ax.get_xticklabels()] == ["2", "6", "8", "11"]


def test_every_measured_method_has_a_colour():
    assert set(benchmarks._METHODS) == {method for method, _ in lookup.LOOKUPS} | set(lookup.GRAPHS)


def test_kills_are_shares_of_the_undisturbed_time_and_failures_stand_out(ax):
    frame = pd.DataFrame({"moment": [1.0, 2, 3], "again": [9.0, 8, 7], "undisturbed": 10.0, "wrong": [None, "x", None]})
    benchmarks.kills(ax, frame)
    line, held, other = ax.lines
    assert held.get_xydata().tolist() == [[0.1, 0.9], [0.3, 0.7]] and other.get_xydata().tolist() == [[0.2, 0.8]]
    assert set(line.get_ydata()) == {1} and ax.get_ylim()[0] == 0
    ax.clear()
    assert len(benchmarks.kills(ax, frame.assign(wrong=None)).lines) == 2


def test_times_of_fits_stand_beside_what_is_proportional(ax):
    rows = [("cells", 1, 0.002), ("cells", 8, 0.01), ("states", 8, 0.5)]
    benchmarks.fit_times(ax, pd.DataFrame(rows, columns=["varied", "cells", "seconds"]), "cells")
    lines = named(ax)
    assert lines["measured"].get_xydata().tolist() == [[1, 2], [8, 10]]
    assert lines["proportional"].get_xydata().tolist() == [[1, 10 / 8], [8, 10]]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["1", "8"] and ax.get_xlabel() == "cells"
