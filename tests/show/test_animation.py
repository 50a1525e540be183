import base64
import html
import re
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from PIL import Image, ImageSequence
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, tiny

from vsp import distill
from vsp.history import Event
from vsp.show import animation
from vsp.show.animation import DPI, Growth, save_growth

mpl.use("Agg")
ROOT = Path(__file__).resolve().parents[2]
TEACHERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}
ALT = 'cells "grow" & <merge>'


@pytest.fixture(scope="module", params=TEACHERS)
def run(request):
    config = tiny(min_pol_distance=0.2 if request.param == SIMPLEGOAL else 0.1)
    return request.param, TEACHERS[request.param], distill(TEACHERS[request.param], request.param, config, seed=0)[1]


@pytest.fixture(scope="module")
def growth(run):
    task, teacher, history = run
    return Growth(history, teacher, task, dpi=60)


def kinds(history, first, last):
    return [e.kind for e in history.events if first <= e.iteration <= last]


def test_words_say_what_the_history_says(run, growth):
    history = run[2]
    last = max(e.iteration for e in history.events)
    came, went = (kinds(history, last, last).count(kind) for kind in ("split", "merge"))
    assert growth.words(119).startswith(
        f"After iteration 119 (0 to 119): {history.cells[-1]} cells. "
        f"Last change, iteration {last}: {came} came by splits, {went} went by merges."
    )
    assert growth.words(0) == "After iteration 0 (0 to 119): 1 cell." and len(growth) == 120


def test_words_say_what_came_and_went_at_once(growth, monkeypatch):
    """Two came, one of them went again, and one that was there before went."""
    place = growth.history.policy_at(119).codewords[-1]
    there = [Event(115, "split", codeword) for codeword in (place, np.array([2.0, 2.0]))]
    gone = [Event(115, "merge", np.array([value, value])) for value in (2.0, 3.0)]
    monkeypatch.setattr(growth.history, "events", [*there, *gone])
    assert growth.words(119).endswith(
        "Last change, iteration 115: 2 came by splits, 2 went by merges. Of these, 1 came and went at once: a cross "
        "without a ring."
    )
    monkeypatch.setattr(growth.history, "events", there[:1])
    assert growth.words(119).endswith("1 came by splits, 0 went by merges.")
    assert growth.words(114).endswith("cells.")


def test_moments_begin_close_and_reach_the_end(growth):
    assert growth.moments(6) == [0, 4, 19, 42, 76, 119]  # 119 (i / 5)^2
    assert growth.moments(1000) == list(range(120))


def test_what_changed_is_marked(run, growth, monkeypatch):
    """Rings on the codewords of the last pass, or since an iteration, that are still there; crosses on those gone."""
    history, marked = run[2], []
    monkeypatch.setattr(animation, "changes", lambda ax, came, went: marked.append((came.tolist(), went.tolist())))
    passes = sorted({e.iteration for e in history.events})
    assert len(passes) > 2 and {"split", "merge"} <= set(kinds(history, 0, 120))
    for n in (passes[0], passes[1] - 1, passes[-1], 119):
        growth.shoot(n)
        pass_of = max(p for p in passes if p <= n)
        before, after = (history.policy_at(m).codewords.tolist() for m in (pass_of - 1, n))
        came, went = marked.pop()
        assert came == sorted(codeword for codeword in after if codeword not in before)
        assert all(codeword in went for codeword in before if codeword not in after)
        brief = [codeword for codeword in went if codeword not in before]  # came and went in one pass
        assert len(came) + len(brief) == kinds(history, pass_of, pass_of).count("split")
    growth.shoot(119, since=-1)
    first = history.policy_at(0).codewords[0]  # no split brought it
    final = [codeword for codeword in history.policy_at(119).codewords.tolist() if codeword != first.tolist()]
    came, went = marked.pop()
    assert came == sorted(final) and went and not any(codeword in final for codeword in went)


def test_a_shot_shows_the_iteration(growth):
    early, late, again = growth.shoot(0), growth.shoot(119), growth.shoot(0)
    assert np.array_equal(early, again) and early.shape == (156, 360, 3)
    assert (early != late).any()
    assert not plt.get_fignums()


