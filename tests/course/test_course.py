"""The course: its sources, the copies made of them, and that checks know right answers from wrong ones."""

import _thread
import ast
import dataclasses
import functools
import os
import re
import signal
import sys
import zipfile

import course_answers
import numpy as np
import pytest
from course_answers import EXERCISES
from IPython.core.interactiveshell import InteractiveShell
from support import SIMPLEGOAL, python

import vsp
from vsp import distill, show, split_regions, teacher_episodes
from vsp.paper import baselines, spread
from vsp.paper.readings import Readings
from vsp.run import atomic
from vsp.run.notebook import nbformat
from vsp_course import build, drawing, feedback, handout, lesson_1, lesson_2, lesson_3, slides

LESSONS = build.read_sources()
RUNS = {}


def once(teacher, task, config=None, *, seed, progress=False):
    """`distill`, whose runs are kept for the next copy of a lesson: same arguments, same policy."""
    key = teacher.digest, vsp.get_task(task).name, config or vsp.preset(task), seed
    if key not in RUNS:
        RUNS[key] = distill(teacher, task, config, seed=seed)
    return RUNS[key]


def keep_runs(monkeypatch):
    """Let checks use `once`."""
    for lesson in (lesson_2, lesson_3):
        monkeypatch.setattr(lesson, "distill", once)


def briefly(teacher, task, config, *, seed):
    """`distill` with a tenth of the iterations."""
    return distill(teacher, task, config.quick(), seed=seed)


@pytest.fixture(params=LESSONS)
def lesson(request):
    return LESSONS[request.param]


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def by_kind(notebook, wanted):
    return [cell for cell in notebook.cells if wanted(cell)]


def identity(cell):
    return cell.metadata.nbgrader.grade_id


# The sources


def test_pictures_have_alternative_text(lesson):
    for cell in code_cells(lesson):
        calls = [node for node in ast.walk(ast.parse(cell.source)) if isinstance(node, ast.Call)]
        shown = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "picture"]
        assert len(shown) == cell.source.count("fig, axes ="), cell.id
        assert all(len(ast.literal_eval(call.args[1])) > 40 for call in shown), cell.id


def test_every_exercise_has_a_text_with_hints_an_answer_a_check_and_notes(lesson):
    for i, cell in enumerate(lesson.cells):
        if build.is_check(cell):
            text, answer = lesson.cells[i - 2 : i]
            notes = next(cell for cell in lesson.cells[i:] if build.for_lecturer(cell))
            assert re.search(r"^## Exercise \d\.\d · ", text.source, re.MULTILINE), cell.id
            n = text.source.count("<details><summary>Hint")
            assert n == text.source.count("</details>") >= 1, cell.id
            assert build.is_solution(answer), cell.id
            assert all(f"*{part}.*" in notes.source for part in ("Common mistakes", "Discuss", "Exam")), cell.id


def hints(number):
    """The numbers of the hints of an exercise, counted from one."""
    texts = (cell.source for lesson in LESSONS.values() for cell in lesson.cells)
    (text,) = (text for text in texts if f"## Exercise {number} " in text)
    found = {int(n) for n in re.findall(r"Hint (\d)</summary>", text)}
    assert found == set(range(1, 1 + len(found))) != set()
    return found


def test_limits_in_the_text_are_those_of_the_checks():
    distil = next(c.source for c in LESSONS["lesson_3_does_it_work.ipynb"].cells if c.id == "distil")
    assert f"for seed in range({len(lesson_3.SEEDS)})" in distil and lesson_3.SEEDS.start == 0
    text = " ".join(cell.source for cell in LESSONS["lesson_1_black_box.ipynb"].cells)
    assert f"{lesson_1.CELLS} codewords, at most {lesson_1.MARGIN * 100:.0f} % of the error" in text
    assert f"(the median of {lesson_1.DRAWS} draws)" in text
    assert lesson_1.AT_MOST == 4 and f"**at most four codewords that leave at most {lesson_1.SHARE:.0%}" in text


# The copies


def test_students_get_stubs_and_no_answers(lesson):
    made = build.student(lesson)
    text = "\n".join(_stripped(cell.source) for cell in made.cells)
    for cell in by_kind(lesson, build.is_solution):
        answer = re.search(r"### BEGIN SOLUTION\n(.*?)\s*### END SOLUTION", cell.source, re.DOTALL)[1]
        lines = _stripped(answer).splitlines()
        for i in range(max(1, len(lines) - 1)):  # a line alone may stand in a worked cell too, two do not
            assert "\n".join(lines[i : i + 2]) not in text, cell.id
    assert "SOLUTION" not in text and "lecturer" not in text and "Common mistakes" not in text
    assert all(line in cell.source for cell in by_kind(made, build.is_solution) for line in build.STUB)
    assert all(cell.metadata.editable is False for cell in by_kind(made, build.is_check))


