import base64
import os
import re
import sys

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, Constant, CurvedTeacher, PumpingTeacher

import vsp
import vsp_beyond
from vsp_beyond import __main__ as command
from vsp_beyond import page

TWO = vsp.VoronoiPolicy([[-0.5, 0.01], [-0.5, -0.01]], [[[0], [0], [1]], [[0], [0], [-1]]], task=MOUNTAINCAR)


def test_a_page_has_all_it_needs_and_names_are_text(monkeypatch, tmp_path):
    monkeypatch.setattr(page, "_PROVE", "print('a theorem <b>')")
    made = vsp_beyond.report(TWO, PumpingTeacher(), MOUNTAINCAR, name="<script>alert(1)</script>", remarks="few <i>")
    assert "F = 0.000 x + 0.000 v + 1.000" in made and "a theorem &lt;b&gt;" in made and "few &lt;i&gt;" in made
    assert "<script>alert" not in made and "<p>Manhattan distances.</p>" in made
    assert not re.search(r"(src|href)=\"(?!data:)", made) and len(made) < 2_000_000
    (code,) = re.findall(r'download="policy.vsp" href="data:[^,]*,([^"]*)"', made)
    (tmp_path / "x.vsp").write_bytes(base64.b64decode(code))
    assert vsp.VoronoiPolicy.load(tmp_path / "x.vsp").to_json() == TWO.to_json()


def test_of_a_task_that_a_browser_cannot_play_it_says_so():
    policy = vsp.VoronoiPolicy([np.zeros(8), np.ones(8)], np.zeros((2, 9, 2)), task=LUNARLANDER)
    made = vsp_beyond.report(policy, Constant(0.0, 0.0), LUNARLANDER)
    assert "no explorer: the browser plays SimpleGoal" in made and "application/json" not in made
    assert all(part in made for part in ("<h2>How alike", "<h2>The policy", "<h2>Where do they differ", "Cell 0<"))


def test_a_proof_that_takes_long_is_given_up(monkeypatch, tmp_path):
    monkeypatch.setattr(page, "PROOF_SECONDS", 0.1)
    TWO.save(tmp_path / "policy.vsp")
    assert "Nothing is proved within 0.1 s" in page._proof(tmp_path / "policy.vsp")


def test_the_command_makes_a_page_once_and_says_in_one_line_why_not(monkeypatch, tmp_path, capsys):
    quick = vsp.VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task=SIMPLEGOAL)
    monkeypatch.setattr(command, "faithful", lambda agent, task, *, n_cells, seed: quick)
    monkeypatch.setattr(command, "report", lambda *given, **named: f"page of {named['name']}")
    monkeypatch.setattr(command.vsp, "agent", lambda source, task, **options: CurvedTeacher())
    out = tmp_path / "report.html"
    monkeypatch.setattr(sys, "argv", ["x", "agent.zip", SIMPLEGOAL, "--out", str(out)])
    command.main()
    assert out.read_text() == "page of agent.zip" and "open it in a browser" in capsys.readouterr().out
    for arguments, reason in (
        (["agent.zip", SIMPLEGOAL], "exists and is kept: name another file, or say --force"),
        (["agent.zip", "Pendulum-v9"], f"unknown task 'Pendulum-v9', .*did you mean '{PENDULUM}'"),
    ):
        place = out if "exists" in reason else tmp_path / "other.html"
        monkeypatch.setattr(sys, "argv", ["x", *arguments, "--out", str(place)])
        with pytest.raises(SystemExit) as end:
            command.main()
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
    monkeypatch.setattr(sys, "argv", ["x", "agent.zip", SIMPLEGOAL, "--force", "--out", str(tmp_path / out)])
    with pytest.raises(SystemExit):
        command.main()
    line = capsys.readouterr().err
    assert said in line and line.count("\n") == 1 and len(line) < 600
    assert sorted(tmp_path.iterdir()) == before and (tmp_path / "fifo").is_fifo()
