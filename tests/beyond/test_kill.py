import base64
import copy
import dataclasses
import json
import re
import signal
import types

import gymnasium
import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, Constant, CurvedTeacher, PumpingTeacher
from test_fewest import QUICK, judged

import vsp
import vsp_beyond
from vsp.evaluation import Likeness, likeness
from vsp.tasks import get_task
from vsp_beyond import device, names, page
from vsp_beyond.few_cells import fewest as module


# ---- fewest
@pytest.mark.parametrize(("ours", "level"), [(99.3, True), (99.1, False)])
def test_A01_A02(ours, level, monkeypatch, tmp_path):
    seen = types.SimpleNamespace(agent=None, task=get_task(MOUNTAINCAR), best_constant=60.0)
    arrays = {"codewords": [[0, 0]], "coefficients": np.zeros((1, 3, 1)), "scale": np.ones(2)}
    monkeypatch.setattr(module, "make_all", lambda *_: None)
    monkeypatch.setattr(module.Stage, "load", lambda *_: (dict(arrays), {}))
    monkeypatch.setattr(module, "likeness", lambda *_: judged(1.0, [ours] * 4, [100.0] * 4, 1, None).alike)
    assert module.Tried.of(module.Stage(seen, 1, 0), tmp_path).level == level


def test_A04():
    assert module.Seen(None, get_task(MOUNTAINCAR), QUICK, 0).best_constant == 0.0


def test_A05_A09(tmp_path):
    of = lambda agent: module.Stage(module.Seen(agent, get_task(SIMPLEGOAL), QUICK, 0), 2, 0)  # noqa: E731
    stage = of(CurvedTeacher())
    others = dataclasses.replace(stage, tuned=True), of(vsp.agent(lambda obs: 0 * obs, name="still")), dataclasses.replace(stage, n_cells=4)
    assert len({one.path(tmp_path) for one in (stage, *others)}) == 4


def test_A06_A07(monkeypatch):
    monkeypatch.setattr(module, "faithful_preset", lambda task: dataclasses.replace(QUICK, margin=3.0))
    asked = []
    monkeypatch.setattr(module, "distill_faithfully", lambda a, t, config, seed: asked.append(config) or 1 / 0)
    monkeypatch.setattr(module.Tried, "of", lambda stage, folder: dataclasses.replace(stage, tuned=True).make())
    with pytest.raises(ZeroDivisionError):
        module.fewest(PumpingTeacher(), get_task(MOUNTAINCAR), seed=0, folder="", sizes=(2,))
    assert (asked[0].n_cells, asked[0].margin) == (2, 0.0)


def test_A08():
    with module.limited(60.0):
        pass
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_A10(monkeypatch):
    points = []
    monkeypatch.setattr(module, "spread", lambda p, n, rng: points.append(p) or np.arange(5))
    module.Seen(PumpingTeacher(), get_task(MOUNTAINCAR), QUICK, 0).labelled
    assert points[0].std(axis=0) == pytest.approx(1.0)


# ---- device
def test_A11():
    with pytest.raises(ValueError, match="within the limits"):
        device.to_c(device_policy(), safe=[-2, 0])


def device_policy():
    from vsp.paper import published_policy

    return published_policy(SIMPLEGOAL)


def test_A12():
    small = vsp.VoronoiPolicy([[0.5, 0.5]], np.full((1, 3, 2), 2.5e-7), task=SIMPLEGOAL)
    code = device.to_c(small, real="float")
    assert "2.5e-07f" in code and not re.search(r"e-\d+\b(?!f)", code)


def test_A13():
    maps = [[1, 0], [1, 0], [0, 0]], [[0, 0], [0, 0], [0.1, 1]]
    two = vsp.VoronoiPolicy([[0.25, 0], [0.75, 0]], maps, task=SIMPLEGOAL)
    assert device.largest_jump(two, np.array([[0.3, 0.2], [0.9, 0.2]])) == pytest.approx([0.6, 1.0])


def test_A14():
    task = dataclasses.replace(get_task(SIMPLEGOAL), outputs=("*/ int x;", "b"))
    policy = vsp.VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task=task)
    assert "*/ int x" not in device.to_header(policy)


