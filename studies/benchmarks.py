"""Measure how look-ups, neighbour graphs and fits scale: with dimensions, codewords, cells and states.

The paper names many dimensions as a limit of kd-trees and of Delaunay triangulations. Codewords are uniform in the unit
cube, which is equally hard for all methods; distances are Euclidean. A fit is some 700 evaluations of a loss and its
gradient (`few_cells.search`), so one evaluation is measured: its states are normally distributed, its actions those of
a limited linear map. Times are processor time of one thread, and differ from run to run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp import geometry
from vsp.run import kernels
from vsp_beyond.few_cells.search import CLIP_SLOPES, TEMPERATURES, whole_loss
from vsp_beyond.few_cells.units import Cells, LabelledStates

from .results import write_results

DIMENSIONS = (2, 8, 17)  # 8 and 17 are those of LunarLander and HalfCheetah
N_CODEWORDS = 100
DELAUNAY_UP_TO = 8  # dimensions; with 11 Qhull takes minutes, and gigabytes of memory
N_STATES = 1000  # looked up at once, as in an evaluation of 1000 episodes
FIT = {"dimensions": 17, "cells": 8, "states": 32_768}  # those of HalfCheetah; one of these varies at a time
VARIED = {"dimensions": (2, 64), "cells": (1, 64), "states": (1024, 65_536)}


def nearest_by_product(codewords: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Find the nearest codewords by one matrix product.

    Uses |s - c|^2 = |s|^2 + |c|^2 - 2 s.c, where |s|^2 is the same for all codewords.
    """
    gaps = states @ (-2 * codewords.T)
    gaps += np.square(codewords).sum(axis=1)  # in place, because memory is slower than arithmetic
    return gaps.argmin(axis=1)


def look_ups() -> Iterator[tuple[dict, Callable[[], object]]]:
    """Yield what is measured, and how: d, method, k (codewords).

    A look-up (kd-tree, matrix product) is that of `N_STATES` states, including building the kd-tree. The others find
    the neighbour graph of the codewords.
    """
    for d in DIMENSIONS:
        states = np.random.default_rng(d).random((N_STATES, d))
        codewords = np.random.default_rng([d, N_CODEWORDS]).random((N_CODEWORDS, d))
        ways: dict[str, Callable[[], object]] = {
            "matrix product": partial(nearest_by_product, codewords, states),
            "kd-tree": partial(geometry.nearest, codewords, states, "euclidean", kdtree=True),
            "witnesses": partial(geometry.lookup_neighbours, codewords, np.zeros(d), np.ones(d), "euclidean"),
        }
        if d <= DELAUNAY_UP_TO:
            ways["Delaunay"] = partial(geometry.delaunay_neighbours, codewords)
        for method, work in ways.items():
            yield {"d": d, "method": method, "k": N_CODEWORDS}, work


def evaluations() -> Iterator[tuple[dict, Callable[[], object]]]:
    """Yield evaluations of the loss and its gradient: which quantity is varied, dimensions, cells, states."""
    stage = len(TEMPERATURES) // 2
    for varied, values in VARIED.items():
        for value in values:
            size = FIT | {varied: value}
            (d, k, n), rng = size.values(), np.random.default_rng(0)
            inputs = np.column_stack([rng.normal(size=(n, d)), np.ones(n)])
            cells = Cells(rng.normal(size=(k, d)), rng.normal(size=(k, d + 1, 6)) / np.sqrt(d + 1))
            labelled = LabelledStates(inputs, np.clip(inputs @ cells.coefficients[0], -1.0, 1.0))
            about = {"temperature": TEMPERATURES[stage] * d, "clip_slope": CLIP_SLOPES[stage]}
            yield {"varied": varied, **size}, partial(whole_loss, cells, labelled, **about)


def seconds(work: Callable[[], object], *, total: float = 0.5) -> float:
    """Return the minimum processor time of `work` over calls that together take `total` seconds."""
    times: list[float] = []
    while not times or sum(times) < total:
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def main() -> None:
    """Measure, in two minutes, and write OUT/data/beyond/lookup.csv and fits.csv."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="the results go to OUT/data/beyond")
    out = parser.parse_args().out
    with threadpool_limits(1):
        for name, cases in (("lookup", look_ups), ("fits", evaluations)):
            frame = pd.DataFrame([{**about, "seconds": seconds(work)} for about, work in cases()])
            write_results(frame.assign(machine=kernels.name()), name, out=out, float_format="%.4g")


if __name__ == "__main__":
    main()
