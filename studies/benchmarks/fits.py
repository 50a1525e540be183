"""Benchmark the time and memory of a fit against dimensions, cells and states.

A fit is some 700 evaluations of the loss and its gradient (`few_cells.search`), so one evaluation is measured. No task
is needed: states are normally distributed, and actions are those of a limited linear map. One quantity varies at a
time; the others are those of HalfCheetah. The command writes data/results/fits.csv. Times are processor time of one
thread and differ from run to run. Memory is NumPy's peak allocation.
"""

from __future__ import annotations

import argparse
import tracemalloc
from functools import partial

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp.paper.results import settings_id, write_results
from vsp.run.machine import cpu_type
from vsp.run.progress import progress
from vsp_beyond.few_cells.search import CLIP_SLOPES, TEMPERATURES, whole_loss
from vsp_beyond.few_cells.units import Cells, LabelledStates

from .lookup import seconds

VERSION = 1  # raise it when the way of measuring changes
N_ACTIONS = 6
USUAL = {"dimensions": 17, "cells": 8, "states": 32_768}
VARIED = {
    "dimensions": (2, 4, 8, 17, 32, 64), "cells": (1, 2, 4, 8, 16, 32, 64),
    "states": (1024, 4096, 16_384, 65_536),
}  # fmt: skip
_STAGE = len(TEMPERATURES) // 2


def evaluation(d: int, k: int, n: int):
    """Return a function that evaluates the loss of k cells and its gradient.

    It uses n states with d inputs, and `N_ACTIONS` actions.
    """
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(size=(n, d)), np.ones(n)])
    cells = Cells(rng.normal(size=(k, d)), rng.normal(size=(k, d + 1, N_ACTIONS)) / np.sqrt(d + 1))
    actions = np.clip(inputs @ cells.coefficients[0], -1.0, 1.0)
    about = {"temperature": TEMPERATURES[_STAGE] * d, "clip_slope": CLIP_SLOPES[_STAGE]}
    return partial(whole_loss, cells, LabelledStates(inputs, actions), **about)


def study(varied: dict[str, tuple[int, ...]] = VARIED) -> pd.DataFrame:
    """Run all measurements, one row each.

    Columns: varied (which quantity), dimensions, cells, states, seconds, megabytes (in addition to the states), and
    what identifies the table.
    """
    found, cases = [], [(name, value) for name, values in varied.items() for value in values]
    with threadpool_limits(1):
        for name, value in progress(cases, "fits", total=len(cases), unit="sizes"):
            size = USUAL | {name: value}
            work = evaluation(size["dimensions"], size["cells"], size["states"])
            taken, _ = seconds(work, total=0.5)
            tracemalloc.start()
            work()
            megabytes = tracemalloc.get_traced_memory()[1] / 1e6
            tracemalloc.stop()
            found.append({"varied": name, **size, "seconds": taken, "megabytes": megabytes})
    return pd.DataFrame(found).assign(machine=cpu_type(), **made_with(varied))


def made_with(varied: dict[str, tuple[int, ...]] = VARIED) -> dict[str, str | int]:
    """Return what identifies the table: settings (an id) and version."""
    return {"settings": settings_id({"fits": [varied, USUAL, N_ACTIONS]}), "version": VERSION}


def main() -> None:
    """Measure fits, in under a minute, and write OUT/data/results/fits.csv."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="the result goes to OUT/data/results")
    write_results(study(), "fits", out=parser.parse_args().out, float_format="%.4g")


if __name__ == "__main__":
    main()
