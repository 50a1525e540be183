"""`make paper-figures` from nothing, with the environment in place, and once more."""

import os
import statistics
import subprocess
import time

import vsp
from vsp.paper.runs import N_RUNS
from vsp.run.atomic import ROOT
from vsp.teachers.teacher import Teacher

OF_MAKE = ("MAKE", "MFLAGS", "OUT", "JOBS", "QUICK", "DASK")  # of the make that runs this
SECONDS = 180  # on two cores


def test_paper_figures(tmp_path, record, monkeypatch):
    cores, times, again = os.cpu_count(), [], []
    env = {name: value for name, value in os.environ.items() if not name.startswith(OF_MAKE)}
    for i in range(5):
        for seconds in (times, again):
            begin = time.perf_counter()
            command = ["make", "-C", ROOT, "paper-figures", f"OUT={tmp_path / str(i)}"]
            subprocess.run(command, check=True, capture_output=True, env=env)
            seconds.append(time.perf_counter() - begin)
    median, each = statistics.median(times), {task: one_distillation(task, monkeypatch) for task in N_RUNS}
    distilling, passes = (sum(n * each[task][i] for task, n in N_RUNS.items()) / cores for i in (0, 1))
    note = (
        f"on {cores} cores, all distillations alone take {distilling:.0f} s, the teachers' forward passes in them "
        f"{passes:.0f} s"
    )
    what = "`make paper-figures` from nothing"
    record("speed", what, median, "s", at_most=SECONDS, low=min(times), high=max(times), note=note)
    what = "a second `make paper-figures`"
    record("speed", what, statistics.median(again), "s", at_most=1, low=min(again), high=max(again))


def one_distillation(task: str, monkeypatch) -> tuple[float, float]:
    """Seconds that one distillation of the paper takes, and of these in its teacher: medians of five."""
    whole, taken, predict = [], [], Teacher.predict

    def timed(self, obs):
        begin = time.perf_counter()
        actions = predict(self, obs)
        taken[-1] += time.perf_counter() - begin
        return actions

    with monkeypatch.context() as patch:
        patch.setattr(Teacher, "predict", timed)
        teacher = vsp.load_teacher(task)
        for seed in range(5):
            taken.append(0.0)
            begin = time.perf_counter()
            vsp.distill(teacher, task, vsp.preset(task), seed=seed)
            whole.append(time.perf_counter() - begin)
    return statistics.median(whole), statistics.median(taken)
