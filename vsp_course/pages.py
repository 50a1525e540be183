"""The lessons as pages of the site: student versions with the output of the worked cells.

    python -m vsp_course.pages --out .

Each is run as students get it; exercises and their checks show no output.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from vsp.run.atomic import write_text
from vsp.run.command import in_one_line
from vsp.run.run_notebook import KERNEL, clean_outputs

from .build import SOURCES, is_check, is_solution, read_sources, student

TIMEOUT = 600  # seconds for a cell


def write_pages(out: str | os.PathLike) -> list[Path]:
    """Write the pages to OUT/build/course/pages and return the files. Same sources, same bytes."""
    written = []
    for name, lesson in read_sources().items():
        written.append(Path(out) / "build" / "course" / "pages" / name)
        write_text(written[-1], nbformat.writes(page(student(lesson))) + "\n")
    return written


def page(lesson: NotebookNode) -> NotebookNode:
    """Run a student version and return it with its outputs. Raises RuntimeError if a worked cell fails."""
    from nbclient import NotebookClient

    lesson.metadata.kernelspec = {"name": KERNEL, "display_name": "Python 3", "language": "python"}
    options = {"kernel_name": KERNEL, "allow_errors": True, "resources": {"metadata": {"path": str(SOURCES)}}}
    quiet = ["--log-level=CRITICAL"]  # no messages of the kernel itself
    NotebookClient(lesson, timeout=TIMEOUT, extra_arguments=quiet, **options).execute()
    code = [cell for cell in lesson.cells if cell.cell_type == "code"]
    for number, cell in enumerate(code, 1):
        cell.metadata.pop("execution", None)  # times
        cell.execution_count = number
        errors = [output.evalue for output in cell.outputs if output.output_type == "error"]
        if is_solution(cell) or is_check(cell):
            cell.outputs = []
        elif errors:
            raise RuntimeError(f"cell {cell.id} fails where no exercise is solved: {errors[0]}")
        cell.outputs = clean_outputs(cell.outputs, number)
    lesson.metadata.pop("widgets", None)
    lesson.metadata.language_info = {"name": "python"}
    return lesson


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", default=".", help="pages go to OUT/build/course/pages")
    for path in write_pages(parser.parse_args().out):
        print(path)


if __name__ == "__main__":
    with in_one_line():
        main()
