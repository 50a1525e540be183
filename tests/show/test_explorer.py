import json
import re

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, Constant

import vsp
from vsp.paper.printed import published_policy
from vsp.show.explorer import SCRIPT
from vsp.show.explorer.scene import scene_of, starts_of, to_json
from vsp.tasks.base import Task

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
    for name in ("codewords", "coefficients"):
        assert np.array_equal(moments[-1][name], getattr(policy, name))
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


def test_the_teachers_grid_holds_its_actions(run):
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


LANDER = vsp.VoronoiPolicy(
    np.random.default_rng(0).normal(size=(3, 8)), np.random.default_rng(1).normal(size=(3, 9, 2)),
    task="LunarLanderContinuous-v3",
)  # fmt: skip


def test_of_a_task_that_the_script_cannot_play_episodes_are_stored():
    teacher = vsp.load_teacher(LANDER.task.name)
    found = scene_of({"a": LANDER, "b": LANDER}, LANDER.task, teacher)
    played = vsp.collect_episodes(LANDER, LANDER.task, vsp.start_states(LANDER.task, 8, 0))
    assert "starts" not in found and len(to_json(found)) < 500_000
    for about in found["policies"]:
        for episode, whole in zip(about["episodes"], played, strict=True):
            states = np.array(episode["states"])
            assert 1 <= len(states) <= 251 and episode["steps"] == len(whole.states)
            assert np.allclose(states, whole.states[:: episode["every"]], atol=1e-4 * np.ptp(whole.states))
            assert np.allclose(episode["teacher"], teacher.predict(states)[0], atol=1e-4)
    i, j = found["stored"]["axes"]
    assert found["plane"]["labels"] == [LANDER.task.input_labels[i], LANDER.task.input_labels[j]]
    low, high = np.array(found["stored"]["low"]), np.array(found["stored"]["high"])
    for episode in about["episodes"]:
        assert (np.array(episode["states"]) >= low - 1e-3).all() and (np.array(episode["states"]) <= high + 1e-3).all()


def falling(d, size=1.0):
    """A task of d inputs that shrink, each of another size, down from `size`."""
    box = np.full(d, 10.0 * size)
    return Task(
        "Falling", tuple(f"s{i}" for i in range(d)), ("a",), tuple(f"s{i}" for i in range(d)), -box, box,
        -np.ones(1), np.ones(1), 60,
        start=lambda rng, n: size * rng.uniform(1, 2, size=(n, d)) / np.arange(1, d + 1),
        step=lambda states, actions: (0.95 * states, np.zeros(len(states)), np.zeros(len(states), int)),
    )  # fmt: skip


@pytest.mark.parametrize(("d", "size"), [(1, 1.0), (3, 1e-7), (70, 1e5)])
def test_every_number_of_inputs_and_every_size_is_drawn(d, size):
    """Rounding leaves each state in its cell, or nearly."""
    task = falling(d, size)
    policy = vsp.VoronoiPolicy(
        size * np.linspace(0, 1, 3)[:, None] * np.ones(d), np.zeros((3, d + 1, 1)), task=task, scale=size * np.ones(d)
    )
    found = vsp.explore(policy).scene
    states = np.concatenate([one["states"] for one in found["policies"][0]["episodes"]])
    whole = vsp.visited_states(policy, task, vsp.start_states(task, 8, 0))
    assert np.allclose(states, whole, rtol=0, atol=1e-4 * np.ptp(whole, axis=0))
    assert (policy.cells(states) == policy.cells(whole)).mean() > 0.99
    assert all(low < high for low, high in zip(found["plane"]["low"], found["plane"]["high"]))


def test_where_many_policies_are_stored_steps_are_left_out():
    """Five agents of a task of 70 inputs share what one has alone."""
    task = falling(70)
    still = vsp.VoronoiPolicy(np.zeros((1, 70)), np.zeros((1, 71, 1)), task=task)
    for n in (1, 5):
        whole = scene_of({str(i): still for i in range(n)}, task)
        for about in whole["policies"]:
            for episode in about["episodes"]:
                assert episode["steps"] == 60 and len(episode["states"]) == 60 // episode["every"]
        assert episode["every"] == (1 if n == 1 else 4) and len(to_json(whole)) < 600_000


def test_the_drawn_inputs_can_be_named():
    assert scene_of({"a": LANDER}, LANDER.task, axes=("y", "x"))["stored"]["axes"] == [1, 0]
    for wrong in (("x", "z"), ("x", "x"), ("x",), "xy", (["x"], "y")):
        with pytest.raises(ValueError, match=f"axes are {re.escape(repr(wrong))}, expected two of the inputs x, y, vx"):
            vsp.explore(LANDER, axes=wrong)


def test_a_question_comes_along():
    assert vsp.explore(TWO, guess="How many?").scene["guess"] == "How many?" and "guess" not in vsp.explore(TWO).scene
    for policy, wrong in ((TWO, 5), (LANDER, "How many?")):
        with pytest.raises(ValueError, match=re.escape(f"guess is {wrong!r}, expected a question about one of Simple")):
            vsp.explore(policy, guess=wrong)


def test_three_cells_can_lose_fewer_starts_than_the_papers_thirteen():
    """docs/explore.md says so."""
    maps = np.zeros((3, 3, 2))
    maps[:, 2] = [[-0.2, -0.2], [-0.2, -0.5], [-1, -0.2]]
    three = vsp.VoronoiPolicy([[0.3, 0.6], [0.8, 0.4], [0.5, 0.7]], maps, task=SIMPLEGOAL)
    starts = starts_of(three.task)
    lost = [(vsp.rollout(one, SIMPLEGOAL, starts).outcomes != 1).sum() for one in (three, published_policy(SIMPLEGOAL))]
    assert lost == [16, 44]


@pytest.mark.parametrize(
    ("policies", "options", "message"),
    [
        ("a name", {}, "expected a VoronoiPolicy"),
        (vsp.VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 6, 2)), task=SIMPLEGOAL, sub_policy="quadratic"), {}, "'linear'"),
        ({"one": TWO, "other": LANDER}, {}, "expected one task"),
        ({}, {}, "expected one task"),
        (LANDER, {"teacher": Constant(0.0)}, "the teacher's actions have shape"),
        (TWO, {"axes": ("x", "y")}, "axes are .'x', 'y'., expected None: the states of SimpleGoal-v0 are drawn"),
    ],
)
def test_what_cannot_be_explored_gets_one_clear_error(policies, options, message):
    with pytest.raises(ValueError, match=message):
        vsp.explore(policies, **options)


def test_a_history_is_that_of_the_first_policy(run):
    with pytest.raises(ValueError, match="history is of another run than the first policy"):
        vsp.explore({"two": TWO, "run": run[1]}, history=run[2])
