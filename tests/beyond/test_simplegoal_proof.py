import copy
import hashlib
import importlib
import json
import re
import runpy
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

import vsp
import vsp_beyond
from studies import comparison, make_proofs
from studies.results import read_results, write_results
from vsp.run import sealed
from vsp.run.atomic import ROOT
from vsp.tasks import GOAL, PIT, TRUNCATED
from vsp_beyond.proofs import check, largest_disturbance, load_certificate, proved, returns, steps_to_goal
from vsp_beyond.proofs.polygons import box, line_of, meet, total
from vsp_beyond.proofs.proof import CERTIFICATES
from vsp_beyond.proofs.simplegoal import follow
from vsp_beyond.proofs.simplegoal_proof import ENDS, SimpleGoalProof

HALF, ONE = Fraction(1, 2), Fraction(1)


def policy_of(codewords, maps, **more):
    return vsp.VoronoiPolicy(np.array(codewords, float), np.array(maps, float), task=SIMPLEGOAL, **more)


STRAIGHT = policy_of([[0.5, 0.5]], [[[0, 0], [0, 0], [-1, -1]]])  # left and down at full speed
# Beyond the other diagonal to the left, below it down and left
MAPS = [[[0, 0], [0, 0], [-1, -1]], [[0, 0], [0, 0], [-1, 0]]]
TWO = policy_of([[0.25, 0.25], [0.75, 0.75]], MAPS, metric="euclidean")


@st.composite
def policies(draw):
    """Small ones, with numbers of few digits, so that ties, equal maps and empty cells do occur."""
    tenth = st.integers(-12, 22).map(lambda n: n / 10)
    k = draw(st.integers(1, 5))
    codewords = draw(st.lists(st.tuples(tenth, tenth), min_size=k, max_size=k, unique=True))
    number = st.integers(-12, 12).map(lambda n: n / 10)
    maps = draw(st.lists(st.tuples(*[st.tuples(number, number)] * 3), min_size=k, max_size=k))
    scale = draw(st.sampled_from([(1.0, 1.0), (0.5, 2.0)]))
    metric = draw(st.sampled_from(["euclidean", "manhattan"]))
    return policy_of(codewords, np.array(maps) - [[0.5, 0.5], [0.5, 0.5], [1, 1]], metric=metric, scale=np.array(scale))


WANDERING = settings(max_examples=5, deadline=None, suppress_health_check=list(HealthCheck))


def followed(policy):
    """Its pieces, if there are few: policies that wander cut the square ever finer."""
    try:
        return follow(policy, most=300)
    except ValueError:
        reject()


# Polygons


def test_a_square_is_cut_by_hand():
    square = box((0 * ONE, ONE), (0 * ONE, ONE))
    line = line_of((ONE, ONE, Fraction(-1, 2)))  # x + y = 1/2
    low, high = square.cut(line)
    assert (low.area(), high.area()) == (Fraction(1, 8), Fraction(7, 8))
    assert sorted(low.points()) == [(0, 0), (0, HALF), (HALF, 0)] and len(high.corners) == 5


def test_a_line_through_corners_adds_none():
    low, high = box((0 * ONE, ONE), (0 * ONE, ONE)).cut((1, -1, 0))
    assert len(low.corners) == len(high.corners) == 3 and low.area() == high.area() == HALF


def test_a_line_beside_the_square_or_along_its_edge_leaves_it_whole():
    square = box((0 * ONE, ONE), (0 * ONE, ONE))
    assert square.cut((1, 0, 0)) == (None, square) and square.cut((1, 0, -1)) == (square, None)
    assert square.cut((0, 0, 3)) == (None, square)
    with pytest.raises(ValueError, match="0 = 0"):
        square.cut((0, 0, 0))


def test_lines_meet_and_are_in_smallest_integers():
    assert line_of((HALF, Fraction(1, 3), -ONE)) == (3, 2, -6)
    x, y, w = meet((1, 0, -2), (0, 3, -1))
    assert (Fraction(x, w), Fraction(y, w)) == (2, Fraction(1, 3)) and w > 0


@given(st.lists(st.tuples(*[st.integers(-9, 9)] * 3).filter(any), max_size=6))
def test_parts_add_up_to_the_whole(lines):
    parts = [box((0 * ONE, ONE), (0 * ONE, ONE))]
    for line in lines:
        parts = [half for part in parts for half in part.cut(line) if half]
    assert total([part.area() for part in parts]) == 1 and all(part.area() > 0 for part in parts)


# The closed loop