def _stripped(text):
    return "\n".join(line.strip() for line in text.splitlines())


def test_answers_to_questions_cannot_be_read_in_a_students_copy(lesson):
    """Options stand in a comment, all of them; none is marked, and the dictionary has None for every question."""
    for cell in by_kind(build.student(lesson), build.is_solution):
        tree = ast.parse(cell.source)
        for node in (node for node in ast.walk(tree) if isinstance(node, ast.Dict)):
            assert all(isinstance(value, ast.Constant) and value.value is None for value in node.values), cell.id


@pytest.mark.parametrize("source", ["x = 1", "### BEGIN SOLUTION\nx = 1", "x = 1\n### END SOLUTION"])
def test_marks_come_in_pairs(source):
    with pytest.raises(ValueError, match="in pairs"):
        build.without_answers(source)


def test_the_same_copies_every_time_and_sources_untouched(tmp_path):
    before = {path: path.read_bytes() for path in build.SOURCES.glob("*")}
    twice = [{path.name: path.read_bytes() for path in build.build(tmp_path / name)} for name in ("a", "b")]
    assert twice[0] == twice[1] and not list(tmp_path.rglob("*.kept-*"))
    assert before == {path: path.read_bytes() for path in before}
    folder = tmp_path / "b" / "build" / "course"
    copies = sorted(str(path.relative_to(folder)) for path in folder.rglob("*.*") if path.name != build.MADE)
    kinds = {"student": ".ipynb", "solution": ".ipynb", "slides": ".html"}
    lessons = [f"{kind}/{name.split('.')[0]}{ending}" for kind, ending in kinds.items() for name in LESSONS]
    texts = [f"{name}.md" for name in "exam exam_answers guide half_hour project project_marking".split()]
    others = ["handout.zip", "live.html", "slides/half_hour.html", "project_solution.py"]
    assert copies == sorted([*texts, *others, *lessons])
    asked, answered = ((folder / name).read_text("utf-8") for name in ("exam.md", "exam_answers.md"))
    assert asked.count(". Lesson ") == answered.count("\n") - 2 == 22 and "*Answer" not in asked + answered


def test_slides_are_in_no_copy_and_nothing_of_the_lecturers_in_the_hand_out(tmp_path):
    for lesson in LESSONS.values():
        for made in (build.student(lesson), build.solution(lesson)):
            assert not any("slide" in cell.metadata.get("tags", []) for cell in made.cells)
    handout.write_handout(tmp_path / "x.zip", {})
    with zipfile.ZipFile(tmp_path / "x.zip") as archive:
        names = {name.rpartition("/")[2] for name in archive.namelist()}
    assert "project.md" in names and not names & {"project_marking.md", "project_solution.py", "guide.md", "reveal.js"}


def test_copies_name_the_kernel_of_every_installation():
    lesson = build.solution(LESSONS["lesson_1_black_box.ipynb"])
    lesson.metadata = {"kernelspec": {"name": "mine", "display_name": "Mine", "language": "python"}}
    assert build.student(lesson).metadata.kernelspec["name"] == "python3"


def test_a_lesson_without_slides_is_refused():
    with pytest.raises(ValueError, match="no cell tagged 'slide'"):
        slides.slides(build.student(LESSONS["lesson_1_black_box.ipynb"]))


def test_the_guide_keeps_answers_apart_from_what_students_see():
    students, lecturers = build.guide(LESSONS).split("# For lecturers only")
    assert "SOLUTION" not in students and "Common mistakes" not in students and "```" not in students
    for lesson in LESSONS.values():
        assert all(cell.source in lecturers for cell in by_kind(lesson, build.is_solution))
        assert all(cell.source in lecturers for cell in by_kind(lesson, build.for_lecturer))
        assert f"| all | {sum(cell.metadata.nbgrader.points for cell in by_kind(lesson, build.is_check))} |" in students
    assert students.count("| Exercise ") == len(EXERCISES) == lecturers.count("### Exercise ")


# Running the copies, cell by cell, in one namespace each


