"""What notebooks 01 to 05 suggest to try, and other edits of their parameters; quick, but with `make test-tries`."""

import re
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, QUICK, SIMPLEGOAL

import vsp
from vsp.run.atomic import ROOT
from vsp.run.notebook import nbformat
from vsp.tasks import simplegoal


def cells_of(number):
    (path,) = (ROOT / "notebooks").glob(f"{number}_*.ipynb")
    return nbformat.read(path, as_version=4).cells


def run(number, folder, *, last=None, **values):
    """The names of a notebook after its cell `last`, None: all, with these parameters."""
    names = {}
    for cell in cells_of(number):
        exec(compile(cell.source, f"{number}, {cell.id}", "exec") if cell.cell_type == "code" else "", names)
        plt.close("all")
        if cell.id == "parameters":
            assert values.keys() <= names.keys()
            names |= {"out": str(folder), "runs": str(folder), "quick": QUICK, **values}
        if cell.id == last:
            break
    return names


def to_try(number):
    """The code that the last cell of a notebook suggests."""
    text = cells_of(number)[-1].source.rpartition("*Try:*")[2]
    return "\n".join(re.findall("^    (.*)", text, flags=re.M))


RUNS_THROUGH = [
    ("02", {"n_minibatches": 10}), ("02", {"task": MOUNTAINCAR, "n_minibatches": 3, "seed": 2}),
    ("03", {"n_runs": 1}), ("03", {"n_runs": 3}),
]  # fmt: skip


@pytest.mark.parametrize(("number", "values"), RUNS_THROUGH, ids=str)
def test_an_edited_notebook_runs_through(number, values, tmp_path, capsys):
    names = run(number, tmp_path, **values)
    assert all(len(results.runs) == values["n_runs"] for results in names.get("both", {}).values())
    assert ("no episode fails" in capsys.readouterr().out) == ("task" in values)


STOPS = [
    ("01", {"another_task": "Acrobot-v1"}, "expected a Box"), ("01", {"seed": "a"}, "seed is 'a', expected an integer"),
    ("02", {"task": PENDULUM}, "no settings for task 'Pendulum-v1', expected"), ("02", {"seed": -1}, "seed is -1"),
    ("02", {"n_minibatches": 0}, "expected a positive integer"), ("03", {"n_runs": "ten"}, "n is 'ten', expected"),
]  # fmt: skip


@pytest.mark.parametrize(("number", "values", "said"), STOPS, ids=str)
def test_or_stops_with_one_line(number, values, said, tmp_path):
    with pytest.raises(ValueError, match=f"^.*{said}.*$"):
        run(number, tmp_path, **values)


@pytest.mark.parametrize(("edge", "task", "gain"), [(0.7, None, 12), (0.75, PENDULUM, 20)])
def test_a_wider_pit_catches_the_teacher_and_pushing_along_beats_the_other(edge, task, gain, tmp_path, monkeypatch):
    push = vsp.agent(lambda obs: np.clip(gain * obs[:, 1:], -1, 1))
    monkeypatch.setattr(simplegoal, "PIT_HIGH", edge)
    scores = run("01", tmp_path, another_task=task, seed=2)["scores"]
    assert scores.loc["ends: pit", SIMPLEGOAL] > 0 and len(scores.columns) == 2 + bool(task)
    assert vsp.evaluate(push, MOUNTAINCAR, 100, seed=2)["return"].mean() > scores[MOUNTAINCAR]["mean return"] + 1


def test_what_02_says_of_seed_1_holds(tmp_path):
    rows = [*run("02", tmp_path, quick=False, seed=1)["rows"].values()]
    assert [(row["failed, of 1000"], row["in the pit"]) for row in rows[1::2]] == [(72, 72), (79, 8)]


@pytest.mark.parametrize("row", [0, 1])
def test_what_03_and_04_let_try_changes_the_policy(row, tmp_path):
    first, second = (vsp.paper.paper_results(task, n=2, runs=tmp_path, quick=QUICK) for task in vsp.paper.TASKS)
    of, start, maps = second.experiment, vsp.start_states(MOUNTAINCAR, 1, row), first.best.policy.coefficients.copy()
    boxed, _ = vsp.distill(of.teacher, of.task, replace(of.config, scale="box"), seed=row)
    assert not np.array_equal(boxed.codewords, second.runs[row].policy.codewords)
    for actor in (of.teacher, second.best.policy):
        assert np.abs(vsp.collect_episodes(actor, of.task, start)[0].actions).max() <= 1
    maps[row, -1] += 2
    changed = vsp.VoronoiPolicy(first.best.policy.codewords, maps, task=SIMPLEGOAL)
    returns = vsp.rollout_from_seed(changed, SIMPLEGOAL, 100, seed=1).returns
    assert not np.array_equal(returns, first.best.outcomes.returns)


@pytest.mark.parametrize("n_minibatches", [3, 5])
def test_05_judges_runs_of_ones_own(n_minibatches, tmp_path):
    results = {task: vsp.paper.paper_results(task, n=2, runs=tmp_path, quick=QUICK) for task in vsp.paper.TASKS}
    names = {"results": results, "runs": tmp_path, "paper": vsp.paper}
    code = to_try("05").replace("=5", f"={n_minibatches}")
    exec(code.replace("range(10)", "range(2)" if QUICK else "range(10)"), names)
    assert names["new"].experiment.config.n_minibatches == n_minibatches
    assert not np.array_equal(names["new"].returns[:2], results[SIMPLEGOAL].returns)
