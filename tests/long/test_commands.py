"""Commands as a user gives them, each in a process of its own."""

import subprocess
import sys
from subprocess import PIPE

from vsp.run.atomic import ROOT


def test_one_runs_by_plain_papermill_from_the_root(tmp_path):
    command = [sys.executable, "-m", "papermill", "notebooks/01_teacher.ipynb", str(tmp_path / "out.ipynb")]
    options = ["-p", "out", str(tmp_path), "-p", "quick", "true", "--no-progress-bar"]
    done = subprocess.run([*command, *options], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "figures" / "environments.pdf").exists()


def test_commands_run_without_a_warning():
    """Of a module that its package has imported already, `python -m` warns."""
    commands = ["studies.comparison.stale", "studies.make_rows --help"]
    commands += ["vsp.paper.studies.make_studies --help", "vsp.paper.make_runs --help"]
    how = {"cwd": ROOT, "stdout": PIPE, "stderr": PIPE, "text": True}
    running = [subprocess.Popen([sys.executable, "-m", *command.split()], **how) for command in commands]
    said = [(*process.communicate(), process.returncode) for process in running]
    assert said[0] == ("", "", 0)  # nothing is stale
    assert all(out.startswith("usage:") and (err, code) == ("", 0) for out, err, code in said[1:])