def run(notebook, monkeypatch):
    """The names of a notebook after its last cell, and what went wrong in which cell (by id)."""
    keep_runs(monkeypatch)
    monkeypatch.setattr(vsp, "distill", once)
    monkeypatch.setattr("vsp.show.laboratory.distill", briefly)
    monkeypatch.setattr("vsp_course.picture", lambda fig, alt: drawing.plt.close(fig) or alt)
    names, failed = {}, {}
    for cell in code_cells(notebook):
        try:
            exec(compile(cell.source, cell.id, "exec"), names)
        except (feedback.NotYet, NotImplementedError) as error:
            failed[cell.id] = error
    return names, failed


def test_the_solutions_of_lesson_2_together_are_the_papers_method():
    """Cell by cell the same partition as with the passes of vsp, from the same random numbers."""
    task, teacher, *_ = examples()
    solutions = map(course_answers.changed, ("2.3", "2.4", "2.5"))
    own, ours = lesson_2.grown(*solutions, teacher, task, vsp.preset(SIMPLEGOAL).quick())
    assert np.array_equal(own.codewords, ours.codewords) and len(own) > 5
    assert np.array_equal(own.coefficients, ours.coefficients)


def test_vsps_passes_stand_in_for_stubs_and_for_nothing_else(capsys):
    def stub(*given):
        raise NotImplementedError

    def split_nothing(partition, episode, config, rng):
        return []

    task, teacher, *_ = examples()
    config = vsp.preset(SIMPLEGOAL).quick()
    stub.__name__ = "merge_regions"
    own, ours = lesson_2.grown(split_nothing, stub, lesson_2._algorithm_1, teacher, task, config)
    out = capsys.readouterr().out
    assert "Yours: split_regions, algorithm_1. Not written yet, so vsp's: merge_regions." in out
    assert len(own) == 1 < len(ours) and "not the same codewords" in out
    own, ours = lesson_2.grown(split_regions, stub, lesson_2._algorithm_1, teacher, task, config)
    assert np.array_equal(own.codewords, ours.codewords) and ": the same codewords" in capsys.readouterr().out


def test_the_sealed_answers_are_those_of_the_pictures():
    """Lesson 1: the arrows and their share at the limit. Lesson 3: what two policies' returns say."""
    _, teacher, *_ = examples()
    arrows = np.sign(teacher.predict(np.array([[0.9, 0.2], [0.7, 0.6]]))[0])
    assert arrows.tolist() == [[-1, -1], [1, -1]]  # down-left, down-right
    actions = teacher.predict(show.grid(np.zeros(2), np.ones(2), 21)[2])[0]
    assert (np.abs(actions) > 0.995).mean() > 0.75
    actors = [once(teacher, SIMPLEGOAL, seed=2)[0], once(teacher, SIMPLEGOAL, seed=3)[0], teacher]
    *played, theirs = (vsp.evaluate(p, SIMPLEGOAL, 500, seed=3)["return"].to_numpy() for p in actors)
    ours = np.concatenate(played)
    box, kept = spread(ours), spread(ours[ours >= 0])
    assert spread(theirs)["median"] > box["median"] and (ours < 0).any() and ours[ours < 0].max() < box["lower_fence"]
    assert abs(((ours >= box["q1"]) & (ours <= box["q3"])).mean() - 0.5) < 0.1
    assert max(("median", "iqr", "mean"), key=lambda name: abs(kept[name] - box[name])) == "mean"


def test_splits_and_merges_are_as_the_text_says():
    """Exact maps make about as many splits, and more merges; ten cells exist early."""
    texts = {cell.id: cell.source for cell in LESSONS["lesson_2_algorithms.ipynb"].cells}
    teacher, quick = vsp.load_teacher("SimpleGoal-v0"), vsp.preset("SimpleGoal-v0").quick()
    counts = {}
    for fit in ("closed_form", "adam"):
        config = dataclasses.replace(quick, fit=fit)
        runs = [once(teacher, "SimpleGoal-v0", config, seed=seed)[1].events for seed in range(3)]
        counts |= {
            (fit, kind): [sum(event.kind == kind for event in run) for run in runs] for kind in ("split", "merge")
        }
    said = [int(n) for n in re.findall(r"\d+", texts["predict-notes"].partition("splits (")[2].partition(")")[0])]
    assert said == counts["closed_form", "split"] + counts["adam", "split"]
    history = once(teacher, "SimpleGoal-v0", seed=0)[1]
    assert "Ten cells exist by iteration 40;" in texts["growth-see"] and history.cells[40] == 10