def test_the_areas_by_hand():
    proof = vsp_beyond.prove(STRAIGHT)
    # After k steps the pit holds the starts of a square of 1/5 that lies k/10 further up the diagonal. Four of these
    # are within the square of starts; each overlaps with the next in a square of 1/10
    assert proof.areas == {"goal": Fraction(87, 100), "pit": 4 * Fraction(4, 100) - 3 * Fraction(1, 100), "left": 0}
    assert proof.longest == 9


def test_a_policy_that_stands_still_gets_nowhere():
    proof = vsp_beyond.prove(policy_of([[0.5, 0.5]], np.zeros((1, 3, 2))))
    # What starts in the goal or in the pit is there after a step: 1/100 and 1/25
    assert proof.areas == {"goal": Fraction(1, 100), "pit": Fraction(1, 25), "left": Fraction(95, 100)}
    assert proof.longest == 50


def test_a_tie_over_an_area_goes_to_the_lowest_cell():
    codewords = [[0.25, 0.25], [0.75, 0.75]]  # |Δx| = |Δy|: two corners tie
    maps = [[[0, 0], [0, 0], [-1, -1]], [[0, 0], [0, 0], [0, 0]]]
    cells = dict.fromkeys((0, 1), 0)
    for piece in follow(policy_of(codewords, maps, metric="manhattan")):
        cells[piece.steps[0].cell] += piece.starts.area()
    assert cells == {0: Fraction(9, 16), 1: Fraction(7, 16)}  # the two corners in which both tie are 1/16 each


ASKEW = [  # three maps that turn the way to the goal a little
    [[-0.9, 0.2], [0.1, -0.8], [-0.4, -0.3]], [[-1.1, 0], [-0.2, -0.7], [-0.3, -0.5]],
    [[-0.6, 0.3], [0.2, -1], [-0.5, -0.2]],
]  # fmt: skip
POLICIES = {  # in Manhattan distance a tie covers two corners of the first
    "two": ([[0.25, 0.25], [0.75, 0.75]], MAPS, (1.0, 1.0)),
    "three": ([[0.2, 0.3], [0.7, 0.4], [0.5, 0.8]], ASKEW, (0.5, 2.0)),
}


@pytest.mark.parametrize("metric", ["euclidean", "manhattan"])
@pytest.mark.parametrize("name", POLICIES)
def test_pieces_do_what_the_program_does(name, metric):
    """Of 5000 starts none contradicts its piece, but where an episode passes what decides so closely that rounding may
    decide."""
    codewords, maps, scale = POLICIES[name]
    policy = policy_of(codewords, maps, metric=metric, scale=np.array(scale))
    pieces = follow(policy, most=1000)
    assert total([piece.starts.area() for piece in pieces]) == 1
    certificate = SimpleGoalProof(policy, tuple(pieces)).certificate()
    assert check.check_content(certificate) == certificate["claim"]
    starts = np.random.default_rng(0).uniform(size=(5000, 2))
    found, close = vsp.rollout(policy, SIMPLEGOAL, starts), closest(policy, starts) < 1e-4
    n_found = np.zeros(len(starts), dtype=int)
    for piece in pieces:
        if piece.starts.area() < 1e-20:  # its corners are one point in float64
            continue
        corners = np.array(piece.starts.points(), dtype=float)
        along, to = np.roll(corners, -1, axis=0) - corners, starts[:, None] - corners
        inside = (along[:, 0] * to[..., 1] >= along[:, 1] * to[..., 0]).all(axis=1)
        n_found += inside
        agree = (found.outcomes == piece.outcome) & (found.lengths == len(piece.steps))
        assert (agree | close)[inside].all()
    assert (n_found == 1).mean() > 0.999 and close.mean() < 0.5


def closest(policy, starts):
    """How closely the episodes from `starts` (n, 2) pass what decides: another codeword as near, or an edge of goal and
    pit. (n,)"""
    states, found, going = starts.copy(), np.full(len(starts), np.inf), np.ones(len(starts), dtype=bool)
    power = 1 if policy.metric == "manhattan" else 2
    for _ in range(50):
        off = np.abs(states[:, None] - policy.codewords) / policy.scale
        distances = np.sort((off**power).sum(axis=-1), axis=1)
        gap = distances[:, 1] - distances[:, 0] if len(policy) > 1 else np.inf
        states = vsp.get_task(SIMPLEGOAL).step(states, policy.predict(states)[0])[0]
        edges = np.abs(states[..., None] - [0.1, 0.4, 0.6]).min(axis=(1, 2))
        found[going] = np.minimum(found, np.minimum(gap, edges))[going]
        going &= ~((states < 0.1).all(axis=1) | ((states > 0.4) & (states < 0.6)).all(axis=1))
    return found


