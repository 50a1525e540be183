"""How long the parts take: `make bench`. test_speed.py compares whole runs and episodes with the direct way."""

import statistics
import time

import pytest

import vsp
from vsp.paper import printed
from vsp.show import Laboratory


@pytest.mark.parametrize("task", printed.TASKS)
def test_a_trial_of_the_laboratory(task, record):
    """With every class of sub-policy, in the smallest cells that the slider allows."""
    lab, times = Laboratory(vsp.load_teacher(task), task), {}
    distance = lab.settings["min_pol_distance"].min
    for sub_policy in lab.settings["sub_policy"].options:
        begin = time.perf_counter()
        place = lab.trial({"sub_policy": sub_policy, "min_pol_distance": distance})
        lab.scene(place)
        times[f"{len(lab.trials[place][1])} {sub_policy} cells"] = time.perf_counter() - begin
    longest = max(times, key=times.get)
    note = f"with {longest}; median of all classes {statistics.median(times.values()):.1f} s"
    record("speed", f"a trial in the laboratory of notebook 2, {task}", times[longest], "s", at_most=2, note=note)
