"""Run one notebook headless: either all of it succeeds, or nothing in `out` changes.

    python -m vsp.run.run_notebook notebooks/01_teacher.ipynb --out . -p quick true --expect figures/environments.pdf

A notebook has a cell tagged `parameters` that holds only `name = literal` lines. One of them is `out`, the folder into
which it writes `figures/` and `data/results/`. The run sets `out` to a staging folder, and moves the files to the real
`out` only after every cell ran without an error. A parameter `runs`, if there is one, is set to the real
`out`/data/runs.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import filecmp
import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from .atomic import ROOT, read_bytes, write_text
from .command import CommandError, in_one_line
from .listed import MANIFEST, list_file
from .locks import folder_lock
from .notebook import NotebookNode, nbformat

KERNEL = "python3"
TIMEOUT = 1800  # seconds per cell
EXECUTED = "figures/executed"
KERNEL_FOLDERS = {  # folders a kernel writes to, by variable; the next run removes what a killed one left
    "TMPDIR": "tmp",
    "JOBLIB_TEMP_FOLDER": "tmp",
    "IPYTHONDIR": "ipython",  # without the user's start-up files
    "JUPYTER_RUNTIME_DIR": "jupyter",
    "MPLCONFIGDIR": "matplotlib",
}
KERNEL_SETTINGS = {
    "OMP_NUM_THREADS": "1",  # the same sums in the same order, also without make
    "OPENBLAS_NUM_THREADS": "1",
    "JUPYTER_PREFER_ENV_PATH": "1",  # no kernel of another Python, whatever is installed
    "SDL_VIDEODRIVER": "dummy",  # no search for a screen, and no message about it on standard error
    "PYDEVD_DISABLE_FILE_VALIDATION": "1",  # no debugger message on standard error
}
_VARIES = re.compile(r"\bat 0x[0-9a-f]{6,}|ipykernel_\d+")  # addresses of objects; process numbers in warnings
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# A user can fix these: a damaged file, a full or read-only disk, a cluster
_MENDABLE = ("DamagedFile", "MissingFile", "OSError", "PermissionError", "WorkerDied", "UnlikeWorker", "NoScheduler")
_WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"


class NotebookError(CommandError):
    """A notebook that did not run to its end without an error; the message names it and the cell."""


def run_notebook(
    notebook: str | os.PathLike,
    out: str | os.PathLike,
    *,
    parameters: dict[str, object] | None = None,
    expect: Sequence[str] = (),
    executed: str = EXECUTED,
) -> list[str]:
    """Run `notebook` with `parameters` and move the files that it made to `out`. Returns those that changed there.

    `expect` names files, relative to `out`, that the notebook must make. An executed copy, without anything that varies
    between runs, goes to the folder `executed` in `out`. Raises CommandError if another process runs the same notebook
    into the same `out`, NotebookError, DamagedFile, MissingFile, or OSError for a full or read-only disk. The earlier
    files of `out` then stay, unless the disk fails while files are moved.
    """
    notebook, out = Path(notebook).resolve(), Path(out).resolve()
    source, declared = _read(notebook)
    values = {**(parameters or {}), "out": str(out)}
    if "runs" in declared:
        values.setdefault("runs", str(out / "data" / "runs"))
    _check_parameters(notebook, declared, values)
    running = out / "build" / "running" / notebook.stem
    with folder_lock(running, f"another run of {notebook.stem} writes into {out}"):
        for left in running.iterdir():
            shutil.rmtree(left, ignore_errors=True)  # left by a killed run
        # A new name each time: an orphaned kernel may still write to an old folder
        work = Path(tempfile.mkdtemp(dir=running))
        staging = work / "out"
        try:
            staging.mkdir()
            cells = _execute(notebook, {**values, "out": str(staging)}, work)
            for cell in cells:
                _check_cell(notebook, cell, (str(out), str(ROOT), sys.prefix))
            _write_copy(source, cells, staging / executed / notebook.name)
            missing = [name for name in expect if not (staging / name).is_file() or not (staging / name).stat().st_size]
            if missing:
                raise NotebookError(f"{notebook.name}: ran, but did not make {', '.join(missing)}")
            return _publish(staging, out)
        finally:
            shutil.rmtree(work, ignore_errors=True)


def _read(notebook: Path) -> tuple[NotebookNode, dict[str, object]]:
    """Return the notebook and the defaults of its parameters."""
    content = read_bytes(notebook)
    try:
        source = nbformat.reads(content.decode(), as_version=4)
        tagged = [cell for cell in source.cells if "parameters" in cell.metadata.get("tags", [])]
    except (nbformat.ValidationError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise NotebookError(f"{notebook.name}: not a notebook: {error!r:.300}") from error
    if len(tagged) != 1:
        raise NotebookError(f'{notebook.name}: {len(tagged)} cells have the tag "parameters", expected one')
    try:
        lines = [line for line in ast.parse(tagged[0].source).body if not isinstance(line, ast.Expr)]
        return source, {line.targets[0].id: ast.literal_eval(line.value) for line in lines}
    except (AttributeError, SyntaxError, ValueError) as error:
        raise NotebookError(f"{notebook.name}: parameters cell: expected `name = literal` lines: {error}") from error


def _check_parameters(notebook: Path, declared: dict[str, object], values: dict[str, object]) -> None:
    for name, value in values.items():
        if name not in declared:
            raise NotebookError(f"{notebook.name}: unknown parameter {name!r}, expected one of {sorted(declared)}")
        if type(value) is not type(declared[name]):
            kind = type(declared[name]).__name__
            raise NotebookError(
                f"{notebook.name}: parameter {name} is {value!r}, expected {kind} as {declared[name]!r}"
            )


def _execute(notebook: Path, values: dict[str, object], work: Path) -> list[NotebookNode]:
    """Run a copy of the notebook by papermill with the parameters `values`. Returns its code cells."""
    import papermill
    from nbclient.exceptions import CellTimeoutError, DeadKernelError

    # The folder as in JupyterLab
    options = {"kernel_name": KERNEL, "language": "python", "cwd": notebook.parent, "execution_timeout": TIMEOUT}
    quiet = {"progress_bar": False, "extra_arguments": ["--log-level=CRITICAL"]}  # no log messages on standard error
    try:
        with _environment(work):
            ran = papermill.execute_notebook(notebook, work / notebook.name, values, **options, **quiet)
    except papermill.PapermillExecutionError as error:
        raise _failure(_name(notebook, error.source), error.ename, error.evalue, "\n".join(error.traceback)) from error
    except (CellTimeoutError, DeadKernelError) as error:
        saved = nbformat.read(work / notebook.name, as_version=4)
        begun = [cell.source for cell in saved.cells if cell.metadata.get("papermill", {}).get("start_time")]
        where = _name(notebook, *begun[-1:])
        raise NotebookError(f"{where} did not end: {type(error).__name__}: {error}") from error
    code = [cell for cell in ran.cells if cell.cell_type == "code"]
    return [cell for cell in code if "injected-parameters" not in cell.metadata.get("tags", [])]


def _name(notebook: Path, source: str = "") -> str:
    """Return the name of the notebook, and of the cell with this source by its first line, for messages."""
    first = source.strip().partition("\n")[0]
    return f"{notebook.name}, code cell ({first})" if first else notebook.name


@contextlib.contextmanager
def _environment(work: Path) -> Iterator[None]:
    """Give kernels an environment without settings of the user, in which nothing is written outside `work`."""
    before, settings = dict(os.environ), dict(KERNEL_SETTINGS)
    for name, folder in KERNEL_FOLDERS.items():
        (work / folder).mkdir(exist_ok=True)
        settings[name] = str(work / folder)
    for fonts in Path(sys.prefix).glob("matplotlib/fontlist-*.json"):  # made by the set-up
        shutil.copy(fonts, work / "matplotlib")
    os.environ.update(settings)
    os.environ.pop("MPLBACKEND", None)  # figures are outputs
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _failure(where: str, kind: str, message: str, traceback: str) -> NotebookError:
    """Return the error in one line if a user can fix it, such as a damaged file, else with the traceback."""
    details = "" if kind in _MENDABLE else "\n" + _COLOUR.sub("", traceback)
    return NotebookError(f"{where} failed: {kind}: {message}{details}")


def _check_cell(notebook: Path, cell: NotebookNode, folders: Sequence[str]) -> None:
    """Raise NotebookError if the cell failed, never ran, or shows what differs between machines, such as `folders`."""
    where = _name(notebook, cell.source)
    if cell.source.strip() and cell.execution_count is None:
        raise NotebookError(f"{where} never ran")
    for output in cell.outputs:
        if output["output_type"] == "error":  # papermill takes `sys.exit(0)` for a success
            raise _failure(where, output["ename"], output["evalue"], "\n".join(output["traceback"]))
        shown = output.get("text") or json.dumps(output.get("data", {}))
        if varying := _VARIES.findall(shown) + [folder for folder in folders if folder in shown]:
            raise NotebookError(f"{where} shows {varying[0]!r}, which differs between runs: end with `;`, or fix it")


def _write_copy(source: NotebookNode, cells: list[NotebookNode], path: Path) -> None:
    """Write the source with the outputs of its run. Other parts of a notebook that a run changes vary between runs."""
    result = copy.deepcopy(source)
    result.metadata = {
        "kernelspec": {"name": KERNEL, "display_name": "Python 3", "language": "python"},
        "language_info": {"name": "python"},
    }
    targets = [cell for cell in result.cells if cell.cell_type == "code"]
    for number, (target, cell) in enumerate(zip(targets, cells, strict=True), 1):
        target.outputs, target.execution_count = clean_outputs(cell.outputs, number), number
    write_text(path, nbformat.writes(result) + "\n")


def clean_outputs(outputs: list[NotebookNode], number: int) -> list[NotebookNode]:
    """Return the outputs of code cell `number` in a form that is the same for every run.

    Text is joined into one piece. Widgets are replaced by their static image; a widget without one, such as a progress
    bar, is removed.
    """
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
    return result


def _publish(staging: Path, out: Path) -> list[str]:
    """Move each staged file to its place in `out`; a file with the same bytes stays untouched. Results are listed."""
    staged = (path.relative_to(staging).as_posix() for path in staging.rglob("*") if path.is_file())
    names = sorted(name for name in staged if Path(name).name != MANIFEST)
    same = {name for name in names if (out / name).is_file() and filecmp.cmp(staging / name, out / name, shallow=False)}
    changed = [name for name in names if name not in same]
    for name in changed:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.move(staging / name, out / name)  # also to another disk
    for name in names:
        if name.startswith("data/results/"):
            list_file(out / name)  # unchanged files too: a run may have been killed before this line
    return changed


def _value(text: str) -> object:
    """Parse a parameter from the command line as JSON (true, 3, 0.5); other text is returned as it is."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m vsp.run.run_notebook", description="Run one notebook headless.")
    parser.add_argument("notebook")
    parser.add_argument("--out", default=".", help="folder for figures/ and data/results/ (%(default)s)")
    parser.add_argument("-p", dest="parameters", nargs=2, action="append", default=[], metavar=("NAME", "VALUE"))
    parser.add_argument("--expect", nargs="+", default=[], metavar="FILE", help="files in OUT that it must make")
    parser.add_argument("--executed", default=EXECUTED, help="folder in OUT for the executed copy (%(default)s)")
    options = vars(parser.parse_args(arguments))
    began, notebook = time.monotonic(), options.pop("notebook")
    name = Path(notebook).name
    with in_one_line(name):
        print(f"{name}: running", flush=True)
        options["parameters"] = {key: _value(text) for key, text in options["parameters"]}
        changed = run_notebook(notebook, options.pop("out"), **options)
        files = f"{len(changed)} file{'s' * (len(changed) != 1)}"
        print(f"{name}: done in {time.monotonic() - began:.0f} s, {files} changed", flush=True)


if __name__ == "__main__":
    main()