def test_an_untouched_copy_fails_at_the_exercises_alone(lesson, monkeypatch, capsys):
    """And needs no package that the hand-out leaves out."""
    for package in ("torch", "stable_baselines3", "papermill", "studies"):
        monkeypatch.setitem(sys.modules, package, None)  # an import fails
    made = build.student(lesson)
    _, failed = run(made, monkeypatch)
    checks = {cell.id for cell in by_kind(made, build.is_check)}
    assert checks <= set(failed) <= checks | {cell.id for cell in by_kind(made, build.is_solution)}
    for check in checks:
        assert isinstance(failed[check], feedback.NotYet), check
        assert re.search(r"is not (written|answered) yet", str(failed[check])), failed[check]
    assert "✓" not in capsys.readouterr().out


def test_pictures_are_shown_and_written_nowhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    teacher = vsp.load_teacher(SIMPLEGOAL)
    fig, _ = drawing.actions_and_error(baselines.rule_of_thumb(SIMPLEGOAL)[1], teacher)
    picture = drawing.picture(fig, "a policy")
    assert 'alt="a policy"' in picture._repr_html_() and picture.png[:4] == b"\x89PNG" and not list(tmp_path.iterdir())


# Checks


@functools.cache
def examples():
    """What the checks of some exercises need besides an answer."""
    task, teacher = vsp.get_task(SIMPLEGOAL), vsp.load_teacher(SIMPLEGOAL)
    episodes = list(teacher_episodes(teacher, task, 300, np.random.default_rng(3)))
    states, actions = (np.concatenate([getattr(e, part) for e in episodes]) for part in ("states", "actions"))
    return task, teacher, states, actions


def arguments(number):
    task, teacher, states, actions = examples()
    if number == "2.1":
        return once(teacher, SIMPLEGOAL, vsp.preset(SIMPLEGOAL), seed=0)[1], vsp.preset(SIMPLEGOAL)
    few = {"2.7": (teacher, task)}
    return few.get(number, (teacher, task, vsp.preset(SIMPLEGOAL).quick()) if number == "2.6" else ())


def check(number, answer):
    lesson, name = EXERCISES[number]
    function = {"codewords": "by_hand"}.get(name, name)
    getattr(lesson, function)(answer() if number == "3.7" else answer, *arguments(number))


def _refused(number, answer):
    with pytest.raises(feedback.NotYet) as refusal, pytest.MonkeyPatch.context() as patch:
        keep_runs(patch)
        check(number, answer)
    return str(refusal.value)


def label(entry):
    number, *words, answer = entry
    return f"{number} {words[0] if words else getattr(answer, '__name__', 'right')}"


@pytest.mark.parametrize("i", range(len(course_answers.WRONG)), ids=lambda i: label(course_answers.WRONG[i]))
def test_wrong_answers_are_told_what_is_wrong(i):
    number, words, answer = course_answers.WRONG[i]
    message = _refused(number, answer)
    assert words in message and message.startswith(f"{number} {EXERCISES[number][1]}") and "\n" not in message
    pointed = re.search(r"→ Hint (\d) of exercise (\d\.\d)$", message)
    assert pointed is None or (pointed[2] == number and int(pointed[1]) in hints(number)), message


@pytest.mark.parametrize("entry", course_answers.RIGHT, ids=label)
def test_other_right_answers_pass(entry, capsys, monkeypatch):
    keep_runs(monkeypatch)
    check(*entry)
    out = capsys.readouterr().out
    assert out.startswith(f"✓ {entry[0]} ") and out.count("✓") == 1
    assert max(map(len, out.splitlines())) <= feedback.WIDTH


@pytest.mark.parametrize("number", EXERCISES)
def test_what_is_no_answer_at_all_is_refused_in_words(number):
    for nothing in (None, 7, "text"):
        assert _refused(number, (lambda nothing=nothing: nothing) if number == "3.7" else nothing).startswith(number)