# ---- names
def test_A15():
    assert names.BIPEDAL[1] == ["hip 1 torque", "knee 1 torque", "hip 2 torque", "knee 2 torque"]


def test_A16():
    joints = [types.SimpleNamespace(name="b", type=[1])]
    assert [list(names._numbers(joints, k)) for k in (names.PLACES, names.SPEEDS)] == [
        ["b.w", "b.x", "b.y", "b.z"], ["b turn x", "b turn y", "b turn z"]]


# ---- episodes
def scene_of(made):
    return json.loads(re.findall(r'application/json">(.*?)</script>', made)[0])


@pytest.fixture(scope="module")
def shown():
    from vsp_beyond.episodes import episodes

    task = get_task(SIMPLEGOAL)
    task = dataclasses.replace(task, input_labels=("</script>", "y"))
    policy = vsp.VoronoiPolicy([[0.5, 0.5]], [[[-1, 0.2], [0, -1], [0, -0.1]]], task=task)
    agent = CurvedTeacher()
    alike = likeness(policy, agent, task, 50)
    return agent, alike, episodes(policy, agent, alike)


def test_A17(shown):
    returned = [float(re.search(r"return (\S+),", one["name"])[1]) for one in scene_of(shown[2])["episodes"]]
    assert returned[1:] == pytest.approx(np.sort(shown[1].returns["policy"])[:3], rel=1e-4)


def test_A18(shown):
    one = scene_of(shown[2])["episodes"][0]
    assert one["agent"] == pytest.approx(shown[0].predict(one["states"])[0], abs=1e-3)


def test_A19():
    from vsp_beyond.episodes import episodes

    weights = np.zeros((1, 9, 2))
    weights[0, :, 0] = [0, 3, 0, 4, 5, 0, 0, 6, 0]
    policy = vsp.VoronoiPolicy([np.zeros(8)], weights, task=LUNARLANDER)
    alike = likeness(policy, Constant(0.0, 0.0), LUNARLANDER)
    alike = dataclasses.replace(alike, states=np.random.default_rng(0).normal(size=(100, 8)))
    assert scene_of(episodes(policy, Constant(0.0, 0.0), alike))["curves"] == [1, 3, 4, 7]


def test_A20(shown):
    assert shown[2].count("</script>") == 1


# ---- page
def of_two(errors, states=((-0.5, 0.01), (-0.5, 0.02))):
    returns = {"policy": np.ones(4), "agent": np.ones(4)}
    return Likeness(0.99, np.array(states), np.array(errors), returns, dict.fromkeys(returns, 0))


TWO = vsp.VoronoiPolicy([[-0.5, 0.01], [-0.5, -0.01]], [[[0], [0], [1]], [[0], [0], [-1]]], task=MOUNTAINCAR)


def test_A21():
    two = vsp.VoronoiPolicy([[0.2, 0.2], [0.8, 0.8]], np.zeros((2, 3, 2)), task=SIMPLEGOAL)
    alike = of_two([[0.0, 0.9], [0.0, 0.0]], [[0.2, 0.2], [0.2, 0.3]])
    assert "all actions within 5% in 50% of these" in page._cards(two, alike)


def test_A22():
    made = page._worst(TWO, PumpingTeacher(), of_two([[0.1], [0.9]]))
    assert "v 0.02" in made and "v 0.01" not in made


def test_A23(monkeypatch):
    asked = []
    monkeypatch.setattr(page, "_proof", lambda path, seconds: asked.append(seconds) or "")
    for until in (0.0, page.time.monotonic() + 10, float("inf")):
        page._kept(TWO, np.zeros((2, 2)), until)
    assert asked == pytest.approx([1.0, 10.0, 60.0], abs=0.5)


def test_A24():
    made = page._kept(TWO, np.array([[-0.5, 0.01], [-0.5, -0.01]]), 0.0)
    (code,) = re.findall(r'download="policy.c" href="data:[^,]*,([^"]*)"', made)
    assert "jumps by at most 2, as found around 2 states" in base64.b64decode(code).decode()


def test_A25():
    one = judged(0.9, [1], [1], 1, True), judged(0.8, [1], [1], 2, True)
    made = page._sizes([dataclasses.replace(one[0], policy=TWO), one[1]], TWO)
    assert "1 cell (chosen)" in made and "2 cells (chosen)" not in made
