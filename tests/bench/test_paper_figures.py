"""`make paper-figures` from nothing, the environment in place: notebooks 01 to 05, which hold what the paper shows."""

import os
import statistics
import subprocess
import time

from vsp.store import ROOT

NOTEBOOKS = ("01_teacher", "02_distillation", "03_evaluation", "04_appendix_tables", "05_ledger")
SECONDS = 180  # on two cores


def test_paper_figures(tmp_path, record):
    times = []
    for i in range(3):
        begin = time.perf_counter()
        command = ["make", "-C", ROOT, "-j", str(os.cpu_count()), "runs", *NOTEBOOKS, f"OUT={tmp_path / str(i)}"]
        subprocess.run(command, check=True, capture_output=True)
        times.append(time.perf_counter() - begin)
    text = f"{statistics.median(times):.0f} s ({min(times):.0f} to {max(times):.0f})"
    held = statistics.median(times) <= SECONDS
    record("speed", "`make paper-figures` from nothing, notebooks 01 to 05", f"{SECONDS} s", text, held)