def test_returns_are_those_of_the_pieces():
    proof = vsp_beyond.prove(TWO)
    low, high = returns.mean_return(proof.pieces, width=1e-4)
    starts = np.random.default_rng(1).uniform(size=(200_000, 2))
    sampled = vsp.rollout(TWO, SIMPLEGOAL, starts).returns
    assert 0 <= high - low <= 1.1e-4 and abs(sampled.mean() - low) < 5 * sampled.std() / np.sqrt(len(sampled))
    start, worst = proof.worst_start()
    assert worst <= sampled.min() + 1e-6 and abs(vsp.rollout(TWO, SIMPLEGOAL, start[None]).returns[0] - worst) < 1e-6


def test_the_mean_distance_from_the_origin():
    still = follow(policy_of([[0.5, 0.5]], np.zeros((1, 3, 2))))
    low, high = returns.mean_return(still, width=1e-4)
    assert low <= 10 * 0.01 - 10 * 0.04 <= high


@pytest.mark.parametrize(
    ("policy", "match"),
    [(vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 1)), task=MOUNTAINCAR), "need their own proof"),
     (policy_of([[0, 0]], np.zeros((1, 3, 2)), metric="chebyshev"), "metric 'chebyshev'"),
     ("a name", "expected a VoronoiPolicy")],
)  # fmt: skip
def test_other_policies_get_one_clear_error(policy, match):
    for refuses in (follow, steps_to_goal):
        with pytest.raises(ValueError, match=match):
            refuses(policy)


# Over a grid


def test_boxes_agree_with_pieces():
    steps = steps_to_goal(TWO, n=100)
    assert 0 < (steps > 0).mean() <= vsp_beyond.prove(TWO).areas["goal"]
    starts = np.random.default_rng(2).uniform(size=(20_000, 2))
    found, own = vsp.rollout(TWO, SIMPLEGOAL, starts), steps[tuple((starts * 100).astype(int).T)]
    assert (found.outcomes[own > 0] == GOAL).all() and (found.lengths[own > 0] <= own[own > 0]).all()


def test_the_largest_disturbance_is_smaller_than_what_breaks_it():
    around = policy_of([[0.2, 0.5], [0.8, 0.5]], [[[0, 0], [0, 0], [-1, -1]], [[0, 0], [0, 0], [0, -1]]])
    assert not proved(steps_to_goal(around, n=50)) and np.isnan(largest_disturbance(around, n=50))
    calm = vsp.VoronoiPolicy.load(comparison.RESULTS / f"faithful_{SIMPLEGOAL}.policy")
    assert proved(steps_to_goal(calm, n=300)) and not proved(steps_to_goal(calm, disturbance=0.05, n=300))


@settings(max_examples=12, deadline=None)
@given(policies(), st.integers(0, 2**31))
def test_what_boxes_prove_no_disturbance_breaks(policy, seed):
    """A constant push of the state: signs that change would hide behind the rounding of the boxes."""
    steps, rng = steps_to_goal(policy, disturbance=0.03, n=60), np.random.default_rng(seed)
    state = rng.uniform(size=(2000, 2))
    left, push = steps[tuple((state * 60).astype(int).clip(max=59).T)], rng.choice([-0.03, 0.03], size=(2000, 2))
    state, push, left = state[left > 0], push[left > 0], left[left > 0]
    alive = np.ones(len(state), bool)
    for t in range(50):
        state = np.clip(state + 0.1 * policy.predict(state.astype(np.float32))[0] + push, 0, 1)
        assert not (alive & ((state > 0.4) & (state < 0.6)).all(axis=1)).any()
        alive &= ~(state < 0.1).all(axis=1)
        assert not (alive & (left <= t + 1)).any()


# The certificate, and a checker that shares no code with the prover


@pytest.fixture(scope="module")
def certificate():
    return vsp_beyond.prove(TWO).certificate()


def test_a_certificate_is_written_sealed_and_checked(tmp_path, certificate):
    vsp_beyond.prove(TWO).save(path := tmp_path / "two.json")
    assert json.loads(sealed.read_sealed(path)) == certificate and check.check(path) == certificate["claim"]
    path.write_bytes(path.read_bytes().replace(b"goal", b"goat", 1))
    with pytest.raises(check.Refused, match="checksum"):
        check.check(path)


@WANDERING
@given(policies())
def test_the_checker_finds_the_same_areas(policy):
    certificate = SimpleGoalProof(policy, tuple(followed(policy))).certificate()
    assert check.check_content(certificate) == certificate["claim"]


