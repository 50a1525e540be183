"""Build the student versions, the hand-out, the solutions, the slides and the lecturer's guide from the lessons.

    python -m vsp_course.build --out .
    python -m vsp_course.build --pages --out .

A source is a notebook with nbgrader's metadata: solution cells, whose answers stand between `### BEGIN SOLUTION` and
`### END SOLUTION`, and check cells. Cells tagged `lecturer` go to the guide alone; those tagged `slide` to the slides,
and what is said to them to the guide.
In a student version, nbgrader's stub replaces each answer, as `nbgrader generate_assignment` does with the solution.
The pages of the site are student versions with the output of the worked cells, run as students get them.
"""

import argparse
import copy
import hashlib
import itertools
import json
import os
import re
from pathlib import Path

from vsp.run.atomic import ROOT, DamagedFile, sha256, write_text
from vsp.run.command import in_one_line
from vsp.run.locks import folder_lock
from vsp.run.notebook import NotebookNode, nbformat
from vsp.run.run_notebook import KERNEL, clean_outputs
from vsp.run.sealed import read_sealed, write_sealed

from .handout import write_handout
from .live import live
from .slides import is_slide, slides, spoken

SOURCES = ROOT / "notebooks" / "course"
HERE = Path(__file__).parent
MADE = ".made"  # checksums of the files written last
BEGIN, END = "### BEGIN SOLUTION", "### END SOLUTION"
TIMEOUT = 600  # seconds for a cell of a page
STUB = ("# YOUR CODE HERE", "raise NotImplementedError()")  # nbgrader's own
_ANSWER = re.compile(rf"^([ \t]*){re.escape(BEGIN)}\n.*?^[ \t]*{re.escape(END)}$", re.MULTILINE | re.DOTALL)

_EXAM = re.compile(r"\*Exam\.\*\s(.*?)\s\*Answer:\*\s(.*)", re.DOTALL)


def build(out: str | os.PathLike) -> list[Path]:
    """Write all versions, slides and the guide to OUT/build/course and return the files. Same sources, same bytes. A
    file that somebody has edited is kept under another name."""
    folder, lessons = Path(out) / "build" / "course", read_sources()
    students = {name: nbformat.writes(student(lesson)) + "\n" for name, lesson in lessons.items()}
    texts = {f"student/{name}": text for name, text in students.items()}
    texts |= {f"solution/{name}": nbformat.writes(solution(lesson)) + "\n" for name, lesson in lessons.items()}
    texts |= {f"slides/{Path(name).stem}.html": slides(lesson) for name, lesson in lessons.items()}
    texts["slides/half_hour.html"] = slides(next(iter(lessons.values())), "half-hour")
    texts |= {name: (HERE / name).read_text("utf-8") for name in ("half_hour.md", "project.md", "project_marking.md")}
    texts["project_solution.py"] = (SOURCES / "project_solution.py").read_text("utf-8")
    texts |= exam(lessons) | {"guide.md": guide(lessons), "live.html": live()}
    made = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}
    with folder_lock(folder, f"another run writes into {folder}"):
        _keep_edited(folder, made)
        for name, text in texts.items():
            write_text(folder / name, text)
        write_sealed(folder / MADE, json.dumps(made).encode())
        write_handout(folder / "handout.zip", students | {"live.html": texts["live.html"]})
    return [folder / name for name in (*texts, "handout.zip")]


def _keep_edited(folder: Path, made: dict[str, str]) -> None:
    """Rename files that somebody edited: their checksum is neither the last build's nor this one's in `made`."""
    try:
        last = json.loads(read_sealed(folder / MADE))
    except (FileNotFoundError, DamagedFile):
        last = {}  # no record of the last build
    for name, checksum in made.items():
        path = folder / name
        if path.exists() and sha256(path) not in (last.get(name), checksum):
            names = (path.with_name(f"{path.stem}.kept-{n}{path.suffix}") for n in itertools.count(1))
            kept = next(name for name in names if not name.exists())
            path.rename(kept)
            print(f"{path} was edited: kept as {kept.name}")


def read_sources() -> dict[str, NotebookNode]:
    """The lessons by file name, in order."""
    return {path.name: nbformat.read(path, as_version=4) for path in sorted(SOURCES.glob("lesson_*.ipynb"))}


def student(lesson: NotebookNode) -> NotebookNode:
    """Return the student version: no answers, no lecturer's cells, read-only check cells."""
    made = solution(lesson)
    for cell in made.cells:
        if is_solution(cell):
            cell.source = without_answers(cell.source)
        if is_check(cell):
            cell.metadata.editable = cell.metadata.deletable = False
    return made


def solution(lesson: NotebookNode) -> NotebookNode:
    """Return the solution: answers between their marks, no lecturer's cells. nbgrader takes it as its source."""
    made = copy.deepcopy(lesson)
    # A kernel of the author's own, as in Conda, is unknown to nbgrader and to students
    made.metadata.kernelspec = {"name": "python3", "display_name": "Python 3 (ipykernel)", "language": "python"}
    made.cells = [cell for cell in made.cells if not for_lecturer(cell) and not is_slide(cell)]
    return made