def test_actions_borders_and_mark_are_those_of_the_policy_then(run, growth, monkeypatch):
    """The copy acts on its own panel."""
    history, seen, acting, marked = run[2], [], [], []
    monkeypatch.setattr(growth.maps, "policy", lambda ax, policy: acting.append((ax, policy)))
    monkeypatch.setattr(animation, "moment", lambda ax, n, cells: marked.append((ax, n, cells)))
    monkeypatch.setattr(animation, "borders", lambda ax, x, y, index: seen.append((x, y, index)))
    growth.shoot(60)
    policy = history.policy_at(60)
    for x, y, index in seen:
        assert np.array_equal(index, policy.cells(np.column_stack([x.ravel(), y.ravel()])))
    assert len(seen) == 2  # over the teacher's map and over the copy's
    assert acting == [(growth._axes[1], policy)] and marked == [(growth._axes[2], 60, history.cells[60])]


@pytest.fixture(scope="module")
def saved(run, tmp_path_factory):
    task, teacher, history = run
    out = tmp_path_factory.mktemp("out")
    return save_growth(history, teacher, task, "growth", out=out, alt=ALT), out / "figures"


def test_the_gif_is_short_small_and_ends_on_the_final_partition(run, saved):
    task, teacher, history = run
    gif = Image.open(saved[1] / "growth.gif")
    assert gif.info["loop"] == 0  # for ever
    frames = [(frame.info["duration"], np.asarray(frame.convert("RGB"), int)) for frame in ImageSequence.Iterator(gif)]
    assert 20 <= len(frames) <= 40 and sum(duration for duration, _ in frames) < 10_000
    assert frames[-1][0] >= 2000 and len(saved[0].gif) < 600_000
    shot = Growth(history, teacher, task, dpi=DPI).shoot(119, since=114)
    still = np.asarray(Image.open(saved[1] / "growth.png").convert("RGB"), int)
    for shown in (frames[-1][1], still):
        assert np.abs(shown - shot).mean() < 3  # but for fewer colours
    assert np.abs(frames[0][1] - shot).mean() > 3
    assert (still[0, 0] == 255).all() and all((frame[0, 0] == 255).all() for _, frame in frames)


def test_it_is_shown_with_words_and_moves_only_when_asked(saved):
    shown, folder = saved
    text = shown._repr_html_()
    still, moving = re.findall(
        r'<img alt="([^"]*)" src="data:image/(\w+);base64,([^"]+)" width="720" height="312"', text
    )
    assert [html.unescape(one[0]) for one in (still, moving)] == [f"The last frame of the moving picture: {ALT}", ALT]
    for (_, kind, data), name, held in ((still, "png", shown.still), (moving, "gif", shown.gif)):
        assert kind == name and base64.b64decode(data) == held == (folder / f"growth.{name}").read_bytes()
    before, folded = text.split("<details><summary>play the moving picture</summary>")
    assert "image/png" in before and "image/gif" not in before and folded.endswith("</details></figure>")
    assert repr(shown) == ALT


def test_another_process_writes_the_same_bytes_and_a_quick_run_is_marked(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 8)
    history = distill(CurvedTeacher(), SIMPLEGOAL, tiny(n_epochs=60), seed=0)[1]
    folders = [tmp_path / name for name in ("here", "quick", "there")]
    for folder, quick in zip(folders, (False, True)):
        save_growth(history, CurvedTeacher(), SIMPLEGOAL, "growth", out=folder, alt=ALT, quick=quick)
    code = f"""
import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / "tests")!r}]
import matplotlib; matplotlib.use("Agg")
from support import CurvedTeacher, tiny
from vsp import distill
from vsp.show import animation
animation.FRAMES = 8
history = distill(CurvedTeacher(), {SIMPLEGOAL!r}, tiny(n_epochs=60), seed=0)[1]
animation.save_growth(history, CurvedTeacher(), {SIMPLEGOAL!r}, "growth", out={str(folders[2])!r}, alt="x")
"""
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONHASHSEED": "7", "PATH": ""}, cwd=tmp_path)
    for name in ("growth.gif", "growth.png"):
        here, quick, there = ((folder / "figures" / name).read_bytes() for folder in folders)
        assert here == there != quick


def test_what_cannot_be_drawn_is_named(run):
    task, teacher, history = run
    with pytest.raises(ValueError, match="task is Pendulum-v1, expected one of .*SimpleGoal-v0"):
        Growth(history, teacher, PENDULUM)
    other = MOUNTAINCAR if task == SIMPLEGOAL else SIMPLEGOAL
    with pytest.raises(ValueError, match=f"history is of a run on {task}, expected one on {other}"):
        Growth(history, teacher, other)
    with pytest.raises(ValueError, match="history is a DataFrame, expected the History"):
        Growth(pd.DataFrame(), teacher, task)
    with pytest.raises(ValueError, match="iteration is 120, expected an integer from 0 to 119"):
        Growth(history, teacher, task, dpi=40).shoot(120)
