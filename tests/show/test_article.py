"""What Python computes for the article: the same each time, from its sources, and enough for a browser to go on."""

import base64
import sys

import numpy as np
import pytest

from vsp import VoronoiPolicy
from vsp.paper.results import read_results
from vsp.run.atomic import ROOT
from vsp.tasks.simplegoal import TASK

sys.path.append(str(ROOT / "docs" / "article"))
import stills

import data


@pytest.fixture(scope="module")
def parts():
    return data.parts()


def floats(text):
    return np.frombuffer(base64.b64decode(text), "<f4").astype(float)


def test_the_same_parts_each_time(parts):
    for function in vars(data).values():
        getattr(function, "cache_clear", int)()
    assert data.parts() == parts


def test_what_the_text_says_is_what_its_sources_say(parts):
    says, rows = parts["scene"]["says"], read_results("simpler").query("task == 'SimpleGoal-v0'").set_index("policy")
    assert (f"{says['reruns_failing']:.1%}", says["reruns"]) == ("7.5%", 20)
    assert says["reruns_refitted_failing"] == rows.loc["same cells, least squares", "failing"]
    assert [says[f"{name}_failures"] for name in ("one_map", "paper", "teacher")] == [52, 44, 0]
    assert [f"{says[f'proved_{name}']:.{n}%}" for name, n in (("paper", 4), ("margin", 5))] == ["10.8744%", "0.00026%"]


def test_the_end_can_be_won_by_one_drag_and_the_sliver_is_where_the_text_says():
    policies, inside = data.policies(), np.reshape(data.proofs()["margin"]["at"], (1, 2))
    first, repaired = policies["misplaced"], 0
    moved, about = first.codewords.copy(), {"task": TASK, "metric": "euclidean", "scale": first.scale}
    for moved[2] in np.random.default_rng(0).uniform(size=(100, 2)):
        repaired += data.played(VoronoiPolicy(moved, first.coefficients, **about))["failures"] == 0
    assert data.played(first)["failures"] == 52 and repaired > 5  # some 12 % of all places
    step, _ = policies["margin"].predict(inside)
    assert policies["margin"].cells(inside) == [0] and step.tolist() == [[-1, 1]]
    assert inside[0, 0] > 0.5 > inside[0, 1]  # right of the middle and below it
    assert policies["margin"].predict([[0.502, 0.498]])[0].tolist() == [[1, -1]]  # across the border


def test_a_refitted_run_fails_from_fewer_starts(parts):
    says, refitted = parts["scene"]["says"], data.repaired()["run_refitted"]
    played = [data.played(each)["failures"] for each in (data.policies()["run"], refitted)]
    assert played == [says["run_failures"], says["run_refitted_failures"]] == [19, 3]


def test_network_and_run_are_whole(parts):
    run, scene = parts["run"], parts["scene"]
    assert run["failures"][-1] == scene["says"]["run_failures"] == 19 and max(run["failures"]) > 390
    assert len(floats(parts["teacher"]["weights"])) == scene["says"]["weights"]
    last = floats(run["coefficients"])[-6 * run["cells"][-1] :].reshape(-1, 3, 2)
    assert np.allclose(last, scene["policies"]["run"]["coefficients"], rtol=1e-6)


def test_pictures_are_small_and_described():
    made = stills.stills()
    assert len(made) == 8 and all(len(png) < 60_000 and len(alt) > 100 for png, alt in made.values())
    assert "19 of 400" in made["fails"][1]
