"""`make paper-figures` from nothing, with the environment in place, and once more."""

import os
import statistics
import subprocess
import time

from vsp.run.atomic import ROOT

OF_MAKE = ("MAKE", "MFLAGS", "OUT", "JOBS", "QUICK", "DASK")  # of the make that runs this
SECONDS = 180  # on two cores


def test_paper_figures(tmp_path, record):
    times, again = [], []
    env = {name: value for name, value in os.environ.items() if not name.startswith(OF_MAKE)}
    for i in range(5):
        for seconds in (times, again):
            begin = time.perf_counter()
            command = ["make", "-C", ROOT, "paper-figures", f"OUT={tmp_path / str(i)}"]
            subprocess.run(command, check=True, capture_output=True, env=env)
            seconds.append(time.perf_counter() - begin)
    note, what = f"on {os.cpu_count()} cores", "`make paper-figures` from nothing"
    record("speed", what, statistics.median(times), "s", at_most=SECONDS, low=min(times), high=max(times), note=note)
    what = "a second `make paper-figures`"
    record("speed", what, statistics.median(again), "s", at_most=1, low=min(again), high=max(again))
