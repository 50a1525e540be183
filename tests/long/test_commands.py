"""Commands as a user gives them, each in a process of its own."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support import write_story

from vsp.run.atomic import ROOT

sys.path.insert(0, str(Path(__file__).parents[1] / "run"))
from test_kernels import FIXED, PROBE, caller, needs_avx2  # noqa: F401 (caller is a fixture)


@needs_avx2
@pytest.mark.parametrize("how", ["papermill", "run_notebook"])
def test_the_kernel_of_a_notebook_is_fixed_whatever_a_caller_sets(tmp_path, caller, how):  # noqa: F811
    story = write_story(tmp_path, PROBE)
    command = [sys.executable, "-m", "vsp.run.run_notebook", story, "--out", tmp_path]
    if how == "papermill":
        (tmp_path / "figures/executed").mkdir(parents=True)
        command = [sys.executable, "-m", "papermill", story, tmp_path / "figures/executed/story.ipynb"]
    subprocess.run(command, cwd=ROOT, env=caller, check=True, capture_output=True)
    cells = json.loads((tmp_path / "figures/executed/story.ipynb").read_text("utf-8"))["cells"]
    assert json.loads("".join(cells[-1]["outputs"][0]["text"])) == FIXED


def test_one_runs_by_plain_papermill_from_the_root(tmp_path):
    command = [sys.executable, "-m", "papermill", "notebooks/01_teacher.ipynb", str(tmp_path / "out.ipynb")]
    options = ["-p", "out", str(tmp_path), "-p", "quick", "true", "--no-progress-bar"]
    done = subprocess.run([*command, *options], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "figures" / "environments.pdf").exists()


def test_commands_run_without_a_warning():
    """Of a module that its package has imported already, `python -m` warns."""
    commands = ["studies.comparison.stale", "studies.make_rows --help"]
    commands += ["vsp.paper.make_runs --help"]
    how = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = [subprocess.Popen([sys.executable, "-m", *command.split()], **how) for command in commands]
    said = [(*process.communicate(), process.returncode) for process in running]
    assert said[0] == ("", "", 0)  # nothing is stale
    assert all(out.startswith("usage:") and (err, code) == ("", 0) for out, err, code in said[1:])


@pytest.mark.parametrize(
    ("page", "said"), [("README.md", "R² 0.98"), ("docs/use.md", "push east = -1.50")], ids=["README", "use"]
)
def test_python_example_runs(page, said, tmp_path, monkeypatch, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text("utf-8"), flags=re.S)
    monkeypatch.chdir(tmp_path)
    example = example.replace("Dock-v0", "DockOfReadme-v0")  # other tests have a Dock-v0 of their own
    exec(compile(example, page, "exec"), {})
    assert said in capsys.readouterr().out and len(example.splitlines()) <= 40
    assert (tmp_path / "my_policy.vsp").exists() == (page == "README.md")
