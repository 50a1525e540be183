"""The same partition from the same seed whatever the process is like."""

import filecmp
import itertools
import os
import random
import subprocess
import sys
import sysconfig

import numpy as np
from scipy.stats import norm
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, distilled_elsewhere, threads

import vsp
from vsp.paper import read_results, spread
from vsp.paper.runs import N_RUNS, make_runs, paper_experiment
from vsp.rollouts import visited_states
from vsp.run import ROOT

ROW_BY_ROW = {SIMPLEGOAL: "curved", MOUNTAINCAR: "pumping"}  # teachers of which the batch has no say in the numbers
PRESCOTT = {  # an old processor for NumPy, OpenBLAS and the C library
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F",
}


def tell(record, what: str, same: list[bool], unit: str, note: str = "the same bytes") -> None:
    record("same", what, sum(same), f"of {len(same)} {unit}", at_least=len(same), note=note)


# Partitions, at the paper's configuration


def test_threads(record):
    same = [len({distilled_elsewhere(task, seed=3, **threads(n)) for n in (1, 2, 4, 8)}) == 1 for task in TASKS]
    tell(record, "partition for 1, 2, 4, 8 threads", same, "tasks")


def test_hash_seeds(record):
    same = [len({distilled_elsewhere(task, seed=3, PYTHONHASHSEED=str(n)) for n in range(10)}) == 1 for task in TASKS]
    tell(record, "partition for hash seeds 0 to 9", same, "tasks")


def test_the_order_of_jobs(record, tmp_path):
    same, seeds = [], list(range(6))
    for task in TASKS:
        experiment, shuffled = paper_experiment(task), random.Random(0).sample(seeds, len(seeds))
        for name, order, jobs in (("a", seeds, 1), ("b", seeds[::-1], 1), ("c", shuffled, 2), ("d", seeds, 2)):
            make_runs(experiment, order, runs=tmp_path / name, jobs=jobs)
        folders = [experiment.folder(tmp_path / name) for name in "abcd"]
        for other in folders[1:]:
            for name in (f"{n:04d}.run" for n in seeds):
                same.append(filecmp.cmp(folders[0] / name, other / name, shallow=False))
    tell(record, "run files in any order of jobs, 1 or 2 at a time", same, "files")


def test_batched_or_one_by_one(record):
    def partitions(task, teacher):
        return {distilled_elsewhere(task, teacher=teacher, seed=3, ahead=n, **threads(1)) for n in (1, 37, 500)}

    same = [len(partitions(task, teacher)) == 1 for task, teacher in ROW_BY_ROW.items()]
    tell(record, "partition from episodes batched or one by one, of a teacher that acts row by row", same, "tasks")


def test_a_network_in_a_batch_and_alone(record, monkeypatch):
    """Matrix products are summed in another order for another number of rows: in float32 actions differ in the last
    bits, and where one tips a split, a partition: the size of the batch is part of what a seed stands for."""
    gaps, same = [], []
    for task, seed in itertools.product(TASKS, range(3)):
        teacher, known = vsp.load_teacher(task), vsp.get_task(task)
        states = visited_states(teacher, known, known.start(np.random.default_rng(seed), 20))
        gaps.append(np.abs(teacher.predict(states)[0] - [teacher.predict(state)[0] for state in states]).max())
        made = []
        for ahead in (1, 500):
            monkeypatch.setattr(vsp.algorithms, "EPISODES_AHEAD", ahead)
            made.append(vsp.distill(teacher, task, seed=seed)[0])
        alone, batched = made
        same.append(
            len(alone) == len(batched)
            and np.allclose(alone.codewords, batched.codewords, rtol=0, atol=1e-5)
            and np.allclose(alone.coefficients, batched.coefficients, rtol=0, atol=1e-3)
        )
    note = f"{sum(same)} of {len(same)} partitions agree to 1e-3"
    what = "partition from episodes batched or one by one, of the shipped float32 teachers"
    why = "a float32 product of matrices is summed otherwise for one row: the batch is part of what a seed stands for"
    record("same", what, max(gaps), "largest difference of an action", at_most=0, note=note, why=why)
    assert max(gaps) < 2e-5


# An old processor, emulated


def test_runs_made_anew_on_an_old_processor(tmp_path, record):
    """Their means, quartiles and deviations lie inside simultaneous 99.9 % intervals, from resampled runs.

    Without `site` (-S), so that nothing fixes the kernels.
    """
    paths = os.pathsep.join([str(ROOT), sysconfig.get_path("purelib")])
    command = [sys.executable, "-S", "-m", "vsp.paper.make_runs", "--out", tmp_path, "--jobs", "1"]
    subprocess.run(command, cwd=ROOT, env=os.environ | threads(1) | PRESCOTT | {"PYTHONPATH": paths}, check=True)
    inside, names = [], ("mean", "std", "q1", "median", "q3")
    z = norm.isf(0.001 / 2 / (len(TASKS) * len(names)))
    for task in TASKS:
        runs = make_runs(paper_experiment(task), range(N_RUNS[task]), runs=tmp_path / "data" / "runs")
        made, committed = [spread(run.outcomes.returns) for run in runs], read_results(task)
        rng = np.random.default_rng(0)
        for name in names:
            then, now = committed[name].to_numpy(), np.array([row[name] for row in made])
            draws = [values[rng.integers(len(values), size=(1000, len(values)))].mean(axis=1) for values in (then, now)]
            inside.append(abs(then.mean() - now.mean()) <= z * np.hypot(*(draw.std() for draw in draws)))
    what = "runs made anew as on a Prescott"
    tell(record, what, inside, "statistics", note="inside 99.9 % intervals")
