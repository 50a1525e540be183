import base64
import dataclasses
import html
import io
import re

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, tiny

import vsp
from vsp import explorer
from vsp.distill import distill
from vsp.explorer import Remembered, laboratory, replay

mpl.use("Agg")
VIEW = "application/vnd.jupyter.widget-view+json"
TEACHERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}
CONFIG = tiny(min_pol_distance=0.3)


def pictures(page):
    """The pixels and the alternative text of every picture of a page."""
    found = re.findall(r'<img alt="([^"]*)" src="data:image/png;base64,([^"]+)"', page)
    images = [np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")) for _, data in found]
    return images, [html.unescape(alt) for alt, _ in found]


def tables(page):
    """The cells of every table of a page, as text, row by row from the heads on."""
    rows = [
        re.findall(r"<tr.*?</tr>", table, flags=re.S) for table in re.findall(r"<table.*?</table>", page, flags=re.S)
    ]
    return [[re.findall(r"<t[dh]>(.*?)</t[dh]>", row) for row in table] for table in rows]


# Replay


@pytest.fixture(scope="module", autouse=True)
def small_pictures():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(explorer, "DPI", 60)
        yield


@pytest.fixture(scope="module", params=TEACHERS)
def run(request):
    teacher = TEACHERS[request.param]
    config = CONFIG if request.param == SIMPLEGOAL else tiny(min_pol_distance=0.1)
    return request.param, teacher, distill(teacher, request.param, config, seed=0)[1]


@pytest.fixture
def shown(run):
    task, teacher, history = run
    return replay(teacher, task, history)


def test_the_slider_turns_the_pages(shown, run):
    history, seen = run[2], []
    for n in (0, 40, 119):
        shown.iteration.value = n
        (image,), (alt,) = pictures(shown.page.value)
        cells = history.cells[n]
        assert alt.startswith(f"Iteration {n} of 120: {cells} cell{'s' * (cells > 1)}.")
        seen.append(image)
    assert (seen[0] != seen[1]).any() and (seen[1] != seen[2]).any()
    assert not plt.get_fignums()  # or a notebook would show them


@pytest.mark.parametrize("n", [0, 119])
def test_a_chosen_state_shows_its_cell_its_equations_and_both_actions(shown, run, n):
    task, teacher, history = run
    shown.iteration.value = n
    before = pictures(shown.page.value)[0][0]
    for slider, share in zip(shown.point, (0.3, 0.4)):
        slider.value = slider.min + share * (slider.max - slider.min)
    point = np.array([slider.value for slider in shown.point])
    policy, page = history.policy_at(n), shown.page.value
    why = policy.explain(point)
    assert f"is in cell {why.cell}, whose codeword is ({', '.join(f'{c:.3f}' for c in why.codeword)})" in page
    assert [html.unescape(line) for line in re.findall(r"<code>(.*?)</code>", page)] == list(why.equations)
    (table,) = tables(page)
    actions = zip(policy.task.outputs, teacher.predict(point[None])[0][0], why.action, strict=True)
    assert table == [["action", "teacher", "copy"], *([name, f"{a:.3f}", f"{b:.3f}"] for name, a, b in actions)]
    assert (pictures(page)[0][0] != before).any()


def test_buttons_go_from_change_to_change(shown, run):
    passes, stops = sorted({e.iteration for e in run[2].events}), []
    for _ in passes:
        shown.next.click()
        stops.append(shown.iteration.value)
    assert stops == passes
    shown.next.click()
    assert shown.iteration.value == passes[-1]  # there is no next
    shown.iteration.value += 1
    shown.previous.click()
    assert shown.iteration.value == passes[-1]
    shown.previous.click()
    assert shown.iteration.value == passes[-2]


def test_without_a_kernel_there_are_still_pages(shown, run):
    bundle = shown._repr_mimebundle_(include=None, exclude=None)
    assert bundle[VIEW]["model_id"] == shown.view.model_id and bundle["text/plain"].startswith("Replay of a dist")
    images, alts = pictures(bundle["text/html"])
    assert [alt.split(" of ")[0] for alt in alts] == ["Iteration 1", "Iteration 12", "Iteration 119"]
    assert len(images) == bundle["text/html"].count("<figure>") == 3 and bundle["text/html"].count("<code>") >= 3
    task, teacher, history = run
    again = replay(teacher, task, history)
    assert again._repr_mimebundle_()["text/html"] == bundle["text/html"]  # the same bytes


def test_what_cannot_be_replayed_is_named(run):
    task, teacher, history = run
    with pytest.raises(ValueError, match="history is a DataFrame, expected the History"):
        replay(teacher, task, history.to_frame())
    with pytest.raises(ValueError, match="task is Pendulum-v1, expected one of"):
        replay(teacher, PENDULUM, history)


# Laboratory


@pytest.fixture(scope="module")
def lab():
    return laboratory(CurvedTeacher(), SIMPLEGOAL, CONFIG, seed=3)


def test_it_begins_with_the_configuration_and_two_changes(lab):
    """Two routes: its trials, and distillation and evaluation by themselves."""
    changes = {}, {"max_pol_loss": 20.0}, {"min_pol_distance": 0.6}
    for (config, policy, _), (_, row), changed in zip(lab.trials[:3], lab.to_frame().iterrows(), changes):
        assert config == dataclasses.replace(CONFIG, **changed)
        same, _ = distill(CurvedTeacher(), SIMPLEGOAL, config, seed=3)
        assert np.array_equal(policy.codewords, same.codewords)
        assert np.array_equal(policy.coefficients, same.coefficients)
        result = vsp.evaluate(same, SIMPLEGOAL, 300, seed=1)
        assert row["cells"] == len(same) and row["mean return"] == result["return"].mean()
        assert row["failures"] == (result["outcome"] != "goal").sum()


def test_a_setting_makes_a_trial(lab):
    before, known = pictures(lab.page.value)[0][0], len(lab.trials)
    lab.settings["min_pol_distance"].value = 0.45
    (image,), (alt,) = pictures(lab.page.value)
    assert len(lab.trials) == known + 1 and lab.trials[-1][0] == dataclasses.replace(CONFIG, min_pol_distance=0.45)
    assert (image != before).any() and alt.startswith(f"Trial {known + 1}: {len(lab.trials[-1][1])} cells")
    (table,) = tables(lab.page.value)
    heads, newest, *_ = table
    assert dict(zip(heads, newest))["min_pol_distance"] == "0.45" and lab.status.value == "done"
    frame = lab.to_frame().reset_index()[::-1].head(explorer.SHOWN)
    for name in ("trial", "cells", "failures"):
        assert [row[heads.index(name)] for row in table[1:]] == [str(value) for value in frame[name]]


def test_the_same_settings_are_not_tried_twice(lab):
    lab.settings["min_param_distance"].value = 0.9
    known = len(lab.trials)
    lab.settings["min_param_distance"].value = 1.2
    lab.settings["min_param_distance"].value = 0.9 + 1e-12  # as sliders round
    assert len(lab.trials) == known + 1
    assert pictures(lab.page.value)[1][0].startswith(f"Trial {known}:")


def test_networks_play_fewer_iterations_and_the_page_says_so(lab):
    lab.settings["sub_policy"].value = "network"
    config = lab.trials[-1][0]
    assert (config.n_epochs, config.n_freeze, config.sub_policy) == (48, 12, "network")
    assert "Played: 48 of 120 iterations." in lab.page.value
    assert lab.trials[-1][1].form.name == "network"
    lab.settings["sub_policy"].value = "linear"


def test_classes_that_do_not_fit_are_not_offered(lab):
    assert set(lab.settings["sub_policy"].options) == {"constant", "linear", "quadratic", "network"}
    fitted = tiny(min_pol_distance=0.3, fit="closed_form")
    offered = laboratory(PumpingTeacher(), MOUNTAINCAR, fitted).settings["sub_policy"].options
    assert set(offered) == {"constant", "linear", "quadratic", "pid"}


def test_sliders_reach_what_the_first_trials_need(lab):
    for name, slider in lab.settings.items():
        values = [getattr(config, name) for config, _, _ in lab.trials[:3]]
        if name == "max_pol_loss":
            values = np.log10(values)
        if name != "sub_policy":
            assert slider.min <= min(values) and max(values) <= slider.max and not slider.continuous_update


def test_without_a_kernel_there_are_the_first_trials(lab):
    bundle = lab._repr_mimebundle_()
    assert bundle[VIEW]["model_id"] == lab.view.model_id and bundle["text/plain"].startswith("Laboratory")
    _, alts = pictures(bundle["text/html"])
    assert [alt.split(":")[0] for alt in alts] == ["Trial 1", "Trial 2", "Trial 3"]
    assert [len(table) - 1 for table in tables(bundle["text/html"])] == [1, 2, 3]
    fresh = laboratory(CurvedTeacher(), SIMPLEGOAL, CONFIG, seed=3)
    assert fresh._repr_mimebundle_()["text/html"] == bundle["text/html"]  # whatever was tried before


def test_a_laboratory_needs_cells_to_split():
    with pytest.raises(ValueError, match="config is a Refinement, expected a Config"):
        laboratory(CurvedTeacher(), SIMPLEGOAL, vsp.preset(SIMPLEGOAL, "best"))
    with pytest.raises(ValueError, match="task is Pendulum-v1, expected one of"):
        laboratory(CurvedTeacher(), PENDULUM, CONFIG)


def test_a_remembered_teacher_is_asked_once():
    class Counting(CurvedTeacher):
        asked = 0

        def predict(self, obs):
            self.asked += 1
            return super().predict(obs)

    teacher = Counting()
    memory, states = Remembered(teacher), np.random.default_rng(0).uniform(size=(5, 2))
    first = memory.predict(states)[0]
    first[:] = 0  # whoever changes an answer does not change the memory
    assert np.array_equal(memory.predict(states)[0], CurvedTeacher().predict(states)[0]) and teacher.asked == 1
    memory.predict(states.astype(np.float32))
    memory.predict(states[:4])
    assert teacher.asked == 3
    config, before = tiny(), teacher.asked
    policies = [distill(memory, SIMPLEGOAL, config, seed=0)[0] for _ in range(2)]
    plain, _ = distill(teacher, SIMPLEGOAL, config, seed=0)
    played = (teacher.asked - before) / 2  # once by the memory, once by itself
    assert played == int(played) > 0
    for policy in policies:
        assert np.array_equal(policy.coefficients, plain.coefficients)
