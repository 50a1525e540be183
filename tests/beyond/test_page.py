import base64
import dataclasses
import html
import json
import os
import re

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, Constant, CurvedTeacher, PumpingTeacher, called
from test_fewest import judged

import vsp
import vsp_beyond
from vsp.evaluation import Likeness, likeness
from vsp.tasks import get_task
from vsp_beyond import __main__ as command
from vsp_beyond import page
from vsp_beyond.few_cells.fewest import Tried

TWO = vsp.VoronoiPolicy([[-0.5, 0.01], [-0.5, -0.01]], [[[0], [0], [1]], [[0], [0], [-1]]], task=MOUNTAINCAR)


def test_a_page_has_all_it_needs_and_names_are_text(monkeypatch, tmp_path):
    monkeypatch.setattr(page, "_PROVE", "print('a theorem <b>')")
    made = vsp_beyond.report(TWO, PumpingTeacher(), MOUNTAINCAR, name="<script>alert(1)</script>", remarks="few <i>")
    assert "F = 0.000 x + 0.000 v + 1.000" in made and "a theorem &lt;b&gt;" in made and "few &lt;i&gt;" in made
    assert "<script>alert" not in made and "by its unit: x 1, v 1.</p>" in made
    assert not re.search(r"(src|href)=\"(?!data:)", made) and len(made) < 2_000_000
    files = dict(re.findall(r'download="policy.(\w+)" href="data:[^,]*,([^"]*)"', made))
    assert "jumps by at most 2, as found around" in base64.b64decode(files["c"]).decode()
    (tmp_path / "x.vsp").write_bytes(base64.b64decode(files["vsp"]))
    assert vsp.VoronoiPolicy.load(tmp_path / "x.vsp").to_json() == TWO.to_json()


def scene_of(made):
    return json.loads(re.findall(r'application/json">(.*?)</script>', made)[0])


def test_of_a_task_that_a_browser_cannot_play_it_shows_episodes():
    policy = vsp.VoronoiPolicy([np.zeros(8), np.ones(8)], np.zeros((2, 9, 2)), task=LUNARLANDER)
    made = vsp_beyond.report(policy, Constant(0.0, 0.0), LUNARLANDER)
    assert "<h2>Explore" not in made and made.count("application/json") == 1
    assert all(part in made for part in ("<h2>How alike", "<h2>The policy", "Cell 0<"))
    assert "of the worst: return" in made and "seed " in made and "the median episode:" in made
    scene = scene_of(made)
    assert [len(scene["episodes"]), len(scene["curves"])] == [4, 4] and len(scene["episodes"][0]["states"]) <= 400


def test_the_worst_episodes_are_shown_with_the_agents_actions_and_no_name_ends_the_script():
    task, agent = dataclasses.replace(get_task(SIMPLEGOAL), inputs=("</script>", "y")), CurvedTeacher()
    policy = vsp.VoronoiPolicy([[0.5, 0.5]], [[[-1, 0.2], [0, -1], [0, -0.1]]], task=task)
    alike = likeness(policy, agent, task, 50)
    made = page.episodes(policy, agent, alike)
    first, *worst = scene_of(made)["episodes"]
    returned = [float(re.search(r"return (\S+) ", one["name"])[1]) for one in worst]
    assert returned == pytest.approx(np.sort(alike.returns["policy"])[:3], rel=1e-4) and made.count("</script>") == 1
    assert first["agent"] == pytest.approx(agent.predict(first["states"])[0], abs=1e-3)


def test_curves_are_of_the_inputs_that_move_the_action_most():
    weights = np.zeros((1, 9, 2))
    weights[0, :, 0] = [0, 3, 0, 4, 5, 0, 0, 6, 0]
    policy, agent = vsp.VoronoiPolicy([np.zeros(8)], weights, task=LUNARLANDER), Constant(0.0, 0.0)
    alike = likeness(policy, agent, LUNARLANDER)
    alike = dataclasses.replace(alike, states=np.random.default_rng(0).normal(size=(100, 8)))
    assert scene_of(page.episodes(policy, agent, alike))["curves"] == [1, 3, 4, 7]


def of_two(states, errors):
    returns = {"policy": np.ones(4), "agent": np.ones(4)}
    return Likeness(0.99, np.array(states), np.array(errors), returns, dict.fromkeys(returns, 0))


def test_by_hand_what_a_page_says_of_cells_states_and_sizes():
    two = vsp.VoronoiPolicy([[0.2, 0.2], [0.8, 0.8]], np.zeros((2, 3, 2)), task=SIMPLEGOAL)
    said = page._cards(two, of_two([[0.2, 0.2], [0.2, 0.3]], [[0.0, 0.9], [0.0, 0.0]]))
    assert "all actions within 5% in 50% of these" in said
    tried = judged(0.9, [1], [1], 1, True), judged(0.8, [1], [1], 2, True)
    said = page._sizes([dataclasses.replace(tried[0], policy=TWO), tried[1]], TWO)
    assert "1 cell (chosen)" in said and "2 cells (chosen)" not in said and "too low" not in said
    many = vsp.VoronoiPolicy(np.zeros((9, 2)) + np.arange(9)[:, None], np.zeros((9, 3, 2)), task=SIMPLEGOAL)
    assert page._cards(many, of_two([[0.2, 0.2]], [[0.0, 0.0]])).count("border-top") == 1  # a colour that comes again


