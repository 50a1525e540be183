"""How long the parts take: `make bench`. test_speed.py compares whole runs and episodes with the direct way."""

import statistics
import time
from dataclasses import replace

import pytest

import vsp
from vsp.paper import printed
from vsp.show.laboratory import DRAWN, Laboratory


@pytest.mark.parametrize("task", printed.TASKS)
def test_a_trial_of_the_laboratory(task, record):
    """With every class of sub-policy, in the smallest cells that the slider allows."""
    times = {}
    for sub_policy in DRAWN:
        lab = Laboratory(vsp.load_teacher(task), task, replace(vsp.preset(task), sub_policy=sub_policy))
        distance, begin = lab.settings["min_pol_distance"], time.perf_counter()
        distance.value = distance.min
        lab.distil.click()
        times[f"{len(lab.trials[1][1])} {sub_policy} cells"] = time.perf_counter() - begin
    longest = max(times, key=times.get)
    note = f"with {longest}; median of all classes {statistics.median(times.values()):.1f} s"
    record("speed", f"a trial in the laboratory of notebook 2, {task}", times[longest], "s", at_most=2, note=note)