def test_a_loop_without_end_is_told_when_the_student_interrupts_it():
    def endless():
        while True:
            try:
                _thread.interrupt_main()  # as the button ■ does
            except Exception:  # catches no interrupt
                pass

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets jobs in the background ignore it
    try:
        with pytest.raises(
            feedback.NotYet, match=r"^1.2 fit: found no end in line .*, expected one: look for an endless"
        ):
            feedback.Exercise("1.2", "fit").call(endless)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_call_of_vsps_own_function_is_told_by_whatever_name_and_through_errors():
    before = sys.getprofile()
    for answer in (vsp.nearest, functools.partial(vsp.nearest, metric="manhattan"), lambda *given: vsp.nearest(*given)):
        assert "found a call of vsp's `nearest`, expected code of your own" in _refused("1.4", answer)
    assert "a call of vsp's `split`" in _refused("2.3", Readings().split)
    for error in (ValueError(), KeyboardInterrupt(), SystemExit()):
        with pytest.raises((feedback.NotYet, SystemExit)):
            lesson_1.NEAREST.call(lambda error=error: (_ for _ in ()).throw(error))
        assert sys.getprofile() is before


def test_the_first_prediction_is_kept(monkeypatch, capsys):
    keep_runs(monkeypatch)
    monkeypatch.setattr(feedback, "_FIRST", {})
    right, rest = course_answers.PREDICTION, arguments("2.6")
    assert lesson_2.predicted(right | {"exact maps": None}, *rest) is None
    assert "'exact maps' is not answered yet" in capsys.readouterr().out
    _refused("2.6", right | {"a higher loss": "fewer cells"})
    lesson_2.prediction(right, *rest)
    words = " ".join(capsys.readouterr().out.split())
    assert words.startswith("✓ 2.6") and "first prediction was wrong about ['a higher loss']" in words
    table = lesson_2.predicted(right, *rest)
    assert table.loc["a higher loss", "you said first"] == "fewer cells"


def test_who_guesses_sees_how_many_first_answers_were_right(monkeypatch, capsys):
    monkeypatch.setattr(feedback, "_FIRST", {})
    quiz = feedback.Exercise("0.1", "quiz")
    questions = {n: {"options": ["yes", "no"], "right": feedback.seal("0.1", n, "yes"), "hint": 1} for n in "abc"}
    monkeypatch.setattr(feedback, "tables", lambda name: {"0.1": questions})
    with pytest.raises(feedback.NotYet, match="question 'b': not 'no'"):
        quiz.ask({"a": "yes", "b": "no", "c": "no"}, "well read.")
    quiz.ask(dict.fromkeys("abc", "yes"), "well read.")
    assert capsys.readouterr().out == "✓ 0.1 quiz: well read. Of your first answers 1 of 3 were right.\n"


def test_jupyter_shows_the_message_alone(monkeypatch):
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)  # IPython would take its packages for this process's
    shell, shown = InteractiveShell.instance(), []
    shell._showtraceback = lambda kind, value, lines: shown.append(lines)
    shell.run_cell("from vsp_course import lesson_1\nlesson_1.fit_linear(None)")
    InteractiveShell.clear_instance()
    assert shown == [["✗ 1.2 fit_linear: found None, expected a function."]]


def test_an_error_is_told_with_the_line_where_it_arose(tmp_path):
    source = "def within(x):\n    return x[3]\n\ndef fit(x):\n    return within(x)\n"
    names, path = {}, tmp_path / "cell.py"
    path.write_text(source)
    exec(compile(source, str(path), "exec"), names)
    with pytest.raises(feedback.NotYet, match=r"found IndexError \(.*\) in line 2 of its cell, `return x\[3\]`, exp"):
        feedback.Exercise("1.2", "fit").call(names["fit"], [1])
    exec("def fit():\n    raise ValueError('first\\n   second')", names)
    with pytest.raises(feedback.NotYet, match=r"ValueError \(first second\) in line"):  # all of it in one line
        feedback.Exercise("1.2", "fit").call(names["fit"])
    with pytest.raises(feedback.NotYet, match="TypeError.* when it is called"):
        feedback.Exercise("1.2", "fit").call(len, 1)
    exec("from IPython.core.error import StdinNotImplementedError as error\ndef fit():\n    raise error", names)
    with pytest.raises(feedback.NotYet, match="found a call of `input` .*, expected a result from the arguments"):
        feedback.Exercise("1.2", "fit").call(names["fit"])


def test_a_long_message_is_shown_in_lines():
    lines = feedback.NotYet("word-with-hyphens " * 30)._render_traceback_()
    assert len(lines) > 5 and max(map(len, lines)) <= feedback.WIDTH
    assert " ".join(lines) == "✗ " + " ".join(["word-with-hyphens"] * 30)


# What is written


@pytest.fixture
def no_slides(monkeypatch):
    monkeypatch.setattr(build, "slides", lambda *_: "their pictures take long")


