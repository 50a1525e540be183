"""Run one notebook headless and strictly: it succeeds as a whole, or nothing that lies in `out` changes.

    python -m vsp.runner notebooks/01_teacher.ipynb --out . -p quick true --expect figures/environments.pdf

A notebook has a cell tagged `parameters` that holds nothing but `name = literal` lines, one of them `out`: the folder
that it writes `figures/` and `data/results/` into. It gets a staging folder there, and what it wrote is moved to the
real `out` only after every cell ran without an error. `runs`, if it has one, is set to the real `out`/data/runs.
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

from .notebook import nbformat
from .store import MANIFEST, ROOT, alone, atomic_path, end_others, fix, heed_sigterm, list_file, reason, sweep

KERNEL = "python3"
_VARIES = re.compile(r"\bat 0x[0-9a-f]{6,}|ipykernel_\d+")  # addresses of objects; process numbers in warnings
_SYSTEM_ERROR = re.compile(r"\[Errno (\d+)\] ")
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
_WIDGET_STATE = "application/vnd.jupyter.widget-state+json"


class NotebookError(RuntimeError):
    """A notebook that did not run as a whole; the message names it and the cell."""


class KernelDied(NotebookError):
    """A notebook whose kernel was killed."""


def run(
    notebook: str | os.PathLike,
    out: str | os.PathLike,
    *,
    parameters: dict[str, object] | None = None,
    expect: Sequence[str] = (),
    timeout: int = 1800,
) -> list[str]:
    """Run `notebook` with `parameters` and move what it made to `out`; returns the files that changed there.

    `expect` names files, relative to `out`, that the notebook must make; `timeout` is in seconds, for each cell. An
    executed copy without anything that varies from run to run goes to figures/executed. Runs of one notebook into one
    `out` wait for each other. Raises NotebookError, or OSError for a disk that is full or closed; the earlier files of
    `out` stay.
    """
    notebook, out = Path(notebook).resolve(), Path(out).resolve()
    source, declared = _read(notebook)
    values = {**(parameters or {}), "out": str(out)}
    if "runs" in declared:
        values.setdefault("runs", str(out / "data" / "runs"))
    _check_parameters(notebook, declared, values)
    running = out / "build" / "running"
    with alone(out / "build" / "locks" / notebook.stem, f"of {notebook.stem} writes into {out}"):
        for left in running.glob(f"{notebook.stem}-*"):
            shutil.rmtree(left, ignore_errors=True)  # of a run that was killed
        running.mkdir(exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=running, prefix=f"{notebook.stem}-"))  # not where an orphaned kernel may write
        staging = work / "out"
        try:
            staging.mkdir()
            values["out"] = str(staging)
            cells = _execute(notebook, work / notebook.name, values, timeout)
            _check_outputs(notebook, cells, out)
            _write_copy(source, cells, staging / "figures" / "executed" / notebook.name)
            _check_files(notebook, staging, expect)
            return _publish(staging, out)
        finally:
            shutil.rmtree(work, ignore_errors=True)


def _read(notebook: Path) -> tuple[nbformat.NotebookNode, dict[str, object]]:
    """The notebook and the defaults of its parameters."""
    if not notebook.is_file():
        raise NotebookError(f"{notebook}: no such notebook")
    try:
        source = nbformat.read(notebook, as_version=4)
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        tagged = [cell for cell in source.cells if "parameters" in cell.metadata.get("tags", [])]
    except (nbformat.ValidationError, ValueError, KeyError, TypeError, AttributeError) as error:
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


def _execute(notebook: Path, copy_path: Path, values: dict, timeout: int) -> list[nbformat.NotebookNode]:
    """The code cells of `notebook` after its run, without the one that papermill injects."""
    _set_environment(copy_path.parent)
    import papermill

    stopped = None
    try:
        papermill.execute_notebook(
            notebook,
            copy_path,
            parameters=values,
            kernel_name=KERNEL,
            language="python",
            cwd=notebook.parent,  # as in JupyterLab
            execution_timeout=timeout,
            progress_bar=sys.stderr.isatty(),
            extra_arguments=["--log-level=CRITICAL"],  # the kernel's own chatter on standard error
        )
    except Exception as error:  # whatever it was, the copy tells how far the notebook came
        if fix(getattr(error, "errno", None)):  # unless there is no room for the copy
            error.filename = error.filename or str(copy_path)
            raise
        stopped = error
    executed = nbformat.read(copy_path, as_version=4) if copy_path.exists() else nbformat.v4.new_notebook()
    code = [cell for cell in executed.cells if cell.cell_type == "code"]
    cells = [cell for cell in code if "injected-parameters" not in cell.metadata.get("tags", [])]
    _check_cells(notebook, cells, stopped)
    _check_widgets(notebook, executed.metadata)
    return cells


def _set_environment(work: Path) -> None:
    """For the kernel: nobody's settings, nothing written outside `work`, the same sums; also without make."""
    for name in ("MPLBACKEND", "JUPYTER_PATH"):  # pictures go into the notebook; the kernel is this Python
        os.environ.pop(name, None)
    os.environ["JUPYTER_PREFER_ENV_PATH"] = "1"
    os.environ["JUPYTER_RUNTIME_DIR"] = str(work / "jupyter")
    os.environ["IPYTHONDIR"] = str(work / "ipython")  # nobody's start-up files
    os.environ["MPLCONFIGDIR"] = str(work / "matplotlib")
    (work / "matplotlib").mkdir()
    for fonts in Path(sys.prefix).glob("matplotlib/fontlist-*.json"):  # which the set-up made
        shutil.copy(fonts, work / "matplotlib")
    os.environ["SDL_VIDEODRIVER"] = "dummy"  # no search for a screen, nor words about it on standard error
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
        os.environ[name] = "1"  # the same sums in the same order, also without make
    os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # no note of the debugger's on standard error


