import numpy as np
import pandas as pd
import pytest

from studies import benchmarks
from studies.results import read_results
from vsp_beyond.few_cells.units import Cells


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(benchmarks, "DIMENSIONS", (2, 9))
    monkeypatch.setattr(benchmarks, "VARIED", {"cells": (1, 2)})
    monkeypatch.setattr(benchmarks, "FIT", {"dimensions": 3, "cells": 2, "states": 50})


def test_all_ways_to_look_up_agree_and_delaunay_ends_where_it_takes_long(few):
    found = {tuple(about.values()): work() for about, work in benchmarks.look_ups()}
    for d in (2, 9):
        product, tree = found[d, "matrix product", 100], found[d, "kd-tree", 100]
        assert len(product) == benchmarks.N_STATES and np.array_equal(product, tree)
    assert not (found[2, "witnesses", 100] & ~found[2, "Delaunay", 100]).any() and (9, "Delaunay", 100) not in found


def test_an_evaluation_is_that_of_the_loss(few):
    (_, one), (about, two) = benchmarks.evaluations()
    assert about == {"varied": "cells", "dimensions": 3, "cells": 2, "states": 50}
    cells = two.args[0]
    assert isinstance(cells, Cells) and len(cells.codewords) == 2 and len(one.args[0].codewords) == 1
    assert np.isfinite(two()[0])


def test_seconds_are_those_of_the_quickest_call(monkeypatch):
    monkeypatch.setattr("studies.benchmarks.time.process_time", iter([0.0, 0.3, 1.0, 1.1, 2.0, 2.2]).__next__)
    assert benchmarks.seconds(lambda: None) == pytest.approx(0.1)


def test_the_command_writes_both_tables(few, tmp_path, monkeypatch):
    monkeypatch.setattr(benchmarks, "seconds", lambda work: 0.125)
    monkeypatch.setattr("sys.argv", ["x", "--out", str(tmp_path)])
    benchmarks.main()
    for name in ("lookup", "fits"):
        made = pd.read_csv(tmp_path / f"data/beyond/{name}.csv")
        assert list(made) == list(read_results(name)) and set(made["seconds"]) == {0.125}
