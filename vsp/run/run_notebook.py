"""Run one notebook headless: either all of it succeeds, or nothing in `out` changes.

    python -m vsp.run.run_notebook notebooks/01_teacher.ipynb --out . --quick --expect figures/environments.pdf

A notebook has a cell tagged `parameters`, after which the run sets `out`, `quick` and `runs`. The notebook writes
`figures/` and `data/results/` into the folder `out`. This is a staging folder, and the files move to the real `out`
only after every cell ran without an error. `runs` is the real `out`/data/runs.
"""

import argparse
import filecmp
import logging
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from unittest import mock

from .atomic import read_bytes, write_text
from .command import CommandError, in_one_line
from .listed import MANIFEST, list_file
from .locks import folder_lock
from .notebook import NotebookNode, nbformat

KERNEL = "python3"
TIMEOUT = 1800  # seconds per cell
# Variables of the folder that a kernel writes to; the next run removes what a killed one left. IPYTHONDIR: without the
# user's start-up files
KERNEL_FOLDER = ("TMPDIR", "JOBLIB_TEMP_FOLDER", "IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "MPLCONFIGDIR")
KERNEL_SETTINGS = {
    "OMP_NUM_THREADS": "1",  # the same sums in the same order, also without make
    "OPENBLAS_NUM_THREADS": "1",
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",  # figures are outputs
    "PYDEVD_DISABLE_FILE_VALIDATION": "1",  # no debugger message on standard error
}
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# A user can fix these: a damaged file, a full or read-only disk, a cluster
_MENDABLE = ("CommandError", "DamagedFile", "MissingFile", "OSError", "PermissionError")
_WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
_OVERWRITTEN = re.compile(r".*\r(?!\n)")  # a line up to its last carriage return


def run_notebook(
    notebook: str | os.PathLike,
    out: str | os.PathLike,
    *,
    quick: bool = False,
    expect: Sequence[str] = (),
    executed: str = "figures/executed",
) -> list[str]:
    """Run `notebook` and move the files that it made to `out`. Returns those that changed there.

    `expect` names files, relative to `out`, that the notebook must make. An executed copy, without anything that varies
    between runs, goes to the folder `executed` in `out`. Raises CommandError if another process runs the same notebook
    into the same `out` or if a cell fails, MissingFile, or OSError for a full or read-only disk. The earlier files of
    `out` then stay, unless the disk fails while files are moved."""
    notebook, out = Path(notebook).resolve(), Path(out).resolve()
    source = nbformat.reads(read_bytes(notebook).decode(), as_version=4)
    running = out / "build" / "running" / notebook.stem
    with folder_lock(running, f"another run of {notebook.stem} writes into {out}"):
        for left in running.iterdir():
            shutil.rmtree(left, ignore_errors=True)  # left by a killed run
        # A new name each time: an orphaned kernel may still write to an old folder
        with tempfile.TemporaryDirectory(dir=running, ignore_cleanup_errors=True) as work:
            staging = Path(work, "out")
            staging.mkdir()
            values = {"out": str(staging), "quick": quick, "runs": str(out / "data" / "runs")}
            cells = _execute(notebook, values, Path(work))
            for cell in cells:
                _check_cell(notebook, cell)
            _write_copy(source, cells, staging / executed / notebook.name)
            missing = [name for name in expect if not (staging / name).is_file()]
            if missing:
                raise CommandError(f"{notebook.name}: ran, but did not make {', '.join(missing)}")
            return _publish(staging, out)


def _execute(notebook: Path, values: dict[str, object], work: Path) -> list[NotebookNode]:
    """Run a copy of the notebook by papermill with the parameters `values`. Returns its code cells, up to an error."""
    import papermill
    from nbclient.exceptions import CellTimeoutError, DeadKernelError

    logging.getLogger("papermill").setLevel(logging.ERROR)  # no warning if a notebook has no use for `runs`
    copy = work / notebook.name
    # The folder as in JupyterLab
    options = {"kernel_name": KERNEL, "language": "python", "cwd": notebook.parent, "execution_timeout": TIMEOUT}
    quiet = {"progress_bar": False, "extra_arguments": ["--log-level=CRITICAL"]}  # no log messages on standard error
    try:
        with mock.patch.dict(os.environ, _environment(work / "tmp")):
            papermill.execute_notebook(notebook, copy, values, **options, **quiet)
    except papermill.PapermillExecutionError:
        pass  # `_check_cell` finds the error
    except (CellTimeoutError, DeadKernelError) as error:
        begun = [cell for cell in _code_cells(copy) if cell.metadata.papermill.start_time]
        where = _name(notebook, begun[-1]) if begun else notebook.name
        raise CommandError(f"{where} did not end: {type(error).__name__}: {error}") from error
    return [cell for cell in _code_cells(copy) if "injected-parameters" not in cell.metadata.tags]


def _environment(folder: Path) -> dict[str, str]:
    """Make `folder`; return variables for kernels: no settings of the user, and nothing is written outside `folder`."""
    folder.mkdir()
    for fonts in Path(sys.prefix).glob("matplotlib/fontlist-*.json"):  # made by the set-up
        shutil.copy(fonts, folder)
    return KERNEL_SETTINGS | dict.fromkeys(KERNEL_FOLDER, str(folder))


def _code_cells(path: Path) -> list[NotebookNode]:
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def _name(notebook: Path, cell: NotebookNode) -> str:
    """Return the name of the notebook, and of the cell by its first line, for messages."""
    first = cell.source.strip().partition("\n")[0]
    return f"{notebook.name}, code cell ({first})"


def _check_cell(notebook: Path, cell: NotebookNode) -> None:
    """Raise CommandError if the cell failed, in one line if a user can fix it, such as a damaged file, or never ran."""
    if cell.source.strip() and cell.execution_count is None:
        raise CommandError(f"{_name(notebook, cell)} never ran")
    for output in cell.outputs:
        if output.output_type == "error":
            traceback = _COLOUR.sub("", "\n".join(["", *output.traceback]))
            details = "" if output.ename in _MENDABLE else traceback
            raise CommandError(f"{_name(notebook, cell)} failed: {output.ename}: {output.evalue}{details}")


def _write_copy(source: NotebookNode, cells: list[NotebookNode], path: Path) -> None:
    """Write the source with the outputs of its run. Other parts of a notebook that a run changes vary between runs."""
    source.metadata = {
        "kernelspec": {"name": KERNEL, "display_name": "Python 3", "language": "python"},
        "language_info": {"name": "python"},
    }
    targets = [cell for cell in source.cells if cell.cell_type == "code"]
    for number, (target, cell) in enumerate(zip(targets, cells, strict=True), 1):
        target.outputs, target.execution_count = clean_outputs(cell.outputs, number), number
    write_text(path, nbformat.writes(source) + "\n")


def clean_outputs(outputs: list[NotebookNode], number: int) -> list[NotebookNode]:
    """Return the outputs of code cell `number` in a form that is the same for every run. Text is joined into one piece,
    without what a progress bar wrote over. Widgets are replaced by their static image; one without is removed."""
    result: list[NotebookNode] = []
    for output in outputs:
        data = output.get("data", {})
        if data.pop(_WIDGET_VIEW, None) and set(data) <= {"text/plain"}:
            continue
        if "execution_count" in output:
            output.execution_count = number
        if output.output_type == "stream" and result and result[-1].get("name") == output.name:
            result[-1].text += output.text
        else:
            result.append(output)
    for output in result:
        if output.output_type == "stream":
            output.text = _OVERWRITTEN.sub("", output.text)
    return [output for output in result if output.get("text") != ""]


def _publish(staging: Path, out: Path) -> list[str]:
    """Move each staged file to its place in `out`; a file with the same bytes stays untouched. Results are listed."""
    changed = []
    for path in sorted(path for path in staging.rglob("*") if path.is_file() and path.name != MANIFEST):
        name = path.relative_to(staging)
        target = out / name
        if not target.is_file() or not filecmp.cmp(path, target, shallow=False):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(path, target)  # also to another disk
            changed.append(name.as_posix())
        if name.is_relative_to("data/results"):
            list_file(target)  # unchanged files too: a run may have been killed before this line
    return changed


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m vsp.run.run_notebook", description="Run one notebook headless.")
    parser.add_argument("notebook")
    parser.add_argument("--out", default=".", help="folder for figures/ and data/results/ (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="few runs, figures watermarked")
    parser.add_argument("--expect", nargs="+", default=[], metavar="FILE", help="files in OUT that it must make")
    parser.add_argument("--executed", default="figures/executed", help="folder in OUT for the copy (%(default)s)")
    options = vars(parser.parse_args(arguments))
    began, name = time.monotonic(), Path(options["notebook"]).name
    with in_one_line(name):
        print(f"{name}: running", flush=True)
        changed = run_notebook(**options)
        print(f"{name}: done in {time.monotonic() - began:.0f} s, files changed: {len(changed)}", flush=True)


if __name__ == "__main__":
    main()