def mutants(content, n, rng):
    """Certificates whose claim is false, or whose pieces do not prove it."""
    for kind in rng.choice(["drop", "end", "step", "swap", "area", "longest", "policy"], size=n):
        mutant = copy.deepcopy(content)
        pieces, claim = mutant["pieces"], mutant["claim"]
        i, j = rng.choice(len(pieces), size=2, replace=False)
        end, *steps = pieces[i].split(" ")
        at = rng.integers(len(steps))
        if kind == "drop":
            del pieces[i]
        elif kind == "end":
            pieces[i] = " ".join([rng.choice([name for name in ENDS.values() if name != end]), *steps])
        elif kind == "step":
            other = steps[at][:-4] + "".join(rng.choice(list("-=+"), size=4))
            pieces[i] = " ".join([end, *steps[:at], other if other != steps[at] else "1====", *steps[at + 1 :]])
        elif kind == "swap":
            pieces[i], pieces[j] = pieces[i] + " " + steps[0], pieces[j][:-6]
        elif kind == "area":
            gain = Fraction(1, int(rng.integers(2, 10**9)))
            claim["goal"], claim["pit"] = str(Fraction(claim["goal"]) + gain), str(Fraction(claim["pit"]) - gain)
        elif kind == "longest":
            claim["longest"] -= 1
        else:
            mutant["policy"]["coefficients"][0][2][0] += 0.3
        yield kind, mutant


def test_the_checker_refuses_every_mutant(certificate):
    for kind, mutant in mutants(certificate, 25, np.random.default_rng(3)):
        with pytest.raises(check.Refused):
            check.check_content(mutant)
            pytest.fail(f"accepted a mutant: {kind}")


@pytest.mark.parametrize(
    ("alter", "match"),
    [(lambda c: c["pieces"].append(c["pieces"][0].replace(" 0", " 00", 1)), "expected one in a cell from 0 to 1"),
     (lambda c: c["pieces"].__setitem__(0, c["pieces"][0] + " 0====" * 60), "cover"),
     (lambda c: c["policy"]["codewords"][0].__setitem__(0, float("nan")), "not finite"),
     (lambda c: c["policy"]["scale"].__setitem__(0, 0.0), "not positive"),
     (lambda c: c["policy"].update(metric="cosine"), "'cosine'"),
     (lambda c: c["policy"]["coefficients"].__setitem__(0, []), "malformed"),
     (lambda c: c["claim"].pop("goal"), "the claim is")],
)  # fmt: skip
def test_a_forged_certificate_gets_one_clear_refusal(certificate, alter, match):
    alter(forged := copy.deepcopy(certificate))
    with pytest.raises(check.Refused, match=match):
        check.check_content(forged)


