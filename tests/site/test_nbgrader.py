"""The lessons in nbgrader: it makes the same students' copies as we do, and gives a solution all its points."""

import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbgrader.api import Gradebook
from nbgrader.apps import NbGraderAPI
from traitlets.config import Config

from vsp.run.atomic import ROOT
from vsp_course import build

ASSIGNMENT = "homework"
LESSONS = build.read_sources()


@pytest.fixture(scope="module", params=LESSONS)
def course(request, tmp_path_factory):
    """nbgrader on a course folder of its own, with one lesson released; the folder; and our copies."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)  # nbgrader calls alembic by its name
        patch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)  # for kernels
        patch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
        yield released(request.param, tmp_path_factory.mktemp("course"))


def released(name, folder):
    copies = {path.parent.name: path for path in build.build(folder / "made") if path.name == name}
    put(copies["solution"], folder / "source" / ASSIGNMENT)
    config = Config()
    config.CourseDirectory.root = str(folder)
    config.CourseDirectory.db_url = f"sqlite:///{folder}/gradebook.db"
    api = NbGraderAPI(config=config)
    result = api.generate_assignment(ASSIGNMENT)
    assert result["success"], result["error"]
    return api, folder, copies


def put(notebook, folder):
    folder.mkdir(parents=True)
    (folder / notebook.name).write_bytes(notebook.read_bytes())


def graded(course, who, notebook):
    """Points of a submission, by exercise."""
    api, folder, _ = course
    put(notebook, folder / "submitted" / who / ASSIGNMENT)
    result = api.autograde(ASSIGNMENT, who)
    assert result["success"], result["error"]
    with Gradebook(f"sqlite:///{folder}/gradebook.db") as book:
        submission = book.find_submission_notebook(notebook.stem, ASSIGNMENT, who)
        return {grade.name: (grade.score, grade.max_score) for grade in submission.grades}


def test_releases_are_our_students_copies(course):
    _, folder, copies = course
    theirs = nbformat.read(folder / "release" / ASSIGNMENT / copies["student"].name, as_version=4)
    ours = nbformat.read(copies["student"], as_version=4)
    assert [(c.cell_type, c.id, c.source) for c in theirs.cells] == [(c.cell_type, c.id, c.source) for c in ours.cells]


def test_a_solution_gets_all_points(course):
    notebook = course[2]["solution"]
    points = graded(course, "ada", notebook)
    assert len(points) == 7 and all(score == most for score, most in points.values()), points
    assert sum(score for score, _ in points.values()) == build.points(LESSONS[notebook.name])


def test_one_right_answer_gets_its_points(course, tmp_path):
    """And others none, also where a student altered the check of the next exercise: nbgrader puts it back."""
    path = course[2]["student"]
    notebook = nbformat.read(path, as_version=4)
    answers = {cell.id: cell.source for cell in LESSONS[path.name].cells}
    first = next(cell for cell in notebook.cells if build.is_solution(cell))
    first.source = answers[first.id]
    checks = [cell for cell in notebook.cells if build.is_check(cell)]
    checks[1].source = "print('all is well')"
    nbformat.write(notebook, tmp_path / path.name)
    points = graded(course, "cyd", tmp_path / path.name)
    assert len(points) == 7
    assert [name for name, (score, _) in points.items() if score] == [checks[0].metadata.nbgrader.grade_id], points