def test_of_many_inputs_short_equations_and_what_is_typical_come_before_the_exact_ones():
    rng = np.random.default_rng(0)
    policy = vsp.VoronoiPolicy(rng.normal(size=(2, 24)), rng.normal(size=(2, 25, 4)), task="BipedalWalker-v3")
    shown, exact = page._cards(policy, of_two(rng.normal(size=(50, 24)), np.zeros((50, 4)))).split("<details>")[:2]
    assert "on average (in all cells): " in shown and shown.count("(hides ") == 4
    assert html.escape(policy.equations(0)[0]) in exact and "nearest to" in exact


@pytest.mark.parametrize(
    ("r2", "failed", "words"),
    [(0.5, 0, "the actions differ"), (0.99, 4, "more episodes fail"), (0.99, None, "the return is lower")],
)
def test_the_first_sentence_says_what_is_not_alike(r2, failed, words):
    one = judged(r2, [1] * 4, [9] * 4, 1, False)
    alike = dataclasses.replace(one.alike, failures={"policy": failed, "agent": failed and 0})
    one = dataclasses.replace(one, policy=TWO, alike=alike)
    made = vsp_beyond.report(TWO, PumpingTeacher(), MOUNTAINCAR, tried=[one])
    assert f"not closely: {words}.</strong>" in made and "1 (too low)" in made and "warning" not in made


def test_a_proof_that_takes_long_is_given_up(monkeypatch, tmp_path):
    TWO.save(tmp_path / "policy.vsp")
    assert "Nothing is proved within 0.1 s" in page._proof(tmp_path / "policy.vsp", 0.1)
    asked = []
    monkeypatch.setattr(page, "_proof", lambda path, seconds: asked.append(seconds) or "")
    for until in (0.0, page.time.monotonic() + 10, float("inf")):
        page._kept(TWO, np.zeros((2, 2)), until)
    assert asked == pytest.approx([1.0, 10.0, 60.0], abs=0.5)


def test_the_command_makes_a_page_once_and_says_in_one_line_why_not(monkeypatch, tmp_path, capsys):
    quick = vsp.VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task=SIMPLEGOAL)
    chosen = Tried(None, quick, "alike", True)
    monkeypatch.setattr(command, "fewest", lambda agent, task, **given: (chosen, [chosen], ["8 cells"]))
    monkeypatch.setattr(command, "report", lambda *given, **named: f"page of {named['name']}, {named['remarks']}")
    monkeypatch.setattr(command.vsp, "agent", lambda source, task, **options: CurvedTeacher())
    out = tmp_path / "report.html"
    called(command.main, "agent.zip", SIMPLEGOAL, "--out", out)
    assert out.read_text().startswith("page of agent.zip, Left out, because the time was over: 8 cells.")
    assert "open it in a browser" in capsys.readouterr().out
    for arguments, reason in (
        (["agent.zip", SIMPLEGOAL], "exists and is kept: name another file, or say --force"),
        (["agent.zip", SIMPLEGOAL, "--minutes", "0"], "--minutes is 0, expected a number above 0"),
        (["agent.zip", "Pendulum-v9"], f"unknown task 'Pendulum-v9', .*did you mean '{PENDULUM}'"),
    ):
        place = out if "exists" in reason else tmp_path / "other.html"
        with pytest.raises(SystemExit) as end:
            called(command.main, *arguments, "--out", place)
        said = capsys.readouterr().err
        assert end.value.code == 2 and re.search(reason, said) and said.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html"]


def interrupted(*given, **options):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("out", "said"),
    [("fifo", "is a folder, a FIFO or a device, expected a file"), ("folder", "is a folder, a FIFO or a device"),
     ("x" * 300, "File name too long"), ("file/report.html", "file"),
     ("report.html", "interrupted, nothing is written")],
)  # fmt: skip
def test_what_would_stop_the_page_at_the_end_stops_it_at_once(out, said, monkeypatch, tmp_path, capsys):
    """A FIFO stands for a device, which only root could make: neither is replaced by a file."""
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("x")
    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr(command.vsp, "agent", interrupted)
    with pytest.raises(SystemExit):
        called(command.main, "agent.zip", SIMPLEGOAL, "--force", "--out", tmp_path / out)
    line = capsys.readouterr().err
    assert said in line and line.count("\n") == 1 and len(line) < 600
    assert sorted(tmp_path.iterdir()) == before and (tmp_path / "fifo").is_fifo()


def test_an_equation_of_many_inputs_shows_five_and_says_what_it_hides():
    """By hand: of nine inputs of unit deviation, with weights 9 to 1, the last four hide 30 of 285."""
    task = dataclasses.replace(get_task(SIMPLEGOAL), inputs=tuple("abcdefghi"), low=np.zeros(9), high=np.ones(9))
    weights = np.append(np.arange(9.0, 0, -1), 2.0)
    policy = vsp.VoronoiPolicy([np.zeros(9)], np.stack([weights, weights], axis=1)[None], task=task)
    states = np.vstack([np.eye(9), -np.eye(9)]) * 3 / 2**0.5 + 1
    (line, _) = page._equations(policy, 0, states)
    assert line == "Δx = 9 · a + 8 · b + 7 · c + 6 · d + 5 · e + 12 (hides 10.5%)"
    assert page._equations(TWO, 0, states[:, :2]) == TWO.equations(0)
