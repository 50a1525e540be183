import json
import re

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

import vsp
from vsp.show.explorer import SCRIPT
from vsp.show.explorer.scene import scene_of

TWO = vsp.VoronoiPolicy([[0.25, 0.25], [0.75, 0.75]], -np.ones((2, 3, 2)), task=SIMPLEGOAL)


@pytest.fixture(scope="module")
def run():
    teacher = vsp.load_teacher(SIMPLEGOAL)
    return teacher, *vsp.distill(teacher, SIMPLEGOAL, vsp.preset(SIMPLEGOAL).quick(), seed=0)


def test_a_scene_has_the_numbers_of_its_policies(run):
    teacher, policy, _ = run
    scene = scene_of({"a": policy, "b": TWO}, policy.task, teacher)
    assert [one["name"] for one in scene["policies"]] == ["a", "b"] and "replay" not in scene["policies"][0]
    for one, found in zip((policy, TWO), scene["policies"]):
        assert np.array_equal(found["codewords"], one.codewords)
        assert np.array_equal(found["coefficients"], one.coefficients)
        assert found["metric"] == one.metric and found["scale"] == one.scale.tolist()


def test_a_replay_has_every_change_and_ends_with_the_policy(run):
    _, policy, history = run
    moments = scene_of({"run": policy}, policy.task, history=history)["policies"][0]["replay"]
    changed = [one["n"] for one in moments if one["change"]]
    assert changed == sorted({event.iteration for event in history.events})
    assert moments[0]["n"] == 0 and moments[-1]["n"] == len(history.cells) - 1
    assert np.allclose(moments[-1]["codewords"], policy.codewords, atol=1e-4)
    split = sum(int(n) for one in moments for n in re.findall(r"(\d+) split", one["change"]))
    assert split == sum(event.kind == "split" for event in history.events)


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR, PENDULUM])
def test_starts_cover_those_of_the_task(task):
    task = vsp.get_task(task)
    policy = vsp.VoronoiPolicy([[0.0] * len(task.low)], np.zeros((1, len(task.low) + 1, len(task.outputs))), task=task)
    scene = scene_of({"still": policy}, task)
    starts, drawn = np.array(scene["starts"]), task.start(np.random.default_rng(1), 5000)
    assert starts.shape == (400, drawn.shape[1])
    assert (np.abs(starts.min(axis=0) - drawn.min(axis=0)) <= 0.06 * np.ptp(drawn, axis=0) + 1e-9).all()
    assert (np.abs(starts.mean(axis=0) - drawn.mean(axis=0)) <= 0.02 * np.ptp(drawn, axis=0) + 1e-9).all()


def test_the_stated_error_of_the_teachers_grid_bounds_it(run):
    teacher = run[0]
    found = scene_of({"two": TWO}, TWO.task, teacher)["teacher"]
    states = np.random.default_rng(5).uniform(size=(5000, 2))
    n = found["n"]
    nearest = np.round(states * (n - 1)).astype(int)
    on_the_grid = np.array(found["actions"])[nearest[:, 0] * n + nearest[:, 1]]
    assert np.allclose(on_the_grid, teacher.predict(nearest / (n - 1))[0], atol=1e-3)
    assert 0 < found["usual"] < found["error"] < 2.0


def test_the_file_is_whole_by_itself(tmp_path):
    vsp.explore(TWO).save(tmp_path / "two.html")
    page = (tmp_path / "two.html").read_text("utf-8")
    assert SCRIPT.read_text("utf-8") in page and "<img alt=" in page
    assert not re.findall(r"(?:src|href)=[\"'](?!data:)", page) and "http" not in page.replace("http-equiv", "")
    scene = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)[1])
    assert scene == json.loads(json.dumps(vsp.explore(TWO).scene))


def test_the_script_is_small():
    assert SCRIPT.stat().st_size < 60_000


LANDER = vsp.VoronoiPolicy(
    np.random.default_rng(0).normal(size=(3, 8)), np.random.default_rng(1).normal(size=(3, 9, 2)),
    task="LunarLanderContinuous-v3",
)  # fmt: skip


def test_of_a_task_that_the_script_cannot_play_episodes_are_stored():
    teacher = vsp.load_teacher(LANDER.task.name)
    scene = scene_of({"a": LANDER, "b": LANDER}, LANDER.task, teacher)
    assert "starts" not in scene and len(json.dumps(scene)) < 500_000
    for about in scene["policies"]:
        assert len(about["episodes"]) == 8
        for episode in about["episodes"]:
            states = np.array(episode["states"])
            assert states.shape[1] == 8 and 1 <= len(states) <= 251
            assert np.allclose(episode["teacher"], teacher.predict(states)[0], atol=1e-3)
    i, j = scene["stored"]["axes"]
    assert scene["plane"]["labels"] == [LANDER.task.input_labels[i], LANDER.task.input_labels[j]]
    low, high = np.array(scene["stored"]["low"]), np.array(scene["stored"]["high"])
    assert all(((states := np.array(e["states"])) >= low).all() and (states <= high).all() for e in about["episodes"])


def test_the_drawn_inputs_can_be_named():
    assert scene_of({"a": LANDER}, LANDER.task, axes=("y", "x"))["stored"]["axes"] == [1, 0]
    with pytest.raises(ValueError, match="axes are .'x', 'z'., expected two of the inputs x, y, vx"):
        vsp.explore(LANDER, axes=("x", "z"))


def test_a_question_comes_along():
    assert vsp.explore(TWO, guess="How many?").scene["guess"] == "How many?" and "guess" not in vsp.explore(TWO).scene


def test_other_policies_get_one_clear_error():
    quadratic = vsp.VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 6, 2)), task=SIMPLEGOAL, sub_policy="quadratic")
    car = vsp.VoronoiPolicy([[0.0, 0.0]], np.zeros((1, 3, 1)), task=MOUNTAINCAR)
    for wrong, match in (
        ("a name", "expected a VoronoiPolicy"), (quadratic, "'linear'"),
        ({"one": TWO, "other": car}, "expected one task"), ({}, "expected one task"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=match):
            vsp.explore(wrong)
