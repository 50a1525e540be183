"""Measure how look-ups, neighbour graphs and fits scale: with dimensions, codewords, cells and states.

The paper names many dimensions as a limit of kd-trees and of Delaunay triangulations. Codewords are uniform in the unit
cube, which is equally hard for all methods. A fit is some 700 evaluations of a loss and its gradient
(`few_cells.search`), so one evaluation is measured: its states are normally distributed, its actions those of a
limited linear map. Times are processor time of one thread, and differ from run to run.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp import geometry
from vsp.run.machine import cpu_type
from vsp.run.progress import progress
from vsp_beyond.few_cells.search import CLIP_SLOPES, TEMPERATURES, whole_loss
from vsp_beyond.few_cells.units import Cells, LabelledStates

from .results import write_results

DIMENSIONS = (2, 3, 4, 6, 8, 11, 17)  # 8, 11 and 17 are those of LunarLander, Hopper and HalfCheetah
CODEWORDS, OF_GRAPHS = (10, 30, 100, 300, 1000), 100
DELAUNAY_UP_TO = 8  # dimensions; with 11 Qhull takes minutes, and gigabytes of memory
N_STATES = 1000  # looked up at once, as in an evaluation of 1000 episodes
FIT = {"dimensions": 17, "cells": 8, "states": 32_768}  # those of HalfCheetah; one of these varies at a time
VARIED = {
    "dimensions": (2, 4, 8, 17, 32, 64), "cells": (1, 2, 4, 8, 16, 32, 64), "states": (1024, 4096, 16_384, 65_536),
}  # fmt: skip
N_ACTIONS = 6


def nearest_by_product(codewords: np.ndarray, states: np.ndarray, metric: str = "euclidean") -> np.ndarray:
    """Find the nearest codewords by one matrix product. Euclidean distance only.

    Uses |s - c|^2 = |s|^2 + |c|^2 - 2 s.c, where |s|^2 is the same for all codewords.
    """
    gaps = states @ (-2 * codewords.T)
    gaps += np.square(codewords).sum(axis=1)  # in place, because memory is slower than arithmetic
    return gaps.argmin(axis=1)


LOOKUPS = {
    ("cdist", "euclidean"): partial(geometry.nearest, kdtree=False),
    ("cdist", "manhattan"): partial(geometry.nearest, kdtree=False),
    ("matrix product", "euclidean"): nearest_by_product,
    ("kd-tree", "euclidean"): partial(geometry.nearest, kdtree=True),
    ("kd-tree", "manhattan"): partial(geometry.nearest, kdtree=True),
}


def seconds(work: Callable[[], object], *, total: float = 0.1) -> float:
    """Return the minimum processor time of `work` over calls that together take `total` seconds."""
    times: list[float] = []
    while not times or sum(times) < total:
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def lookup(dimensions: tuple[int, ...] = DIMENSIONS, codewords: tuple[int, ...] = CODEWORDS) -> pd.DataFrame:
    """Time look-ups of `N_STATES` states, including building the kd-tree, and graphs of `OF_GRAPHS` codewords.

    Columns: what ("look-up" or "graph"), method, metric, d, k (codewords), seconds.
    """
    rows = []
    for d in progress(dimensions, "look-ups", total=len(dimensions), unit="dimensions"):
        states, about = np.random.default_rng(d).random((N_STATES, d)), {"what": "look-up", "d": d}
        for k in codewords:
            points = np.random.default_rng([d, k]).random((k, d))
            for (method, metric), look_up in LOOKUPS.items():
                took = seconds(partial(look_up, points, states, metric))
                rows.append({**about, "method": method, "metric": metric, "k": k, "seconds": took})
        points, about = np.random.default_rng([d, OF_GRAPHS]).random((OF_GRAPHS, d)), {"what": "graph", "d": d}
        graphs = {"witnesses": partial(geometry.lookup_neighbours, points, np.zeros(d), np.ones(d), "euclidean")}
        graphs |= {"Delaunay": partial(geometry.delaunay_neighbours, points)} if d <= DELAUNAY_UP_TO else {}
        for method, graph in graphs.items():
            took = seconds(graph)
            rows.append({**about, "method": method, "metric": "euclidean", "k": OF_GRAPHS, "seconds": took})
    return pd.DataFrame(rows).sort_values("what", ascending=False, kind="stable")


def evaluation(d: int, k: int, n: int) -> Callable[[], object]:
    """Return a function that evaluates the loss of k cells and its gradient, on n states with d inputs."""
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(size=(n, d)), np.ones(n)])
    cells = Cells(rng.normal(size=(k, d)), rng.normal(size=(k, d + 1, N_ACTIONS)) / np.sqrt(d + 1))
    actions = np.clip(inputs @ cells.maps[0], -1.0, 1.0)
    stage = len(TEMPERATURES) // 2
    about = {"temperature": TEMPERATURES[stage] * d, "clip_slope": CLIP_SLOPES[stage]}
    return partial(whole_loss, cells, LabelledStates(inputs, actions), **about)


def fits(varied: dict[str, tuple[int, ...]] = VARIED) -> pd.DataFrame:
    """Measure evaluations, one row each.

    Columns: varied (which quantity), dimensions, cells, states, seconds, megabytes (in addition to the states).
    """
    rows, cases = [], [(name, value) for name, values in varied.items() for value in values]
    for name, value in progress(cases, "fits", total=len(cases), unit="sizes"):
        size = FIT | {name: value}
        work = evaluation(*size.values())
        took = seconds(work, total=0.5)
        tracemalloc.start()
        work()
        megabytes = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        rows.append({"varied": name, **size, "seconds": took, "megabytes": megabytes})
    return pd.DataFrame(rows)


def main() -> None:
    """Measure, in two minutes, and write OUT/data/beyond/lookup.csv and fits.csv."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="the results go to OUT/data/beyond")
    out = parser.parse_args().out
    with threadpool_limits(1):
        for name, measured in (("lookup", lookup), ("fits", fits)):
            write_results(measured().assign(machine=cpu_type()), name, out=out, float_format="%.4g")


if __name__ == "__main__":
    main()
