"""How long the parts take: `make bench`. test_speed.py compares whole runs and episodes with the direct way."""

import statistics
import time
from functools import partial

import numpy as np
import pytest
from support import nearest_brute, nearest_kdtree

import vsp
from vsp import geometry
from vsp.paper import printed
from vsp.show import Laboratory


def seconds(work, repeats: int = 5) -> float:
    """Median time of `work` over `repeats` calls, after one that does not count."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def report(capsys, what: str, value: float, unit: str) -> None:
    with capsys.disabled():
        print(f"\n{what:60s} {value:10.4g} {unit}", end="")


@pytest.mark.parametrize("task", printed.TASKS)
def test_teacher_states_per_second(task, capsys):
    teacher, space = vsp.load_teacher(task), vsp.get_task(task)
    states = np.random.default_rng(0).uniform(space.low, space.high, size=(500, len(space.low))).astype(np.float32)
    rate = len(states) / seconds(lambda: teacher.predict(states), repeats=50)
    report(capsys, f"teacher, states per second, {task}", rate, "1/s")
    assert rate > 10_000


@pytest.mark.parametrize("k", [13, 32, geometry.KDTREE_FROM, 4 * geometry.KDTREE_FROM])
def test_look_up(k, capsys):
    rng = np.random.default_rng(0)
    codewords, states = rng.uniform(size=(k, 2)), rng.uniform(size=(1000, 2))
    for name, look_up in (("brute force", nearest_brute), ("kd-tree", nearest_kdtree)):
        taken = seconds(partial(look_up, codewords, states), repeats=20)
        report(capsys, f"{name}, 1000 states, {k} codewords", 1000 * taken, "ms")
    assert (nearest_brute(codewords, states) == nearest_kdtree(codewords, states)).all()


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
