"""What runs in a process of .venv, whatever its caller's variables are: the kernels of x86-64-v3."""

import json
import os
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import scipy.linalg
from numpy.lib.introspect import opt_func_info
from threadpoolctl import threadpool_info

from vsp.run import ROOT, kernels
from vsp.run.workers import results

CALLERS = [{}, {"OPENBLAS_CORETYPE": "Prescott"}, {"NPY_ENABLE_CPU_FEATURES": "X86_V2"},
           {"NPY_DISABLE_CPU_FEATURES": "X86_V3"}]  # fmt: skip
PROBE = f"""\
import sys
sys.path.insert(0, {str(ROOT / "tests" / "run")!r})
import json, test_kernels
print(json.dumps(test_kernels.running()))"""
FIXED = [["Haswell"], 2, ["X86_V3"]]

needs_avx2 = pytest.mark.skipif(not kernels.available(), reason="this processor lacks AVX2, or this is no Linux")
pytestmark = needs_avx2


def running() -> list:
    """The kernels of OpenBLAS, its number of copies (NumPy's, SciPy's), and the kernels of NumPy above its baseline."""
    scipy.linalg.inv(np.eye(2))
    blas = [library["architecture"] for library in threadpool_info() if library["user_api"] == "blas"]
    numpy = {kind["current"] for function in opt_func_info().values() for kind in function.values()}
    return [sorted(set(blas)), len(blas), sorted(name for name in numpy if not name.startswith("baseline"))]


@pytest.fixture(params=CALLERS, ids=lambda variables: "".join(variables) or "none")
def caller(request):
    """The environment of a caller who set one of the variables, or none."""
    names = {*kernels.FIXED, "NPY_DISABLE_CPU_FEATURES"}
    return {name: value for name, value in os.environ.items() if name not in names} | request.param


def test_this_process_and_its_workers_are_fixed():
    assert running() == FIXED and kernels.fixed() and kernels.name() == "x86-64-v3"
    assert dict(results(running, [(), ()], "asked", jobs=2, total=2, unit="workers")) == {0: FIXED, 1: FIXED}


def test_whatever_a_caller_sets_is_overridden(caller):
    """On one core; the test above runs on all of them."""
    one = partial(os.sched_setaffinity, 0, sorted(os.sched_getaffinity(0))[:1])
    told = subprocess.check_output([sys.executable, "-c", PROBE], env=caller, text=True, preexec_fn=one)
    assert json.loads(told) == FIXED


def test_an_older_processor_runs_with_its_own_kernels_and_make_says_so(monkeypatch):
    monkeypatch.setattr(kernels, "NEEDED", {"no such instruction"})
    monkeypatch.setattr(os, "environ", {"NPY_DISABLE_CPU_FEATURES": "X86_V3"})
    kernels.fix()
    assert os.environ == {"NPY_DISABLE_CPU_FEATURES": "X86_V3"} and not kernels.fixed()
    assert kernels.name().endswith("Haswell") and kernels.name() != "x86-64-v3"
    says = subprocess.check_output([sys.executable, "-S", "-E", "vsp/run/kernels.py"], cwd=ROOT, env={}, text=True)
    reason = "this processor lacks AVX2 or is not an x86-64 under Linux"
    assert says == f"{reason}: bytes may differ from the committed ones\n"
