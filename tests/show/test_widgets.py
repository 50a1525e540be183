import dataclasses
import html
import json
import re

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher, PumpingTeacher, tiny

import vsp
from vsp.show import Laboratory, page

VIEW = "application/vnd.jupyter.widget-view+json"
CONFIG = tiny(min_pol_distance=0.3)


def rows_of(text):
    """The cells of the table of a page, as text, row by row from the heads on."""
    return [re.findall(r"<t[dh]>(.*?)</t[dh]>", row) for row in re.findall(r"<tr.*?</tr>", text, flags=re.S)]


def drawn(lab):
    """The names of the policies that the explorer has, and the first of them."""
    policies = json.loads(lab.explorer.scene)["policies"]
    return [one["name"] for one in policies], policies[0]


def displayed(lab, monkeypatch):
    """What it leaves in a notebook: output after output."""
    outputs = []
    monkeypatch.setattr(page, "display", lambda data, raw: outputs.append(data))
    lab._ipython_display_()
    return outputs


@pytest.fixture(scope="module")
def lab():
    return Laboratory(CurvedTeacher(), SIMPLEGOAL, CONFIG, seed=3)


def tried(lab, name, value, expected=""):
    lab.settings[name].value, lab.expected.value = value, expected
    lab.distil.click()


def test_a_trial_is_a_distillation_and_its_evaluation(lab):
    """Two routes: its trials, and distillation and evaluation by themselves."""
    tried(lab, "min_pol_distance", 0.6)
    changes = {}, {"min_pol_distance": 0.6}
    for (config, policy, _), (_, row), changed in zip(lab.trials[:2], lab.to_frame().iterrows(), changes):
        assert config == dataclasses.replace(CONFIG, **changed)
        same, _ = vsp.distill(CurvedTeacher(), SIMPLEGOAL, config, seed=3)
        assert np.array_equal(policy.codewords, same.codewords)
        assert np.array_equal(policy.coefficients, same.coefficients)
        result = vsp.rollout(
            same, SIMPLEGOAL, json.loads(lab.explorer.scene)["starts"]
        )  # those that the explorer plays
        assert row["cells"] == len(same) and row["mean return"] == result.returns.mean()
        assert row["failures"] == (result.outcomes != 1).sum()


def test_a_click_makes_a_trial_with_what_was_expected_and_the_explorer_draws_it(lab):
    known = len(lab.trials)
    lab.settings["min_pol_distance"].value = 0.5  # a key on a slider alone makes none
    tried(lab, "min_pol_distance", 0.45, "more <cells>")
    config, policy, _ = lab.trials[-1]
    assert len(lab.trials) == known + 1 and config == dataclasses.replace(CONFIG, min_pol_distance=0.45)
    names, first = drawn(lab)
    assert names[0] == f"trial {known + 1}" and len(names) == known + 1
    assert np.array_equal(first["codewords"], policy.codewords)
    assert np.array_equal(first["coefficients"], policy.coefficients)
    heads, newest, *_ = table = rows_of(lab.text.value)
    assert heads[:5] == ["trial", "cells", "mean return", "failures", "I expected"] and lab.expected.value == ""
    assert "more &lt;cells&gt;" in lab.text.value
    assert dict(zip(heads, newest))["min pol distance"] == "0.45"
    assert [row[0] for row in table[1:]] == [f"→\N{NO-BREAK SPACE}{known + 1}", *map(str, range(known, 0, -1))]


def test_constants_are_drawn_as_maps_without_weights(lab):
    tried(lab, "sub_policy", "constant")
    policy, (_, first) = lab.trials[-1][1], drawn(lab)
    maps = np.array(first["coefficients"])
    assert policy.policy_class.name == "constant" and (maps[:, :2] == 0).all()
    assert np.array_equal(maps[:, 2], policy.coefficients[:, 0])
    same = vsp.VoronoiPolicy(first["codewords"], maps, task=SIMPLEGOAL, metric=first["metric"], scale=first["scale"])
    states = np.random.default_rng(0).uniform(size=(50, 2))
    assert np.array_equal(same.predict(states)[0], policy.predict(states)[0])
    lab.settings["sub_policy"].value = "linear"


def test_without_a_kernel_there_is_the_first_trial(lab, monkeypatch):
    controls, still = displayed(lab, monkeypatch)
    assert controls[VIEW]["model_id"] == lab.view.model_id and still["text/plain"].startswith("Laboratory")
    scene = json.loads(html.unescape(re.search(r"json\">(.*?)</script>", still["text/html"], re.S)[1]))
    assert [one["name"] for one in scene["policies"]] == ["trial 1"] and "<img alt=" in still["text/html"]
    fresh = displayed(Laboratory(CurvedTeacher(), SIMPLEGOAL, CONFIG, seed=3), monkeypatch)
    assert fresh[1] == still  # whatever was tried before


def test_a_laboratory_needs_a_task_of_the_paper_maps_to_draw_and_a_teacher_that_fits():
    quadratic = dataclasses.replace(CONFIG, sub_policy="quadratic")
    for teacher, task, config, message in (
        (CurvedTeacher(), PENDULUM, CONFIG, "task is Pendulum-v1, expected one of"),
        (CurvedTeacher(), SIMPLEGOAL, quadratic, "expected a Config whose sub_policy is one of"),
        (CurvedTeacher(), SIMPLEGOAL, "paper", "config is 'paper', expected a Config"),
        (None, SIMPLEGOAL, CONFIG, "the policy is None, expected something with `predict`"),
        (PumpingTeacher(), SIMPLEGOAL, CONFIG, r"actions have shape \(400, 1\)"),
    ):
        with pytest.raises(ValueError, match=message):
            Laboratory(teacher, task, config)
    assert Laboratory(PumpingTeacher(), MOUNTAINCAR, tiny(min_pol_distance=0.3)).trials
