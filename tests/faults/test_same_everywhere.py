"""The same partition from the same seed whatever the process is like, and the same tables from the same runs."""

import filecmp
import importlib.util
import itertools
import os
import random
import shutil
import subprocess
import sys

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, distilled_elsewhere, threads

import vsp
from vsp import algorithms
from vsp.paper.runs import N_RUNS, make_runs, paper_experiment, run_path
from vsp.rollouts import visited_states
from vsp.run.atomic import ROOT

ROW_BY_ROW = {SIMPLEGOAL: "curved", MOUNTAINCAR: "pumping"}  # teachers of which the batch has no say in the numbers
NOTEBOOKS = ("03_evaluation", "04_appendix_tables", "05_ledger")  # those that draw tables from runs


def found():
    """The groups of instructions beyond the least that NumPy has code for and found here."""
    return np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])


def cpu(core: str, *, without: list[str]) -> dict[str, str]:
    """Environment variables that limit NumPy, OpenBLAS, the C library and torch to an older CPU type."""
    limits = {"OPENBLAS_CORETYPE": core}
    if without:
        limits |= {"NPY_DISABLE_CPU_FEATURES": ",".join(without), "ATEN_CPU_CAPABILITY": "default"}
        limits |= {"ONEDNN_MAX_CPU_ISA": "SSE41"}
        limits |= {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F"}
    return limits


def python(*arguments, **environment):
    """Run this Python as `make` does."""
    same = {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0", "SOURCE_DATE_EPOCH": "1763337600"} | threads(1)
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=ROOT,
        env=os.environ | same | environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


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
            same += [filecmp.cmp(run_path(folders[0], n), run_path(other, n), shallow=False) for n in seeds]
    tell(record, "run files in any order of jobs, 1 or 2 at a time", same, "files")


def test_batched_or_one_by_one(record):
    def different(task, teacher):
        return (
            len({distilled_elsewhere(task, teacher=teacher, seed=3, ahead=n, **threads(1)) for n in (1, 37, 500)}) > 1
        )

    same = [not different(task, ROW_BY_ROW[task]) for task in TASKS]
    what = "partition from episodes batched or one by one, of a teacher that acts row by row"
    tell(record, what, same, "tasks")


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
            monkeypatch.setattr(algorithms, "EPISODES_AHEAD", ahead)
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


# Another CPU type, emulated


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """All runs of the paper, and the tables made of them."""
    out = tmp_path_factory.mktemp("full")
    python("-m", "vsp.paper.make_runs", "--out", out, "--jobs", "1")
    draw(out)
    return out


def draw(out, **environment):
    for name in NOTEBOOKS:
        python("-m", "vsp.run.run_notebook", f"notebooks/{name}.ipynb", "--out", out, **environment)


@pytest.mark.parametrize("core", ["Prescott", "Sandybridge"])
def test_tables_of_the_same_runs_on_another_cpu_type(core, made, tmp_path, record):
    limits = cpu(core, without=found() if core == "Prescott" else [])
    probe = "from vsp.run import machine; print(machine.cpu_type())"
    assert python("-c", probe, **limits) != python("-c", probe), "the limits have no effect here"
    shutil.copytree(made / "data" / "runs", tmp_path / "data" / "runs")
    draw(tmp_path, **limits)
    names = sorted(path.name for path in (made / "figures" / "tables").iterdir())
    _, wrong, missing = filecmp.cmpfiles(made / "figures/tables", tmp_path / "figures/tables", names, shallow=False)
    same = [name not in wrong + missing for name in names]
    note = f"not {wrong + missing}" if wrong + missing else "the same bytes"
    tell(record, f"tables of the same runs as on a {core}", same, "files", note)


def test_runs_made_anew_on_another_cpu_type(tmp_path, record, monkeypatch):
    python("-m", "vsp.paper.make_runs", "--out", tmp_path, "--jobs", "1", **cpu("Prescott", without=found()))
    monkeypatch.chdir(ROOT)
    spec = importlib.util.spec_from_file_location("compare", ROOT / ".ci" / "compare.py")
    compare = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(compare)
    wrong = [name for task in TASKS for name in compare.implausible(tmp_path, task)]
    n = 2 * len(TASKS) * (len(compare.SPREAD) + len(compare.OUTLIERS))
    runs = sum(N_RUNS[task] for task in TASKS)
    note = f"of {runs} runs, inside simultaneous 99.9 % intervals" + f", not {wrong}" * bool(wrong)
    what = "runs made anew as on a Prescott"
    record("same", what, n - len(wrong), f"of {n} statistics", at_least=n, note=note)
