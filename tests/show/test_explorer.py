import html
import json
import re

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

import vsp
from vsp.rollouts import rollout
from vsp.show.explorer import SCRIPT, STYLE, scene_of
from vsp.show.explorer.scene import starts_of

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


def test_a_replay_has_every_change_with_its_cause_and_ends_with_the_policy(run):
    _, policy, history = run
    moments = scene_of({"run": policy}, policy.task, history=history)["policies"][0]["replay"]
    assert moments[0]["n"] == 0 and moments[-1]["n"] == len(history.cells) - 1
    assert all(set(moment) == {"n", "codewords", "coefficients", "events", "failures"} for moment in moments)
    assert moments[-1]["failures"] == sum(rollout(policy, policy.task, starts_of(policy.task)).outcomes != 1)
    told = [(moment["n"], *event.values()) for moment in moments for event in moment["events"]]
    for (n, kind, codeword, cause), event in zip(told, history.events, strict=True):
        assert (n, kind, cause) == (event.iteration, event.kind, event.cause)
        assert np.allclose(codeword, event.codeword, atol=1e-4)
    for name in ("codewords", "coefficients"):
        assert np.array_equal(moments[-1][name], getattr(policy, name))


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR, PENDULUM])
def test_starts_cover_those_of_the_task(task):
    task = vsp.get_task(task)
    starts, drawn = np.array(scene_of({}, task)["starts"]), task.start(np.random.default_rng(1), 5000)
    assert starts.shape == (400, drawn.shape[1])
    assert (np.abs(starts.min(axis=0) - drawn.min(axis=0)) <= 0.06 * np.ptp(drawn, axis=0) + 1e-9).all()
    assert (np.abs(starts.mean(axis=0) - drawn.mean(axis=0)) <= 0.02 * np.ptp(drawn, axis=0) + 1e-9).all()


def test_the_file_is_whole_by_itself(tmp_path):
    vsp.explore(TWO).save(tmp_path / "two.html")
    page = (tmp_path / "two.html").read_text("utf-8")
    assert SCRIPT in page and STYLE in page and "<img alt=" in page
    assert not re.findall(r"(?:src|href)=[\"'](?!data:)", page) and "http" not in page.replace("http-equiv", "")
    scene = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)[1])
    assert scene == json.loads(json.dumps(vsp.explore(TWO).scene))


LANDER = vsp.VoronoiPolicy(np.zeros((1, 8)), np.zeros((1, 9, 2)), task="LunarLanderContinuous-v3")


@pytest.mark.parametrize(
    ("policies", "message"),
    [
        ("a name", "expected a VoronoiPolicy"),
        (vsp.VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 6, 2)), task=SIMPLEGOAL, sub_policy="quadratic"), "'linear'"),
        ({"one": TWO, "other": LANDER}, "expected one task"),
        ({}, "expected one task"),
        (LANDER, f"the browser plays {SIMPLEGOAL}, {MOUNTAINCAR}, {PENDULUM}, so LunarLanderContinuous-v3 cannot"),
    ],
)
def test_what_cannot_be_explored_gets_one_clear_error(policies, message):
    with pytest.raises(ValueError, match=message):
        vsp.explore(policies)


def test_an_element_may_name_files_to_choose_from(tmp_path):
    element = vsp.explore(TWO).element(sources={"one": "a.json", 'an"other': "b.json"})
    (files,) = re.findall(r'data-scenes="([^"]*)"', element)
    assert json.loads(html.unescape(files)) == {"one": "a.json", 'an"other': "b.json"} and "<script" not in element


def test_a_history_is_that_of_the_first_policy(run):
    with pytest.raises(ValueError, match="history is of another run than the first policy"):
        vsp.explore({"two": TWO, "run": run[1]}, history=run[2])
