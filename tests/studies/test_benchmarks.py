import numpy as np
import pandas as pd
import pytest

from studies import benchmarks
from studies.results import read_results
from vsp import geometry
from vsp_beyond.few_cells.units import Cells


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(benchmarks, "DIMENSIONS", (2, 9))
    monkeypatch.setattr(benchmarks, "CODEWORDS", (100,))
    monkeypatch.setattr(benchmarks, "VARIED", {"cells": (1, 2)})
    monkeypatch.setattr(benchmarks, "FIT", {"dimensions": 3, "cells": 2, "states": 50})


def test_all_ways_to_look_up_agree_and_delaunay_ends_where_it_takes_long(few):
    found = {tuple(about.values()): work() for about, work in benchmarks.look_ups()}
    for d in (2, 9):
        brute, product, tree = (found["look-up", d, name, 100] for name in ("cdist", "matrix product", "kd-tree"))
        assert len(brute) == benchmarks.N_STATES and np.array_equal(brute, product) and np.array_equal(brute, tree)
    graph, exact = (found["graph", 2, name, 100] for name in ("witnesses", "Delaunay"))
    assert not (graph & ~exact).any() and ("graph", 9, "Delaunay", 100) not in found


def test_an_evaluation_is_that_of_the_loss(few):
    (_, one), (about, two) = benchmarks.evaluations()
    assert about == {"varied": "cells", "dimensions": 3, "cells": 2, "states": 50}
    cells = two.args[0]
    assert isinstance(cells, Cells) and len(cells.codewords) == 2 and len(one.args[0].codewords) == 1
    assert np.isfinite(two()[0])


def test_the_command_writes_both_tables(few, tmp_path, monkeypatch):
    monkeypatch.setattr(benchmarks, "seconds", lambda work: 0.125)
    monkeypatch.setattr("sys.argv", ["x", "--out", str(tmp_path)])
    benchmarks.main()
    for name in ("lookup", "fits"):
        made = pd.read_csv(tmp_path / f"data/beyond/{name}.csv")
        assert list(made) == list(read_results(name)) and set(made["seconds"]) == {0.125}


def test_the_kd_tree_pays_from_about_as_many_codewords_as_the_look_up_assumes():
    times = read_results("lookup").query("d == 2").pivot(index="k", columns="method", values="seconds")
    faster = times["kd-tree"] < times["cdist"]
    assert (
        not faster[times.index <= geometry.KDTREE_FROM / 4].any() and faster[times.index > geometry.KDTREE_FROM].all()
    )
