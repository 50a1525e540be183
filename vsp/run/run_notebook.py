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
import copy
import errno
import filecmp
import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from .atomic import ROOT, disk_remedy, read_bytes, write_text
from .command import CommandError, in_one_line
from .listed import MANIFEST, list_file
from .locks import file_lock
from .notebook import NotebookNode, nbformat

KERNEL = "python3"
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
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "SDL_VIDEODRIVER": "dummy",  # no search for a screen, and no message about it on standard error
    "PYDEVD_DISABLE_FILE_VALIDATION": "1",  # no debugger message on standard error
}
_VARIES = re.compile(r"\bat 0x[0-9a-f]{6,}|ipykernel_\d+")  # addresses of objects; process numbers in warnings
_SYSTEM_ERROR = re.compile(r"\[Errno (\d+)\] ")
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_MENDABLE = ("DamagedFile", "MissingFile", "WorkerDied", "UnlikeWorker", "NoScheduler")  # a user can fix these
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
    timeout: int = 1800,
) -> list[str]:
    """Run `notebook` with `parameters` and move the files that it made to `out`. Returns those that changed there.

    `expect` names files, relative to `out`, that the notebook must make. An executed copy, without anything that varies
    between runs, goes to the folder `executed` in `out`. `timeout` is in seconds per cell. Raises CommandError if
    another process runs the same notebook into the same `out`, NotebookError, DamagedFile, MissingFile, or OSError for
    a full or read-only disk; the earlier files of `out` then stay.
    """
    notebook, out = Path(notebook).resolve(), Path(out).resolve()
    source, declared = _read(notebook)
    values = {**(parameters or {}), "out": str(out)}
    if "runs" in declared:
        values.setdefault("runs", str(out / "data" / "runs"))
    _check_parameters(notebook, declared, values)
    running = out / "build" / "running"
    with file_lock(out / "build" / "locks" / notebook.stem, f"of {notebook.stem} writes into {out}"):
        for left in running.glob(f"{notebook.stem}-*"):
            shutil.rmtree(left, ignore_errors=True)  # left by a killed run
        running.mkdir(exist_ok=True)
        # A new name each time: an orphaned kernel may still write to an old folder
        work = Path(tempfile.mkdtemp(dir=running, prefix=f"{notebook.stem}-"))
        staging = work / "out"
        try:
            staging.mkdir()
            cells = _execute(notebook, source, {**values, "out": str(staging)}, work, timeout)
            for where, cell in cells.items():
                _check_shown(where, cell, (str(out), str(ROOT), sys.prefix))
            _write_copy(source, list(cells.values()), staging / executed / notebook.name)
            _check_files(notebook, staging, expect)
            return _publish(staging, out)
        finally:
            shutil.rmtree(work, ignore_errors=True)


