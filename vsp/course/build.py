"""Student copies, solution copies and a lecturer's guide, all from the sources of the lessons.

    python -m vsp.course.build --out .

A source is a notebook with nbgrader's metadata: solution cells, whose answers stand between `### BEGIN SOLUTION` and
`### END SOLUTION`, and check cells. Cells tagged `lecturer` go to the guide alone. A student's copy has nbgrader's stub
in place of each answer, as `nbgrader generate_assignment` would make it from the solution copy.
"""

from __future__ import annotations

import argparse
import copy
import os
import re
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from ..store import ROOT, write_text

SOURCES = ROOT / "notebooks" / "course"
BEGIN, END = "### BEGIN SOLUTION", "### END SOLUTION"
STUB = ("# YOUR CODE HERE", "raise NotImplementedError()")  # nbgrader's own
_ANSWER = re.compile(rf"^([ \t]*){re.escape(BEGIN)}\n.*?^[ \t]*{re.escape(END)}$", re.MULTILINE | re.DOTALL)


def build(out: str | os.PathLike) -> list[Path]:
    """Write the copies and the guide to OUT/build/course; returns the files. The same sources, the same bytes."""
    folder, lessons, written = Path(out) / "build" / "course", read_sources(), []
    for name, lesson in lessons.items():
        for kind, made in (("student", student(lesson)), ("solution", solution(lesson))):
            written.append(folder / kind / name)
            write_text(written[-1], nbformat.writes(made) + "\n")
    written.append(folder / "guide.md")
    write_text(written[-1], guide(lessons))
    return written


def read_sources() -> dict[str, NotebookNode]:
    """The lessons by file name, in order."""
    return {path.name: nbformat.read(path, as_version=4) for path in sorted(SOURCES.glob("lesson_*.ipynb"))}


def student(lesson: NotebookNode) -> NotebookNode:
    """A copy without answers and without the lecturer's cells; check cells cannot be edited."""
    made = solution(lesson)
    for cell in made.cells:
        if is_solution(cell):
            cell.source = without_answers(cell.source)
        if is_check(cell):
            cell.metadata.editable = cell.metadata.deletable = False
    return made


def solution(lesson: NotebookNode) -> NotebookNode:
    """A copy with answers, between their marks, and without the lecturer's cells: what nbgrader takes as its source."""
    made = copy.deepcopy(lesson)
    made.cells = [cell for cell in made.cells if not for_lecturer(cell)]
    return made


def without_answers(source: str) -> str:
    """The code of a solution cell with the stub in place of what stands between the marks.

    Raises ValueError for a mark without its counterpart, and for a solution cell without marks.
    """
    stubbed, n = _ANSWER.subn(lambda match: "\n".join(match[1] + line for line in STUB), source)
    if not n or BEGIN in stubbed or END in stubbed:
        raise ValueError(f"expected `{BEGIN}` and `{END}` in pairs, on lines of their own, in:\n{source}")
    return stubbed


def is_solution(cell: NotebookNode) -> bool:
    """Whether the student writes in this cell."""
    return cell.metadata.get("nbgrader", {}).get("solution", False)


def is_check(cell: NotebookNode) -> bool:
    """Whether this cell checks what the student wrote."""
    return cell.metadata.get("nbgrader", {}).get("grade", False)


def for_lecturer(cell: NotebookNode) -> bool:
    """Whether this cell is for the guide alone."""
    return "lecturer" in cell.metadata.get("tags", [])


def points(lesson: NotebookNode) -> int:
    """The points of all exercises of a lesson."""
    return sum(cell.metadata.nbgrader.points for cell in lesson.cells if is_check(cell))


def guide(lessons: dict[str, NotebookNode]) -> str:
    """The lecturer's guide, in Markdown: what the students see in short, then notes and solutions, lesson by lesson."""
    parts = [_BEFORE, "# What students see\n"]
    parts += [_overview(name, lesson) for name, lesson in lessons.items()]
    parts += ["# For lecturers only\n"]
    parts += [_notes(lesson) for lesson in lessons.values()]
    return "\n".join(parts)


def _overview(name: str, lesson: NotebookNode) -> str:
    """Title, aims and exercises with their points."""
    exercises = [re.search(r"^## (Exercise .*)", cell.source, re.MULTILINE) for cell in lesson.cells]
    worth = [cell.metadata.nbgrader.points for cell in lesson.cells if is_check(cell)]
    rows = [f"| {found[1]} | {n} |" for found, n in zip(filter(None, exercises), worth, strict=True)]
    table = "\n".join(["| exercise | points |", "|---|---|", *rows, f"| all | {points(lesson)} |"])
    return f"{_deeper(lesson.cells[0].source)}\n\nThe notebook: `student/{name}`.\n\n{table}\n"


def _notes(lesson: NotebookNode) -> str:
    """The lecturer's cells, each under the heading before it, and after them the solutions of that section."""
    lines, heading = [], ""
    for cell in lesson.cells:
        found = re.findall(r"^#{1,2} (.*)", cell.source, re.MULTILINE) if cell.cell_type == "markdown" else []
        if found and not for_lecturer(cell):
            heading = f"{'##' if cell is lesson.cells[0] else '###'} {found[0]}\n"
        if for_lecturer(cell) or is_solution(cell):
            lines += [heading] if heading else []
            lines += [f"```python\n{cell.source}\n```\n" if is_solution(cell) else f"{cell.source}\n"]
            heading = ""
    return "\n".join(lines)


def _deeper(markdown: str) -> str:
    """Markdown with its headings one level down."""
    return re.sub(r"^#", "##", markdown, flags=re.MULTILINE)


_BEFORE = """# Lecturer's guide

Three lessons of 90 minutes. `make course` writes the copies beside this guide: hand out `student/`; keep `solution/`.
Students need the environment that `make` sets up; `.venv/bin/jupyter lab build/course/student` opens the lessons. Every
exercise is followed by a check that answers at once. It calls what the student wrote and does not compare text, so any
way of solving an exercise counts, and nobody has to wait for you to hear what is wrong.

With nbgrader: the files in `solution/` are sources. Copy one to `source/<assignment>/`, run
`nbgrader generate_assignment`, and grade as ever; points are in the cells. The lessons in `notebooks/course` have the
same cells and the notes below besides: do not release those.
"""


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", default=".", help="folder that build/course is made in")
    for path in build(parser.parse_args().out):
        print(path)


if __name__ == "__main__":
    main()
