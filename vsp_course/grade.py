"""Grade an exam: `python -m vsp_course.grade NOTEBOOK --seed N`, with a number of your own.

Each exercise is graded in a fresh process, with other cases than in class. The lesson's own cells and checks run there,
and of the student's notebook the answers and cells that the student added, so it does not matter what else was deleted,
copied or altered. An answer runs in the process that judges it. So one with a word that a cheat needs, and hardly
anybody else, does not run: the lecturer reads it.
"""

import argparse
import contextlib
import importlib
import io
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from vsp.run.command import CommandError, in_one_line
from vsp.run.notebook import NotebookNode, nbformat

from .build import is_check, is_solution, read_sources
from .feedback import tables
from .slides import is_slide

SECONDS = 600  # for an exercise, with all cells before it
RIGHT = "right"
SUSPECT = re.compile(rf"\b(?:{'|'.join(tables('exam.toml')['suspect'])})\b")


def main() -> None:
    """Print a line for each exercise, and the sum of the points."""
    parser = argparse.ArgumentParser(prog="python -m vsp_course.grade", description=__doc__.split("\n")[0])
    parser.add_argument("notebook", type=Path, help="a student's notebook, whose name begins as its lesson's")
    parser.add_argument("--seed", type=int, required=True, help="of the cases: a number that students do not know")
    parser.add_argument("--exercise", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    lesson, written = _lesson(given.notebook), _written(given.notebook)
    if given.exercise is not None:
        return print(_verdict(f"vsp_course.{given.notebook.name[:8]}", lesson, written, given.exercise))
    points, exercises = 0, list(zip(filter(is_solution, lesson), filter(is_check, lesson), strict=True))
    for i, (answer, check) in enumerate(exercises):
        words = sorted(set(SUSPECT.findall("\n".join(written.get(answer.metadata.nbgrader.grade_id, [])))))
        read = f"read this answer, and mark it by hand: it has {', '.join(words)}"
        verdict = read if words else _in_a_process(given.notebook, f"--seed={given.seed}", f"--exercise={i}")
        got, most = check.metadata.nbgrader.points * (verdict == RIGHT), check.metadata.nbgrader.points
        points += got
        print(f"{got} of {most}: {check.source}: {verdict}", flush=True)
    print(f"{points} of {sum(check.metadata.nbgrader.points for _, check in exercises)} points")


def _in_a_process(path: Path, seed: str, exercise: str) -> str:
    env, command = os.environ | {"VSP_COURSE_SEED": seed[7:]}, [sys.executable, "-m", "vsp_course.grade"]
    options = {"stdin": subprocess.DEVNULL, "capture_output": True, "env": env, "timeout": SECONDS}
    try:
        done = subprocess.run([*command, path, seed, exercise], text=True, errors="replace", **options)
    except subprocess.TimeoutExpired:
        return f"not finished in {SECONDS} s"
    return done.stdout.strip() if done.returncode == 0 else "the process ended"


def _lesson(path: Path) -> list[NotebookNode]:
    """The code cells of the lesson of a student's notebook, as they are in the source."""
    for name, lesson in read_sources().items():
        if path.name.startswith(name[:8]):
            return [cell for cell in lesson.cells if cell.cell_type == "code" and not is_slide(cell)]
    raise CommandError(f"{path.name}, expected a name that begins with lesson_1, lesson_2 or lesson_3: rename it")


def _written(path: Path) -> dict[str, list[str]]:
    """For each answer, the cells that the student added or changed before it, and the answer. Of copies, all count."""
    written, added, worked = {}, [], {cell.source for cell in _lesson(path)}
    for cell in nbformat.read(path, 4).cells:
        if is_solution(cell):
            written.setdefault(cell.metadata.nbgrader.grade_id, []).extend([*added, cell.source])
            added = []
        elif cell.cell_type == "code" and not is_check(cell) and cell.source not in worked:
            added.append(cell.source)
    return written


def _verdict(module: str, cells: list[NotebookNode], written: dict[str, list[str]], n: int) -> str:
    """Check exercise n: `RIGHT`, or what is wrong."""
    (*before, check), ours, answers = cells[: [i for i, cell in enumerate(cells) if is_check(cell)][n] + 1], {}, {}
    for cell in before:
        if is_solution(cell):
            sources = written.get(cell.metadata.nbgrader.grade_id, [])
            for source in [] if SUSPECT.search("\n".join(sources)) else sources:
                theirs = ours | answers
                _run(source, theirs)
                answers = {name: value for name, value in theirs.items() if value is not ours.get(name)}
        elif not is_check(cell):
            _run(cell.source, ours)
    for loaded in [name for name in sys.modules if name.startswith("vsp_course")]:
        del sys.modules[loaded]  # with all that was altered there
    name = re.findall(r"\w+", check.source)[2]
    judged = ours | {"check": importlib.import_module(module), name: answers.get(name)}
    return _run(check.source, judged, SECONDS) or RIGHT


def _run(source: str, names: dict, seconds: int = 60) -> str:
    """Run a cell for its names, as far as it goes, without IPython's commands. Return what went wrong."""
    signal.signal(signal.SIGALRM, signal.default_int_handler)  # ends it by an error
    signal.alarm(seconds)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            exec(re.sub(r"^[%!].*$", "", source, flags=re.MULTILINE), names)
    except BaseException as error:
        return f"✗ {error}" if isinstance(error, AssertionError) else f"✗ {error!r}"
    finally:
        signal.alarm(0)
    return ""


if __name__ == "__main__":
    with in_one_line():
        main()