def _read(notebook: Path) -> tuple[NotebookNode, dict[str, object]]:
    """Return the notebook and the defaults of its parameters."""
    content = read_bytes(notebook)
    try:
        cells = json.loads(content)["cells"]
        source = nbformat.reads(content.decode(), as_version=4)
        tagged = [cell for cell in source.cells if "parameters" in cell.metadata.get("tags", [])]
    except (nbformat.ValidationError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise NotebookError(f"{notebook.name}: not a notebook: {error!r:.300}") from error
    if any("id" not in cell for cell in cells):
        raise NotebookError(f"{notebook.name}: has cells without an id, expected format 4.5: save it in JupyterLab")
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


def _execute(
    notebook: Path, source: NotebookNode, values: dict[str, object], work: Path, timeout: int
) -> dict[str, NotebookNode]:
    """Run a copy of the notebook with the parameters `values`. Returns its code cells by a name for messages."""
    from jupyter_client import AsyncKernelManager
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError

    running = copy.deepcopy(source)
    code = [cell for cell in running.cells if cell.cell_type == "code"]
    firsts = [cell.source.strip().partition("\n")[0] for cell in code]
    names = [f"{notebook.name}, code cell {number} ({first})" for number, first in enumerate(firsts, 1)]
    (parameters,) = (cell for cell in code if "parameters" in cell.metadata.get("tags", []))
    parameters.source += "".join(f"\n{name} = {value!r}" for name, value in values.items())
    kernels = AsyncKernelManager(kernel_name=KERNEL, connection_file=str(work / "kernel.json"))
    kernels.kernel_spec_manager.kernel_dirs = []  # no kernel of another Python, whatever is installed
    client = NotebookClient(
        running,
        km=kernels,
        timeout=timeout,
        resources={"metadata": {"path": str(notebook.parent)}},  # as in JupyterLab
        extra_arguments=["--log-level=CRITICAL"],  # no log messages of the kernel on standard error
    )
    where = notebook.name
    try:
        with client.setup_kernel(env=_environment(work), cleanup_kc=True):
            for where, cell in zip(names, code):  # noqa: B007 (for the message below)
                client.execute_cell(cell, running.cells.index(cell))
    except CellExecutionError:
        pass  # the outputs of the cell hold the error
    except Exception as error:
        if disk_remedy(getattr(error, "errno", None)):
            raise
        raise NotebookError(f"{where} did not end: {type(error).__name__}: {error}") from error
    for where, cell in zip(names, code):
        for output in cell.outputs:
            if output["output_type"] == "error":
                raise _failure(where, output["ename"], output["evalue"], "\n".join(output["traceback"]))
        if cell.source.strip() and cell.execution_count is None:
            raise NotebookError(f"{where} never ran")
    return dict(zip(names, code))


def _environment(work: Path) -> dict[str, str]:
    """Return the kernel's environment variables: no settings of the user, and nothing is written outside `work`."""
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}  # figures are outputs
    for name, folder in KERNEL_FOLDERS.items():
        (work / folder).mkdir(exist_ok=True)
        environment[name] = str(work / folder)
    for fonts in Path(sys.prefix).glob("matplotlib/fontlist-*.json"):  # made by the set-up
        shutil.copy(fonts, work / "matplotlib")
    return environment | KERNEL_SETTINGS


def _failure(where: str, kind: str, message: str, traceback: str) -> NotebookError:
    """Return the error in one line if a user can fix it, such as a damaged file, else with the traceback."""
    number = _SYSTEM_ERROR.match(message)
    remedy = disk_remedy(int(number[1])) if number else None
    if kind in _MENDABLE or remedy:
        return NotebookError(": ".join(filter(None, (f"{where} failed: {kind}: {message}", remedy))))
    return NotebookError(f"{where} failed: {kind}: {message}\n{_COLOUR.sub('', traceback)}")


def _check_shown(where: str, cell: NotebookNode, folders: Sequence[str]) -> None:
    """Raise NotebookError if the cell shows something that differs between runs or machines, such as `folders`."""
    for output in cell.outputs:
        shown = output.get("text") or json.dumps(output.get("data", {}))
        if varying := _VARIES.search(shown):
            raise NotebookError(
                f"{where} shows {varying[0]!r}, which differs between runs: fix the warning, or end with `;`"
            )
        for folder in folders:
            if folder in shown:
                raise NotebookError(f"{where} shows a folder of this machine: {folder}")


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


def _check_files(notebook: Path, staging: Path, expect: Sequence[str]) -> None:
    missing = [name for name in expect if not (staging / name).is_file() or not (staging / name).stat().st_size]
    if missing:
        raise NotebookError(f"{notebook.name}: ran, but did not make {', '.join(missing)}")
    for path in staging.rglob("*"):
        place = path.relative_to(staging).as_posix()
        if path.is_file() and not place.startswith(("figures/", "data/results/")):
            raise NotebookError(f"{notebook.name}: wrote {place}, expected files in figures/ and data/results/ only")


def _publish(staging: Path, out: Path) -> list[str]:
    """Move each staged file to its place in `out`; a file with the same bytes stays untouched. Results are listed."""
    staged = (path.relative_to(staging).as_posix() for path in staging.rglob("*") if path.is_file())
    names = sorted(name for name in staged if Path(name).name != MANIFEST)
    same = {name for name in names if (out / name).is_file() and filecmp.cmp(staging / name, out / name, shallow=False)}
    changed = [name for name in names if name not in same]
    for folder in {(out / name).parent for name in changed}:  # check all folders before moving any file: all or nothing
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))
    for name in changed:
        os.replace(staging / name, out / name)
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
    parser.add_argument("--timeout", type=int, default=1800, help="seconds per cell (%(default)s)")
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