def test_what_somebody_wrote_into_a_copy_is_kept(no_slides, tmp_path, capsys):
    copy = tmp_path / "build/course/student" / list(LESSONS)[0]
    for n in (1, 2):
        build.build(tmp_path)
        capsys.readouterr()
        copy.write_text(f"mine {n}")
    build.build(tmp_path)
    assert [path.read_text() for path in sorted(copy.parent.glob("*kept*"))] == ["mine 1", "mine 2"]
    assert "was edited: kept as lesson_1_black_box.kept-2.ipynb" in capsys.readouterr().out
    assert nbformat.read(copy, as_version=4).cells


def test_what_was_written_before_a_kill_is_nobodys_work(no_slides, tmp_path):
    """The checksums of what was written come last: without them, a file as it is to be is not taken for edited."""
    copies = [*build.build(tmp_path)]
    before = {path: path.read_bytes() for path in copies}
    (tmp_path / "build/course" / build.MADE).unlink()
    copies[1].unlink()
    build.build(tmp_path)
    assert {path: path.read_bytes() for path in copies} == before and not list(tmp_path.rglob("*.kept-*"))


def test_a_hand_out_installs_itself_where_somebody_else_runs_jupyter(tmp_path):
    """From its wheel, beside the lessons, without the answers; and it says what the kernel had loaded before."""
    handout.write_handout(tmp_path / "handout.zip", {"lesson.ipynb": "{}"})
    with zipfile.ZipFile(tmp_path / "handout.zip") as archive:
        assert not [name for name in archive.namelist() if b"BEGIN SOL" in archive.read(name)]
    (cell,) = {c.source for lesson in LESSONS.values() for c in lesson.cells if c.id == "hosted"}
    cell = cell.replace('importlib.util.find_spec("vsp")', "None")  # as where it is not installed
    folder = tmp_path / handout.PARTS["folder"]
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {"PIP_NO_INDEX": "1"}
    told = python(f"try:\n    exec({cell!r})\nexcept SystemExit as error:\n    print(error)", cwd=tmp_path, env=env)
    assert "Nothing is installed: what pip says above is why" in told
    (folder / "hosted.txt").write_text("")  # the others would come from the network
    used = "\nfrom vsp_course import lesson_1, lesson_2, lesson_3; vsp.load_teacher('{0}'); printed_spread('{0}')"
    used = f"\nimport vsp, vsp_beyond; from vsp.paper.printed import printed_spread{used.format(SIMPLEGOAL)}"
    for words in ("RESTART", "the host loads its own numpy", "Ready. "):
        before = "" if words == "Ready. " else "import numpy\n"
        *_, said, place = python(f"{before}{cell}{used}; print(vsp.__file__)", cwd=tmp_path, env=env).splitlines()
        assert words in said and place.startswith(str(folder / "packages-"))


def test_a_hand_out_asks_for_locked_versions_without_torch():
    lines = handout.pinned(handout.PARTS["hosted"] + handout.PARTS["own"]).splitlines()
    locked = (atomic.ROOT / "environment.lock").read_text(encoding="utf-8")
    assert len(lines) > 12 and all(f"\n{line} " in locked for line in lines) and "torch" not in handout.PARTS["hosted"]


# Pages


def small_lesson(worked):
    new = nbformat.v4
    answer = new.new_code_cell(f"{build.BEGIN}\nx = 1\n{build.END}", metadata={"nbgrader": {"solution": True}})
    check = new.new_code_cell("assert x == 1", metadata={"nbgrader": {"grade": True, "points": 1}})
    return build.student(new.new_notebook(cells=[new.new_code_cell("print(6 * 7)"), answer, check, worked]))


def test_a_page_shows_what_is_worked_out_and_nothing_of_the_exercises():
    made = build.page(small_lesson(nbformat.v4.new_code_cell("2 + 3")))
    assert [len(cell.outputs) for cell in made.cells] == [1, 0, 0, 1]
    assert made.cells[0].outputs[0].text == "42\n" and made.cells[3].outputs[0].data["text/plain"] == "5"
    assert [cell.execution_count for cell in made.cells] == [1, 2, 3, 4]
    assert not any("execution" in cell.metadata for cell in made.cells)


def test_a_page_must_not_need_an_answer():
    with pytest.raises(RuntimeError, match="needs-x.*name 'x'"):
        build.page(small_lesson(nbformat.v4.new_code_cell("print(x)", id="needs-x")))
