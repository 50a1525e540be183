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
SECONDS = 180  # on two cores


def test_paper_figures(tmp_path, record, monkeypatch):
    cores, times = os.cpu_count(), []
    env = {name: value for name, value in os.environ.items() if not name.startswith(OF_MAKE)}
    for i in range(5):
        begin = time.perf_counter()
        command = ["make", "-C", ROOT, "-j", str(cores), "runs", *NOTEBOOKS, f"OUT={tmp_path / str(i)}"]
        subprocess.run(command, check=True, capture_output=True, env=env)
        times.append(time.perf_counter() - begin)
    median, each = statistics.median(times), {task: one_distillation(task, monkeypatch) for task in N_RUNS}
    distilling, passes = (sum(n * each[task][i] for task, n in N_RUNS.items()) / cores for i in (0, 1))
    text = (
        f"{median:.0f} s ({min(times):.0f} to {max(times):.0f}); on {cores} cores, all distillations alone take "
        f"{distilling:.0f} s, the teachers' forward passes in them {passes:.0f} s"
    )
    record("speed", "`make paper-figures` from nothing, notebooks 01 to 05", f"{SECONDS} s", text, median <= SECONDS)


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