def without_answers(source: str) -> str:
    """Replace each answer in a solution cell by the stub. Raises ValueError unless marks come in pairs."""
    stubbed, n = _ANSWER.subn(lambda match: "\n".join(match[1] + line for line in STUB), source)
    if not n or BEGIN in stubbed or END in stubbed:
        raise ValueError(f"expected `{BEGIN}` and `{END}` in pairs, on lines of their own, in:\n{source}")
    return stubbed


def is_solution(cell: NotebookNode) -> bool:
    """Whether the student writes in this cell."""
    return cell.metadata.get("nbgrader", {}).get("solution", False)


def is_check(cell: NotebookNode) -> bool:
    """Whether this cell checks a student's answer."""
    return cell.metadata.get("nbgrader", {}).get("grade", False)


def for_lecturer(cell: NotebookNode) -> bool:
    """Whether this cell appears in the guide only."""
    return "lecturer" in cell.metadata.get("tags", [])


def guide(lessons: dict[str, NotebookNode]) -> str:
    """Return the lecturer's guide in Markdown: an overview, then notes and solutions for each lesson."""
    parts = [(HERE / "guide.md").read_text(encoding="utf-8"), "# What students see\n"]
    parts += [_overview(name, lesson) for name, lesson in lessons.items()]
    parts += ["# For lecturers only\n"]
    parts += [f"{_notes(lesson)}\n### The slides, one by one\n\n{spoken(lesson)}" for lesson in lessons.values()]
    return "\n".join(parts)


def _overview(name: str, lesson: NotebookNode) -> str:
    """Title, aims and exercises with their points."""
    text = "\n".join(cell.source for cell in lesson.cells if not is_slide(cell))
    exercises = re.findall(r"^## (Exercise .*)", text, re.MULTILINE)
    points = [cell.metadata.nbgrader.points for cell in lesson.cells if is_check(cell)]
    rows = [f"| {exercise} | {n} |" for exercise, n in zip(exercises, points, strict=True)]
    table = "\n".join(["| exercise | points |", "|---|---|", *rows, f"| all | {sum(points)} |"])
    aims = re.sub(r"^#", "##", lesson.cells[0].source, flags=re.MULTILINE)  # headings one level down
    return f"{aims}\n\nThe notebook: `student/{name}`.\n\n{table}\n"


def _notes(lesson: NotebookNode) -> str:
    """The lecturer's cells and the solutions of each section, under its heading."""
    lines, heading = [], ""
    for cell in lesson.cells:
        if is_slide(cell):
            continue
        titles = re.findall(r"^#{1,2} (.*)", cell.source, re.MULTILINE) if cell.cell_type == "markdown" else []
        if titles and not for_lecturer(cell):
            heading = f"{'##' if cell is lesson.cells[0] else '###'} {titles[0]}\n"
        if for_lecturer(cell) or is_solution(cell):
            lines += [heading, f"```python\n{cell.source}\n```\n" if is_solution(cell) else f"{cell.source}\n"]
            heading = ""
    return "\n".join(filter(None, lines))


def exam(lessons: dict[str, NotebookNode]) -> dict[str, str]:
    """Return the lecturer's questions for an exam as one file in Markdown, and the answers as another."""
    cells = [(n, cell) for n, lesson in enumerate(lessons.values(), 1) for cell in lesson.cells if for_lecturer(cell)]
    found = [(n, *pair) for n, cell in cells for pair in _EXAM.findall(cell.source)]
    questions = "\n".join(f"{i}. Lesson {n}. {' '.join(text.split())}" for i, (n, text, _) in enumerate(found, 1))
    answers = "\n".join(f"{i}. {' '.join(text.split())}" for i, (_, _, text) in enumerate(found, 1))
    return {"exam.md": f"# Questions for an exam\n\n{questions}\n", "exam_answers.md": f"# Answers\n\n{answers}\n"}


def write_pages(out: str | os.PathLike) -> list[Path]:
    """Write the pages of the site to OUT/build/course/pages and return the files. Same sources, same bytes."""
    folder, lessons = Path(out) / "build" / "course" / "pages", read_sources()
    for name, lesson in lessons.items():
        write_text(folder / name, nbformat.writes(page(student(lesson))) + "\n")
    write_text(folder / "course" / "live.html", live())
    return [folder / name for name in (*lessons, "course/live.html")]


def page(lesson: NotebookNode) -> NotebookNode:
    """Run a student version and return it with the outputs of its worked cells; exercises and checks show none. Raises
    RuntimeError if a worked cell fails."""
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
    parser.add_argument("--out", default=".", help="files go to OUT/build/course")
    parser.add_argument("--pages", action="store_true", help="write the pages of the site, and nothing else")
    options = parser.parse_args()
    if options.pages:
        print(*write_pages(options.out), sep="\n")
        return
    folder = build(options.out)[-1].parent
    print(f"lessons, slides and project are in {folder}: begin with guide.md; students get handout.zip")


if __name__ == "__main__":
    with in_one_line():
        main()
