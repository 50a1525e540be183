"""Exams: right answers get their points in a troubled notebook, too, and cheats get none."""

from support import python

from vsp.run.notebook import nbformat
from vsp_course import build, grade

# What is written in place of an answer, and what is said then, by the exercise's number
CHEATS = {
    1: ("import os\nos._exit(0)", "it has os"),  # nor does it run before the others
    2: ("def fit_linear(states, actions):\n    raise GeneratorExit('right')", "GeneratorExit"),
    3: ("check.MARGIN = 9\ndef action_error(policy, teacher, states):\n    return input()", "EOFError"),
    4: ("raise SystemExit", "found None"),
    5: ("def act(codewords, coefficients, states):\n    (1).bit_length.__class__\n    import sys", "__class__, sys"),
    6: ("codewords = [[0.29, 0.1], [0.07, 1.0], [0.28, 0.31], [0.69, 0.04], [0.9, 0.9]]", "at most 4"),
    7: ("def place(states, actions, k):\n    while True:\n        pass", "not finished"),
}
GRADE = "from vsp_course import grade; grade.SECONDS = 20; grade.main()"


def graded(change, folder):
    """What is printed for each exercise of lesson 1, whose solution `change` alters, and the sum."""
    notebook = build.solution(build.read_sources()["lesson_1_black_box.ipynb"])
    change(notebook, [cell for cell in notebook.cells if build.is_solution(cell)])
    nbformat.write(notebook, folder / "lesson_1_black_box-Smith (1).ipynb")
    return python(GRADE, folder / "lesson_1_black_box-Smith (1).ipynb", "--seed=5").splitlines()


def test_an_answer_counts_whatever_else_goes_wrong(tmp_path):
    """A cell of the student's own, a command of IPython, errors and loops after the answer, a copy, a deleted check."""

    def trouble(notebook, answers):
        for answer, added in zip(answers, ("raise NotImplementedError", "input()", "nothing", "quit()")):
            answer.source = f"%matplotlib inline\n{answer.source}\n{added}"
        answers[4].source = answers[4].source.replace("return np.clip(", "return helper(np.clip)(")
        at, checks = notebook.cells.index(answers[4]), [cell for cell in notebook.cells if build.is_check(cell)]
        notebook.cells[at:at] = [nbformat.v4.new_code_cell("def helper(x):\n    return x"), answers[3], checks[5]]
        notebook.cells.remove(checks[0])

    *lines, total = graded(trouble, tmp_path)
    assert total == "15 of 15 points" and all(line.endswith(": right") for line in lines), lines
    assert "KeyboardInterrupt" in grade._run("x = 1\nwhile True:\n    pass", names := {}, 1) and names["x"] == 1


def test_wrong_answers_get_no_points_and_suspect_ones_are_to_be_read(tmp_path):
    def cheat(notebook, answers):
        for answer, (source, _) in zip(answers, CHEATS.values(), strict=True):
            answer.source = source

    for (_, words), line in zip(CHEATS.values(), graded(cheat, tmp_path)):
        assert line.startswith("0 of ") and words in line
