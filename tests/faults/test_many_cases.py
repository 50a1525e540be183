"""The properties of tests/test_properties.py, and those of tests/test_codewords.py with up to 200 cases each."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

WHAT = {
    "test_properties.py": "bad arguments of the public functions of a reader",
    "test_codewords.py": "codewords: one, two, collinear, nearly equal, a grid, d = 1 to 8, permuted",
}


@pytest.mark.parametrize("file", WHAT)
def test_many_cases(record, file):
    command = [sys.executable, "-m", "pytest", "-q", "--hypothesis-profile=many", file]
    folder, environment = Path(__file__).parents[1], os.environ | {"MPLBACKEND": "Agg"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    last = done.stdout.strip().splitlines()[-1]
    passed, failed = (int((re.search(rf"(\d+) {word}", last) or [0, 0])[1]) for word in ("passed", "failed"))
    note = "up to 200 cases each" if not failed else last
    record("input", WHAT[file], passed, f"of {passed + failed} tests", at_least=max(passed + failed, 1), note=note)
