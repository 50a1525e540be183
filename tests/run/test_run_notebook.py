"""vsp.run.run_notebook: a notebook succeeds as a whole or changes nothing, and says which cell was at fault."""

from pathlib import Path

import pytest
from support import write_story as write

from vsp.run import listed, run_notebook
from vsp.run.notebook import nbformat

DRAW = """\
from pathlib import Path
folder = Path(out) / "figures"
folder.mkdir(parents=True)
(folder / "a.txt").write_text(f"quick is {quick}")
(folder / "b.txt").write_text("always the same")"""

WIDGET = """\
import ipywidgets
class Explorer:
    def _repr_mimebundle_(self, **kwargs):
        return {**ipywidgets.IntSlider()._repr_mimebundle_(), "text/html": "strip"}
Explorer()"""


def run(*arguments) -> None:
    """The command line."""
    run_notebook.main([str(argument) for argument in arguments])


def refused(*arguments) -> str:
    """What the command says where it fails."""
    with pytest.raises(SystemExit) as end:
        run(*arguments)
    return end.value.code


def tree(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Content and time of every file outside build/."""
    files = (p for p in folder.rglob("*") if p.is_file() and "build" not in p.relative_to(folder).parts)
    return {p.relative_to(folder).as_posix(): (p.read_bytes(), p.stat().st_mtime_ns) for p in files}


def test_success_twice(tmp_path):
    """Files arrive; the executed copy is clean; a second run touches nothing; another value changes one file."""
    show = "print(Path(runs).name)\ndisplay(1)\nprint('two', flush=True)\nprint('three')\n40 + 2"
    notebook, out = write(tmp_path, DRAW, "", show), tmp_path / "out with space"
    notebook.write_text(notebook.read_text().replace("python", "julia"))  # saved with another kernel
    run(notebook, "--out", out, "--expect", "figures/a.txt", "figures/b.txt")
    first = tree(out)
    assert set(first) == {"figures/a.txt", "figures/b.txt", "figures/executed/story.ipynb"}
    executed = nbformat.read(out / "figures" / "executed" / "story.ipynb", as_version=4)
    assert [cell.id for cell in executed.cells] == ["cell-0", "cell-1", "cell-2", "cell-3"]
    assert [cell.execution_count for cell in executed.cells] == [1, 2, 3, 4]
    assert [output.output_type for output in executed.cells[3].outputs] == [
        "stream", "display_data", "stream", "execute_result"
    ]  # fmt: skip
    text = first["figures/executed/story.ipynb"][0].decode()
    assert str(tmp_path) not in text and "quick = False" in text
    assert run_notebook.run_notebook(notebook, out) == []
    assert tree(out) == first
    assert run_notebook.run_notebook(notebook, out, quick=True) == ["figures/a.txt"]
    assert not list((out / "build" / "running" / "story").iterdir())


def test_of_a_widget_its_still_picture_is_left(tmp_path):
    """No view, which has a random name, no state, and nothing of widgets without a picture: the same bytes twice."""
    bar = "from vsp.run.progress import progress\n_ = [*progress('ab', 'work', total=2, unit='steps')]\n"
    notebook = write(tmp_path, WIDGET, "display(Explorer())", "ipywidgets.IntSlider()", bar, bar + "print(1)", "'text'")
    copy = tmp_path / "figures" / "executed" / "story.ipynb"
    assert run_notebook.run_notebook(notebook, tmp_path) == ["figures/executed/story.ipynb"]
    executed = nbformat.read(copy, as_version=4)
    outputs = [[output.get("data", output.get("text")) for output in cell.outputs] for cell in executed.cells]
    still = {"text/html": "strip", "text/plain": "IntSlider(value=0)"}
    assert outputs == [[], [still], [still], [], [], ["1\n"], [{"text/plain": "'text'"}]]
    assert "widget" not in str(executed.metadata) and "widget-view" not in copy.read_text()
    assert run_notebook.run_notebook(notebook, tmp_path) == []


def test_results_are_listed_beside_those_of_others(tmp_path):
    """Whether the notebook listed them in its staging folder or not; a line that a killed run lacks is made up for."""
    cell = "from vsp.run import atomic, listed\nfolder = out + '/data/results/'\n"
    cell += "listed.write_listed(folder + 'a.csv', 'a')\natomic.write_text(folder + 'b.csv', 'b')"
    story, results = write(tmp_path, cell), tmp_path / "data" / "results"
    listed.write_listed(results / "other.csv", "x")
    run_notebook.run_notebook(story, tmp_path, executed="figures/beyond/executed")
    assert (tmp_path / "figures/beyond/executed/story.ipynb").exists()
    assert [listed.read_listed(results / name) for name in ("a.csv", "b.csv", "other.csv")] == [b"a", b"b", b"x"]
    (results / listed.MANIFEST).write_text("")
    assert run_notebook.run_notebook(story, tmp_path, executed="figures/beyond/executed") == []
    assert listed.read_listed(results / "a.csv") + listed.read_listed(results / "b.csv") == b"ab"


FAULTS = {
    "failing cell": (["1 / 0"], "code cell (1 / 0) failed: ZeroDivisionError"),
    "killed kernel": (["import os\nos.kill(os.getpid(), 9)", "2"], "code cell (import os) did not end: DeadKernel"),
    "sys.exit(0)": (["import sys\nsys.exit(0)", "2"], "code cell (import sys) failed: SystemExit"),
    "too slow": (["import time; time.sleep(60)"], "code cell (import time; time.sleep(60)) did not end: CellTimeout"),
    "skipped": (["# skip\n2"], "code cell (# skip) never ran"),
    "missing": (["2"], "did not make figures/c.pdf"),
    "shown, not raised": (
        ["try:\n    1 / 0\nexcept ZeroDivisionError:\n    get_ipython().showtraceback()", "2"],
        "code cell (try:) failed: ZeroDivisionError: division by zero",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_leaves_previous_figures(tmp_path, monkeypatch, fault):
    cells, message = FAULTS[fault]
    (tmp_path / "figures" / "executed").mkdir(parents=True)
    for name in ("a.txt", "executed/story.ipynb"):
        (tmp_path / "figures" / name).write_text("from an earlier run")
    notebook = write(tmp_path, DRAW, *cells)
    before = tree(tmp_path)
    expect = ["figures/a.txt"] + ["figures/c.pdf"] * (fault == "missing")
    monkeypatch.setattr(run_notebook, "TIMEOUT", 1 if fault == "too slow" else 60)
    error = refused(notebook, "--out", tmp_path, "--expect", *expect)
    assert error.startswith("error: story.ipynb") and message in error
    assert fault != "failing cell" or "Traceback" in error
    assert tree(tmp_path) == before


def test_damage_is_told_in_one_line(tmp_path):
    """With the file and a remedy; only an error of the notebook's own brings a traceback, as the faults above do."""
    (tmp_path / "1.run").write_text("rubbish")
    read = f"import vsp.run.sealed\nvsp.run.sealed.read_sealed({str(tmp_path / '1.run')!r})"
    error = refused(write(tmp_path, read), "--out", tmp_path)
    assert "1.run: damaged, or no file of vsp (its SHA-256 is " in error and "\n" not in error


@pytest.mark.parametrize(
    "cell", ["open(out + '/large', 'w').write('x' * 100_000)", "print('x' * 100_000)"], ids=["cell", "copy"]
)
def test_limit_on_the_size_of_files(tmp_path, limit_files, cell):
    """In a cell and where the runner writes: one line, and the earlier files stay."""
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "a.txt").write_text("from an earlier run")
    notebook = write(tmp_path, cell)
    before = tree(tmp_path)
    limit_files(50_000)
    error = refused(notebook, "--out", tmp_path)
    assert error.startswith("error: story.ipynb") and "File too large" in error and "\n" not in error
    assert tree(tmp_path) == before


def test_a_missing_notebook_is_named(tmp_path):
    assert "none.ipynb: no such file" in refused(tmp_path / "none.ipynb", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()