def test_the_checker_shares_no_code_with_the_prover():
    own = {"json", "math", "random", "struct", "hashlib", "numpy", "fractions", "functools", "sys", "__future__"}
    for path in Path(check.__file__).parent.glob("*.py"):
        imported = re.findall(r"^(?:from|import) (\S+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(imported) <= own | {".", ".refused", ".certificates"}, path


def test_outcomes_have_names():
    assert set(ENDS) == {GOAL, PIT, TRUNCATED}


# The committed certificates


LARGE = ("simplegoal_best_run", "simplegoal_limit", "simplegoal_margin", "simplegoal_paper")  # checked in tests/long


@pytest.mark.parametrize("path", sorted(CERTIFICATES.glob("*.json")), ids=lambda path: path.stem)
def test_committed_certificates_prove_what_the_table_says(path):
    claim = json.loads(sealed.read_sealed(path))["claim"] if path.stem in LARGE else check.check(path)
    row = read_results("proofs").set_index("name").loc[path.stem]
    assert row["longest"] == claim["longest"] and path.stat().st_size < 2e6
    for name in ("goal", "pit", "left"):
        if name in claim:
            assert row[name] == pytest.approx(float(Fraction(claim[name])), rel=1e-9)
            error = np.sqrt(row[name] * (1 - row[name]) / row["sampled"])
            assert abs(row[f"sampled_{name}"] - row[name]) < 5 * error + 2e-6
    for name in ("least", "mean_low", "mean_high"):
        if name in claim:
            assert row[name] == pytest.approx(claim[name], abs=1e-6)


def test_certificates_are_of_the_kept_policies():
    for name in ("simplegoal_faithful", "simplegoal_limit", "mountaincar_limit", "pendulum_faithful"):
        policy = load_certificate(name)[0]
        kept = vsp.VoronoiPolicy.load(comparison.RESULTS / f"{name.split('_')[1]}_{policy.task.name}.policy")
        for part in ("codewords", "coefficients", "scale"):
            assert np.array_equal(getattr(policy, part), getattr(kept, part))


def test_policies_with_the_theorem():
    """From every start outside the pit the program reaches the goal."""
    rows = read_results("proofs").set_index("name")
    certain = rows.index[rows["program"] == 1.0]
    assert {"simplegoal_tuned", "simplegoal_faithful", "simplegoal_margin"} <= set(certain)
    assert (rows.loc[certain, "failing_outside"] == 0).all()
    steps = steps_to_goal(load_certificate("simplegoal_tuned")[0])
    assert proved(steps) and steps.max() == rows.loc["simplegoal_tuned", "program_steps"]


# The commands


def seal(path, payload):
    path.write_bytes(hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload)
    return path


@pytest.mark.parametrize("payload", [b"no JSON", b"[]", b"{}", b'{"task": []}', b'"SimpleGoal-v0"', b"[" * 10**6])
def test_a_sealed_file_that_is_no_certificate_is_refused(tmp_path, payload):
    with pytest.raises(check.Refused):
        check.check(seal(tmp_path / "x.json", payload))


def test_the_command_prints_what_is_proved_or_says_in_one_line_why_not(tmp_path, monkeypatch, capsys):
    def run(*paths):
        monkeypatch.setattr("sys.argv", ["check", *map(str, paths)])
        runpy.run_module("vsp_beyond.proofs.check", run_name="__main__")

    run(good := ROOT / "data/beyond/proofs/simplegoal_one_map.json")
    assert capsys.readouterr().out.startswith(f"{good} proves {{'goal': ")
    for paths in ((), (tmp_path / "none.json",), (good, seal(tmp_path / "x.json", b"[]"))):
        with pytest.raises(SystemExit) as end:
            run(*paths)
        assert end.value.code and "\n" not in str(end.value.code)


def test_missing_proofs_are_made_and_others_are_not(tmp_path, monkeypatch):
    made, folder = [], tmp_path / "data" / "beyond"
    makers = {name: lambda name=name, one=one: made.append(name) or one for name, one in (("a", STRAIGHT), ("b", TWO))}
    monkeypatch.setattr(make_proofs, "policies", lambda: makers)
    monkeypatch.setattr(make_proofs, "N_SAMPLED", 2000)
    monkeypatch.setattr(make_proofs, "_of_simplegoal_proof", lambda proof: {"goal": float(proof.areas["goal"])})
    assert make_proofs.certificates(tmp_path, 1) == made == ["a", "b"]
    first = read_results("proofs", folder)
    row = first.set_index("name").loc["a"]
    assert (row["goal"], row["longest"], row["sampled"]) == (0.87, 9, 2000)
    assert row["sampled_goal"] == pytest.approx(0.87, abs=0.03)
    assert row["bytes"] == (folder / "proofs" / "a.json").stat().st_size
    assert check.check(folder / "proofs" / "b.json")["longest"] == first["longest"][1]
    assert make_proofs.certificates(tmp_path, 1) == [] and made == ["a", "b"]
    write_results(first[:1], "proofs", out=tmp_path)  # as somebody who deletes a row
    assert make_proofs.certificates(tmp_path, 1) == ["b"] and made == ["a", "b", "b"]
    assert read_results("proofs", folder)["name"].tolist() == ["a", "b"]


# `prove`


@pytest.mark.parametrize(
    ("policy", "match"),
    [("a name", "the policy is 'a name', expected a VoronoiPolicy"),
     (vsp.VoronoiPolicy(np.zeros((1, 8)), np.zeros((1, 9, 2)), task=LUNARLANDER), "is for Lunar.*, expected one of")],
)  # fmt: skip
def test_prove_refuses_what_it_has_no_proof_for(policy, match):
    with pytest.raises(ValueError, match=match):
        vsp_beyond.prove(policy)


PROVERS = {SIMPLEGOAL: "prove_simplegoal", MOUNTAINCAR: "prove_mountaincar", PENDULUM: "prove_pendulum"}


@pytest.mark.parametrize("task", PROVERS)
def test_prove_asks_the_prover_of_the_task(monkeypatch, task):
    module = importlib.import_module("vsp_beyond.proofs.prove")
    d, m = len(vsp.get_task(task).low), len(vsp.get_task(task).action_low)
    policy = vsp.VoronoiPolicy(np.zeros((1, d)), np.zeros((1, d + 1, m)), task=task)
    assert module.PROVERS[task].__name__ == PROVERS[task]
    monkeypatch.setitem(module.PROVERS, task, lambda given: ("proved", given))
    assert vsp_beyond.prove(policy) == ("proved", policy)