def _check_cells(notebook: Path, cells: list[nbformat.NotebookNode], stopped: Exception | None) -> None:
    """Every cell ran, in order, and without an error: papermill's own word is not enough."""
    names = [_where(notebook, number, cell) for number, cell in enumerate(cells, 1)]
    started = [name for name, cell in zip(names, cells) if cell.metadata.get("papermill", {}).get("start_time")]
    if stopped and type(stopped).__name__ != "PapermillExecutionError":  # no cell's own error: a dead kernel, a timeout
        where = started[-1] if started else notebook.name
        kind = KernelDied if "Kernel died" in str(stopped) else NotebookError  # in a cell, or before the first
        raise kind(f"{where} did not end: {type(stopped).__name__}: {stopped}") from stopped
    count = 0
    for name, cell in zip(names, cells):
        for output in cell.outputs:
            if output.output_type == "error":
                number = _SYSTEM_ERROR.match(output.evalue)
                remedy = number and fix(int(number[1]))
                end = f": {remedy}" if remedy else "\n" + _COLOUR.sub("", "\n".join(output.traceback))
                raise NotebookError(f"{name} failed: {output.ename}: {output.evalue}{end}")
        if cell.source.strip() and (cell.execution_count or 0) <= count:
            raise NotebookError(f"{name} never ran")
        count = cell.execution_count or count
    if stopped:
        raise NotebookError(f"{notebook.name}: {stopped}") from stopped


def _check_widgets(notebook: Path, metadata: dict) -> None:
    """No error hides in a widget: an `Output` widget keeps those of its block to itself, and the cell goes on."""
    widgets = metadata.get("widgets", {}).get(_WIDGET_STATE, {}).get("state", {}).values()
    for output in (output for widget in widgets for output in widget["state"].get("outputs", [])):
        if output["output_type"] == "error":
            trace = _COLOUR.sub("", "\n".join(output["traceback"]))
            raise NotebookError(f"{notebook.name}: a widget holds {output['ename']}: {output['evalue']}\n{trace}")


def _where(notebook: Path, number: int, cell: nbformat.NotebookNode) -> str:
    first = cell.source.strip().split("\n")[0]
    return f"{notebook.name}, code cell {number} ({first})"


