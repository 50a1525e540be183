import base64
import dataclasses
import html
import io
import re

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, tiny

import vsp
from vsp import distill
from vsp.show import Laboratory, laboratory, page
from vsp.show.laboratory import SHOWN, Remembered

mpl.use("Agg")
VIEW = "application/vnd.jupyter.widget-view+json"
TEACHERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}
CONFIG = tiny(min_pol_distance=0.3)


def pictures(text):
    """The pixels and the alternative text of every picture of a page, given as HTML."""
    found = re.findall(r'<img alt="([^"]*)" src="data:image/png;base64,([^"]+)"', text)
    images = [np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")) for _, data in found]
    return images, [html.unescape(alt) for alt, _ in found]


def tables(text):
    """The cells of every table of a page, as text, row by row from the heads on."""
    rows = [
        re.findall(r"<tr.*?</tr>", table, flags=re.S) for table in re.findall(r"<table.*?</table>", text, flags=re.S)
    ]
    return [[re.findall(r"<t[dh]>(.*?)</t[dh]>", row) for row in table] for table in rows]


def seen(explorer):
    """What a reader sees: the picture, its alternative text, and the text beside it."""
    (image,), (alt,) = pictures(explorer.picture.value)
    return image, alt, explorer.text.value


def displayed(explorer_, monkeypatch):
    """What it leaves in a notebook: output after output."""
    outputs = []
    monkeypatch.setattr(page, "display", lambda data, raw: outputs.append(data))
    explorer_._ipython_display_()
    return outputs


def fails(*_, **__):
    raise RuntimeError("no <room> left")


def interrupted(*_, **__):
    raise KeyboardInterrupt


@pytest.fixture(scope="module", autouse=True)
def small_pictures():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(laboratory, "DPI", 60)
        yield


# Laboratory


@pytest.fixture(scope="module")
def lab():
    return Laboratory(CurvedTeacher(), SIMPLEGOAL, CONFIG, seed=3)


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
    before, known = seen(lab)[0], len(lab.trials)
    lab.settings["min_pol_distance"].value = 0.45
    image, alt, text = seen(lab)
    assert len(lab.trials) == known + 1 and lab.trials[-1][0] == dataclasses.replace(CONFIG, min_pol_distance=0.45)
    assert (image != before).any() and alt.startswith(f"Trial {known + 1}: {len(lab.trials[-1][1])} cells")
    (table,) = tables(text)
    heads, newest, *_ = table
    assert heads[:4] == ["trial", "cells", "mean return", "failures"]
    assert dict(zip(heads, newest))["min pol distance"] == "0.45"
    frame = lab.to_frame().reset_index()[::-1].head(SHOWN)
    for name in ("cells", "failures"):
        assert [row[heads.index(name)] for row in table[1:]] == [str(value) for value in frame[name]]
    assert [row[0] for row in table[1:]] == [f"→\N{NO-BREAK SPACE}{known + 1}", *map(str, range(known, 0, -1))]


def test_the_words_tell_the_copy_from_the_teacher(lab):
    teacher = vsp.evaluate(CurvedTeacher(), SIMPLEGOAL, 300, seed=1)
    for place in (1, 2):
        _, policy, result = lab.trials[place]
        assert result["mean"] != pytest.approx(teacher["return"].mean(), abs=0.01)
        cells = f"{len(policy)} cell{'s' * (len(policy) > 1)}"
        assert lab.show(place).text.startswith(
            f"<p>Trial {place + 1}: {cells}, mean return {result['mean']:.2f}; {result['failures'] or 'none'} of 300 "
            f"starts fail to reach the goal. The teacher: mean return {teacher['return'].mean():.2f}, "
            f"{(teacher['outcome'] != 'goal').sum() or 'no'} failures.</p>"
        )


def test_the_status_says_that_it_works(lab, monkeypatch):
    said = []
    monkeypatch.setattr(lab, "trial", lambda changes: said.append(lab.status.value) or 0)
    lab.settings["max_pol_loss"].value = 0.2
    assert said == ["distilling …"] and lab.status.value.startswith("Change a setting")
    lab.back.click()


@pytest.mark.parametrize("stage", ["trial", "show"])
def test_a_trial_that_fails_leaves_no_doubt(lab, monkeypatch, stage):
    """Whether the distillation fails or the drawing, the picture is an earlier trial's."""
    lab.settings["min_pol_distance"].value = 0.45
    before, (shown,) = seen(lab), re.findall(r"→\s(\d+)", lab.text.value)
    with monkeypatch.context() as patch, pytest.raises(RuntimeError):
        patch.setattr(lab, stage, fails)
        lab.settings["min_pol_distance"].value = 0.5
    assert lab.status.value.endswith(f"RuntimeError: no &lt;room&gt; left. The picture below is trial {shown}.")
    assert np.array_equal(seen(lab)[0], before[0]) and seen(lab)[2] == before[2]
    lab.settings["min_pol_distance"].value = 0.45
    assert lab.status.value.startswith("Change a setting")


def test_the_picture_is_that_of_the_trial(lab, monkeypatch):
    """Its map and its cells on the panel of the copy, its cells on the teacher's too, the ring on its dot."""
    maps, cells, rings = [], [], []
    monkeypatch.setattr(lab.maps, "policy", lambda ax, policy: maps.append((ax, policy)))
    monkeypatch.setattr(lab.maps, "cells", lambda ax, policy: cells.append((ax, policy)))
    monkeypatch.setattr(laboratory, "trials", lambda ax, frame, this, teacher: rings.append((ax, len(frame), this)))
    left, middle, right = lab._axes[:3]
    for place in (0, 2):
        policy = lab.trials[place][1]
        lab.show(place)
        assert maps.pop() == (middle, policy) and cells == [(left, policy), (middle, policy)]
        assert rings.pop() == (right, len(lab.trials), place)
        cells.clear()


def test_the_same_settings_are_not_tried_twice(lab):
    lab.settings["min_param_distance"].value = 0.9
    known = len(lab.trials)
    lab.settings["min_param_distance"].value = 1.2
    lab.settings["min_param_distance"].value = 0.9 + 1e-12  # as sliders round
    assert len(lab.trials) == known + 1
    assert seen(lab)[1].startswith(f"Trial {known}:")


def test_one_button_leads_back_to_the_first_trial(lab, monkeypatch):
    lab.settings["min_pol_distance"].value = 0.45
    lab.settings["min_param_distance"].value = 0.9
    known, asked = len(lab.trials), []
    trial = lab.trial
    monkeypatch.setattr(lab, "trial", lambda changes: asked.append(changes) or trial(changes))
    lab.back.click()
    assert len(asked) == 1 and len(lab.trials) == known and seen(lab)[1].startswith("Trial 1:")
    lab.settings["min_param_distance"].value = 0.9  # and the controls still answer
    assert len(asked) == 2


def test_settings_with_many_digits_are_those_of_the_first_trial():
    fine = dataclasses.replace(CONFIG, min_pol_distance=0.301234567, n_epochs=40, n_freeze=10)
    lab = Laboratory(CurvedTeacher(), SIMPLEGOAL, fine)
    assert lab.trials[0][0] == fine and lab.trial({name: one.value for name, one in lab.settings.items()}) == 0


def test_the_table_holds_the_trial_that_is_shown(lab, monkeypatch):
    monkeypatch.setattr(lab, "trials", lab.trials[:1] * 20)
    for place, numbers in ((19, [20, 19, 18, 17, 16, 15, 14, 13]), (2, [20, 19, 18, 17, 16, 15, 14, 3])):
        (table,) = tables(lab.show(place).text)
        shown = [f"→\N{NO-BREAK SPACE}{number}" if number == place + 1 else str(number) for number in numbers]
        assert [row[0] for row in table[1:]] == shown


def test_networks_play_fewer_iterations_and_the_page_says_so(lab):
    assert "played only" not in lab.text.value
    lab.settings["sub_policy"].value = "network"
    config = lab.trials[-1][0]
    assert (config.n_epochs, config.n_freeze, config.sub_policy) == (48, 12, "network")
    assert "This trial played only 48 of 120 iterations, to be quick." in lab.text.value
    assert lab.trials[-1][1].policy_class.name == "network"
    lab.settings["sub_policy"].value = "linear"


def test_classes_that_do_not_fit_are_not_offered(lab):
    assert set(lab.settings["sub_policy"].options) == {"constant", "linear", "quadratic", "network"}
    fitted = tiny(min_pol_distance=0.3, fit="closed_form")
    offered = Laboratory(PumpingTeacher(), MOUNTAINCAR, fitted).settings["sub_policy"].options
    assert set(offered) == {"constant", "linear", "quadratic", "pid"}


def test_sliders_reach_what_the_first_trials_need(lab):
    for name, slider in lab.settings.items():
        values = [getattr(config, name) for config, _, _ in lab.trials[:3]]
        if name == "max_pol_loss":
            values = np.log10(values)
        if name != "sub_policy":
            assert slider.min <= min(values) and max(values) <= slider.max and not slider.continuous_update


def test_without_a_kernel_there_are_the_first_trials(lab, monkeypatch):
    controls, strip = displayed(lab, monkeypatch)
    assert controls[VIEW]["model_id"] == lab.view.model_id and strip["text/plain"].startswith("Laboratory")
    _, alts = pictures(strip["text/html"])
    assert [alt.split(":")[0] for alt in alts] == ["Trial 1", "Trial 2", "Trial 3"]
    assert [len(table) - 1 for table in tables(strip["text/html"])] == [1, 2, 3]
    fresh = displayed(Laboratory(CurvedTeacher(), SIMPLEGOAL, CONFIG, seed=3), monkeypatch)
    assert fresh[1] == strip  # whatever was tried before


@pytest.mark.parametrize(
    ("teacher", "message"),
    [
        (None, "the policy is None, expected something with `predict`"),
        (PumpingTeacher(), r"actions have shape \(1, 1\)"),
    ],
)
def test_a_teacher_that_does_not_play_the_task_is_refused(teacher, message):
    with pytest.raises(ValueError, match=message):
        Laboratory(teacher, SIMPLEGOAL, CONFIG)


def test_a_laboratory_needs_cells_to_split():
    with pytest.raises(ValueError, match="config is a Refinement, expected a Config"):
        Laboratory(CurvedTeacher(), SIMPLEGOAL, vsp.preset(SIMPLEGOAL, "tuned"))
    with pytest.raises(ValueError, match="task is Pendulum-v1, expected one of"):
        Laboratory(CurvedTeacher(), PENDULUM, CONFIG)


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
