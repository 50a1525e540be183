"""`make paper-figures` from nothing, the environment in place: notebooks 01 to 05, which hold what the paper shows."""

import os
import statistics
import subprocess
import time

import vsp
from vsp.experiments import N_RUNS
from vsp.store import ROOT
from vsp.teachers import Teacher

NOTEBOOKS = ("01_teacher", "02_distillation", "03_evaluation", "04_appendix_tables", "05_ledger")
OF_MAKE = ("MAKE", "MFLAGS", "OUT", "JOBS", "QUICK", "DASK")  # of the make that runs this
SECONDS, FLOOR = 180, 35  # to reach on two cores, and what the teachers' forward passes take of it


def test_paper_figures(tmp_path, record, monkeypatch):
    cores, times = os.cpu_count(), []
    env = {name: value for name, value in os.environ.items() if not name.startswith(OF_MAKE)}
    for i in range(5):
        begin = time.perf_counter()
        command = ["make", "-C", ROOT, "-j", str(cores), "runs", *NOTEBOOKS, f"OUT={tmp_path / str(i)}"]
        subprocess.run(command, check=True, capture_output=True, env=env)
        times.append(time.perf_counter() - begin)
    floor = sum(n * forward_passes(task, monkeypatch) for task, n in N_RUNS.items()) / cores
    median = statistics.median(times)
    text = (
        f"{median:.0f} s ({min(times):.0f} to {max(times):.0f}); "
        f"the teachers' forward passes alone: {floor:.0f} s on {cores} cores"
    )
    slow = f"a slow machine: the forward passes alone were reckoned to take {FLOOR} s"
    why = slow if median / floor <= SECONDS / FLOOR else ""
    name = "`make paper-figures` from nothing, notebooks 01 to 05"
    record("speed", name, f"{SECONDS} s", text, median <= SECONDS, why=why)


def forward_passes(task: str, monkeypatch) -> float:
    """Seconds that one distillation of the paper spends in its teacher: the median of five."""
    taken, predict = [], Teacher.predict

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
            vsp.distill(teacher, task, vsp.preset(task), seed=seed)
    return statistics.median(taken)
