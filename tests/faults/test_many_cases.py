"""The properties of tests/test_properties.py, and those of tests/test_codewords.py with up to 200 cases each."""

import os
import re
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]


def with_many_cases(file: str) -> tuple[int, str]:
    """How many of its tests passed with the profile that has 200 cases, and the last line of what pytest says."""
    command = [sys.executable, "-m", "pytest", "-q", "--hypothesis-profile=many", file]
    done = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, env=os.environ | {"MPLBACKEND": "Agg"})
    last = done.stdout.strip().splitlines()[-1]
    return (int(re.search(r"(\d+) passed", last)[1]) if done.returncode == 0 else 0), last


def test_properties_of_public_functions(record):
    sys.path.insert(0, str(TESTS))
    from test_properties import CASES

    passed, last = with_many_cases("test_properties.py")
    what, n = "bad arguments of the public functions of a reader", len(CASES)
    note = "a typed error, never a silent result; each argument spoilt in every way" if passed else last
    record("input", what, n if passed else 0, f"of {n} functions", at_least=n, note=note)


def test_codewords(record):
    passed, last = with_many_cases("test_codewords.py")
    what = "codewords: one, two, collinear, nearly equal, a grid, d = 1 to 8, permuted"
    note = "no crash, symmetric; up to 200 cases each" if passed else last
    record("input", what, passed, f"of {passed} tests", at_least=max(passed, 1), note=note)