def _check_outputs(notebook: Path, cells: list[nbformat.NotebookNode], out: Path) -> None:
    """Outputs show nothing that differs between two runs or two machines."""
    for number, cell in enumerate(cells, 1):
        shown = [output.get("text") or json.dumps(output.get("data", {})) for output in cell.outputs]
        if found := _VARIES.search("\n".join(shown)):
            where = _where(notebook, number, cell)
            raise NotebookError(
                f"{where} shows {found[0]!r}, which differs between runs: heed the warning, or end with `;`"
            )
        for folder in {str(out), str(ROOT), sys.prefix}:
            if any(folder in text for text in shown):
                raise NotebookError(f"{_where(notebook, number, cell)} shows a folder of this machine: {folder}")


def _write_copy(source: nbformat.NotebookNode, cells: list[nbformat.NotebookNode], path: Path) -> None:
    """The source with the outputs of its run: whatever else a run leaves in a notebook varies."""
    result = copy.deepcopy(source)
    result.metadata = {
        "kernelspec": {"name": KERNEL, "display_name": "Python 3", "language": "python"},
        "language_info": {"name": "python"},
    }
    targets = [cell for cell in result.cells if cell.cell_type == "code"]
    for number, (target, cell) in enumerate(zip(targets, cells, strict=True), 1):
        target.outputs, target.execution_count = clean_outputs(cell.outputs, number), number
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(result, path)


def clean_outputs(outputs: list[nbformat.NotebookNode], number: int) -> list[nbformat.NotebookNode]:
    """Outputs of code cell `number`; text that arrived in pieces, at the whim of a buffer, in one piece.

    Of a widget, which answers nobody without a kernel and is named at random, its still picture is left; one that has
    none, such as a progress bar, leaves nothing.
    """
    result: list[nbformat.NotebookNode] = []
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
    found = (path.relative_to(staging).as_posix() for path in staging.rglob("*") if path.is_file())
    names = sorted(name for name in found if Path(name).name != MANIFEST)
    same = {name for name in names if (out / name).is_file() and filecmp.cmp(staging / name, out / name, shallow=False)}
    changed = [name for name in names if name not in same]
    for folder in {(out / name).parent for name in changed}:  # all of them before the first file: all or nothing
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))
    for name in changed:
        _move(staging / name, out / name)
    for name in names:
        if name.startswith("data/results/"):
            list_file(out / name)  # also one that stays: a run may have been killed before this line
    return changed


def _move(path: Path, target: Path) -> None:
    try:
        os.replace(path, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        sweep(target)
        with atomic_path(target) as beside:  # figures/ or data/ lie on another disk
            shutil.copyfile(path, beside)


def _value(text: str) -> object:
    """A parameter from the command line: JSON where it is JSON (true, 3, 0.5), else the text itself."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m vsp.runner", description="Run one notebook, strictly.")
    parser.add_argument("notebook")
    parser.add_argument("--out", default=".", help="folder for figures/ and data/results/ (%(default)s)")
    parser.add_argument("-p", dest="parameters", nargs=2, action="append", default=[], metavar=("NAME", "VALUE"))
    parser.add_argument("--expect", nargs="+", default=[], metavar="FILE", help="files, in OUT, that it must make")
    parser.add_argument("--timeout", type=int, default=1800, help="seconds for each cell (%(default)s)")
    given = parser.parse_args(arguments)
    heed_sigterm()
    began, name = time.monotonic(), Path(given.notebook).name
    print(f"{name}: running", flush=True)
    try:
        parameters = {key: _value(text) for key, text in given.parameters}
        changed = run(given.notebook, given.out, parameters=parameters, expect=given.expect, timeout=given.timeout)
    except NotebookError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        if isinstance(error, KernelDied):  # make would wait for the others, minutes
            end_others(Path(given.out) / "build" / "locks")
        return 1
    except OSError as error:
        print(f"error: {name}: {reason(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"error: {name}: interrupted: the next make runs it anew", file=sys.stderr)
        return 130
    print(f"{name}: done in {time.monotonic() - began:.0f} s, {len(changed)} files changed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
