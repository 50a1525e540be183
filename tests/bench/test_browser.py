"""The method as the browser runs it, with draws of its own, beside the committed runs: `make bench`."""

import json
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from scipy import stats

from vsp.paper.results import read_results
from vsp.show.explorer.scene import bench_of

MOST = {"cells": 0.5, "splits": 2, "merges": 2, "failing": 0.01}  # differences of means
N_RUNS = 85


@pytest.mark.parametrize("name", ["SimpleGoal-v0", "MountainCarContinuous-v0"])
def test_free_runs_are_like_pythons(name, record):
    command = ["node", "--no-warnings", Path(__file__).with_name("free_runs.mjs")]
    given = json.dumps(bench_of(name) | {"seeds": list(range(N_RUNS))})
    told = pd.DataFrame(json.loads(subprocess.check_output(command, input=given, text=True)))
    runs = read_results(name).assign(failing=lambda rows: 1 - rows["goal"])
    for what, most in MOST.items():
        pair = told[what], runs[what]
        gap, mean = pair[0].mean() - pair[1].mean(), lambda a, b: a.mean() - b.mean()
        low, high = stats.ttest_ind(*pair, equal_var=False).confidence_interval()
        p = stats.permutation_test(pair, mean, n_resamples=9999, rng=0).pvalue
        note = f"{pair[0].mean():.4g}, in {len(runs)} runs of Python {pair[1].mean():.4g}; permutations: p = {p:.2f}"
        record("same", f"{what} in the browser, {name}", abs(gap), what, at_most=most, low=low, high=high, note=note)
