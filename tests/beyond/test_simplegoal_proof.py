import copy
import functools
import hashlib
import json
import re
import runpy
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from support import LUNARLANDER, MOUNTAINCAR, SIMPLEGOAL, called

import vsp
import vsp_beyond
from studies import comparison
from vsp.run import sealed
from vsp_beyond.proofs import check, largest_disturbance, load_certificate, proved, robust, steps_to_goal
from vsp_beyond.proofs.grid import touches
from vsp_beyond.proofs.polygons import box, line_of
from vsp_beyond.proofs.proof import CERTIFICATES, RESULTS
from vsp_beyond.proofs.simplegoal import follow
from vsp_beyond.proofs.simplegoal_proof import ENDS, SimpleGoalProof

HALF, ONE = Fraction(1, 2), Fraction(1)
SQUARE = box((0 * ONE, ONE), (0 * ONE, ONE))


def policy_of(codewords, coefficients, **more):
    return vsp.VoronoiPolicy(np.array(codewords, float), np.array(coefficients, float), task=SIMPLEGOAL, **more)


DOWN_LEFT, LEFT, STILL = ([[0, 0], [0, 0], action] for action in ([-1, -1], [-1, 0], [0, 0]))
CORNERS = [[0.25, 0.25], [0.75, 0.75]]  # in Manhattan distance, a tie covers the two other corners
TWO = policy_of(CORNERS, [DOWN_LEFT, LEFT], metric="euclidean")


@st.composite
def policies(draw):
    """Small ones, with numbers of few digits, so that ties, equal maps and empty cells do occur."""
    tenth, number = (st.integers(low, high).map(lambda n: n / 10) for low, high in ((-12, 22), (-12, 12)))
    k = draw(st.integers(1, 5))
    codewords = draw(st.lists(st.tuples(tenth, tenth), min_size=k, max_size=k, unique=True))
    coefficients = draw(st.lists(st.tuples(*[st.tuples(number, number)] * 3), min_size=k, max_size=k))
    scale, metric = draw(st.sampled_from([(1.0, 1.0), (0.5, 2.0)])), draw(st.sampled_from(["euclidean", "manhattan"]))
    shifted = np.array(coefficients) - [[0.5, 0.5], [0.5, 0.5], [1, 1]]
    return policy_of(codewords, shifted, metric=metric, scale=np.array(scale))


# Polygons


def test_a_line_beside_the_square_or_along_its_edge_leaves_it_whole_and_lines_are_in_smallest_integers():
    assert line_of((HALF, Fraction(1, 3), -ONE)) == (3, 2, -6)
    assert SQUARE.cut((1, 0, 0)) == SQUARE.cut((0, 0, 3)) == (None, SQUARE) and SQUARE.cut((1, 0, -1)) == (SQUARE, None)


# The closed loop


@pytest.mark.parametrize(
    ("action", "goal", "pit", "outside", "longest"),
    # After k steps the pit holds the starts of a square of 1/5 that lies k/10 further up the diagonal. Four of these
    # are within the square of starts; each overlaps with the next, and the first with the pit, in a square of 1/10
    [(DOWN_LEFT, Fraction(87, 100), 4 * Fraction(4, 100) - 3 * Fraction(1, 100), Fraction(12, 100), 9),
     (STILL, Fraction(1, 100), Fraction(1, 25), Fraction(95, 100), 50)],  # what starts in goal or pit ends there
)  # fmt: skip
def test_the_areas_by_hand(action, goal, pit, outside, longest):
    proof = vsp_beyond.prove(policy_of([[0.5, 0.5]], [action]))
    assert proof.areas == {"goal": goal, "pit": pit, "left": 1 - goal - pit}
    assert proof.claim["longest"] == longest and proof.failing_outside == outside
    shares = ", ".join(f"{name} {float(area):.6g}" for name, area in proof.areas.items())
    assert str(proof) == f"SimpleGoal-v0, cells: 1, proved: {shares}, longest {longest}"
    assert all(len(corners) > 2 for corners in proof.polygons()) and len(proof.polygons()) == len(proof.pieces)
    with pytest.raises(ValueError, match=f"expected at most {len(proof.pieces) - 1}$"):
        follow(proof.policy, most=len(proof.pieces) - 1)


def test_a_tie_over_an_area_goes_to_the_lowest_cell():
    cells = dict.fromkeys((0, 1), 0)
    for piece in follow(policy_of(CORNERS, [DOWN_LEFT, STILL], metric="manhattan")):
        cells[piece.steps[0].cell] += piece.starts.area()
    assert cells == {0: Fraction(9, 16), 1: Fraction(7, 16)}  # the two corners in which both tie are 1/16 each


@pytest.mark.parametrize(
    ("policy", "match"),
    [(vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 1)), task=MOUNTAINCAR), "expected a VoronoiPolicy for SimpleGoal"),
     (policy_of([[0, 0]], np.zeros((1, 3, 2)), metric="chebyshev"), "metric is 'chebyshev'"),
     ("a name", "expected a VoronoiPolicy")],
)  # fmt: skip
def test_other_policies_get_one_clear_error(policy, match):
    for refuses in (follow, steps_to_goal):
        with pytest.raises(ValueError, match=match):
            refuses(policy)
    with pytest.raises(ValueError, match="the policy is .*, expected a VoronoiPolicy for one of"):
        vsp_beyond.prove(vsp.VoronoiPolicy(np.zeros((1, 8)), np.zeros((1, 9, 2)), task=LUNARLANDER))


# Over a grid


def test_rounding_never_decides_what_boxes_prove(monkeypatch):
    """On a border both cells act; what float32 hides widens a way; a box at the edge of the goal is not yet in it."""
    point = np.array([[0.5], [0.5]])
    two = policy_of([[0.25, 0.5], [0.75, 0.5]], [STILL, STILL])
    assert all(touches(two, cell, point, point, np.ones(2)).all() for cell in (0, 1))
    policy, edges = policy_of([[0.5, 0.5]], [[[-0.5, 0], [0, -0.5], [0, 0]]]), np.linspace(0, 1, 101)
    low, high = (np.stack(np.meshgrid(ends, ends, indexing="ij")).reshape(2, -1) for ends in (edges[:-1], edges[1:]))
    first = robust._way(policy, 0, low, high, 0.0, 100).first
    monkeypatch.setattr(robust, "SEEN", 0.9)
    assert (first - robust._way(policy, 0, low, high, 0.0, 100).first).max() >= 4
    monkeypatch.undo()
    assert not steps_to_goal(policy_of([[0.5, 0.5]], [DOWN_LEFT]), n=10).any()


def test_the_largest_disturbance_is_smaller_than_what_breaks_it():
    around = policy_of([[0.2, 0.5], [0.8, 0.5]], [DOWN_LEFT, [[0, 0], [0, 0], [0, -1]]])
    assert not proved(steps_to_goal(around, n=50)) and np.isnan(largest_disturbance(around, n=50))
    calm = vsp.VoronoiPolicy.load(comparison.RESULTS / f"faithful_{SIMPLEGOAL}.policy")
    largest = largest_disturbance(calm, n=300)
    assert proved(steps_to_goal(calm, disturbance=largest, n=300)) and largest < 0.05
    assert not proved(steps_to_goal(calm, disturbance=largest + 5e-4, n=300))


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


@settings(max_examples=5, deadline=None, suppress_health_check=list(HealthCheck))
@given(policies())
def test_the_checker_finds_the_same_areas(policy):
    try:
        certificate = SimpleGoalProof(policy, tuple(follow(policy, most=100))).certificate()
    except ValueError:  # policies that wander cut the square ever finer
        reject()
    assert check.check_content(certificate) == certificate["claim"]


def mutants(content, rng):
    """Certificates whose claim is false, or whose pieces do not prove it."""
    for kind in 2 * ["drop", "end", "step", "swap", "area", "longest", "policy"]:
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


def refuse(mutants):
    """The checker must refuse each of these (kind, certificate)."""
    for kind, mutant in mutants:
        with pytest.raises(check.Refused):
            check.check_content(mutant)
            pytest.fail(f"accepted a mutant: {kind}")


def test_the_checker_refuses_every_mutant(certificate):
    refuse(mutants(certificate, np.random.default_rng(3)))


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


def test_a_sign_that_rounding_may_decide_is_exact():
    tenth, fifth, three_tenths = (Fraction(i, 10) for i in (1, 2, 3))
    corner = check.simplegoal.corner((tenth, fifth), (tenth, fifth))
    assert check.simplegoal.Form(ONE, ONE, -three_tenths).signs([corner]) == [0]


def test_the_checker_shares_no_code_with_the_prover():
    shared = {"json", "math", "random", "struct", "hashlib", "numpy", "fractions", "functools", "sys", "__future__"}
    for path in Path(check.__file__).parent.glob("*.py"):
        imported = re.findall(r"^(?:from|import) (\S+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(imported) <= shared | {".", ".refused", ".certificates"}, path


# The committed certificates


LARGE = [f"simplegoal_{name}" for name in ("best_run", "faithful", "limit", "margin", "paper")]  # checked in tests/long
LARGE += ["pendulum_faithful"]


@pytest.mark.parametrize("path", sorted(CERTIFICATES.glob("*.json")), ids=lambda path: path.stem)
def test_committed_certificates_prove_what_the_table_says(path):
    claim = json.loads(sealed.read_sealed(path))["claim"] if path.stem in LARGE else check.check(path)
    row = vsp.paper.results.read_results("proofs", RESULTS).set_index("name").loc[path.stem]
    assert row["longest"] == claim["longest"] and path.stat().st_size < 2e6
    for name in {"goal", "pit", "left"} & set(claim):
        assert row[name] == pytest.approx(float(Fraction(claim[name])), rel=1e-9)
        error = np.sqrt(row[name] * (1 - row[name]) / row["sampled"])
        assert abs(row[f"sampled_{name}"] - row[name]) < 5 * error + 2e-6
    for name in {"least", "mean_low", "mean_high"} & set(claim):
        assert row[name] == pytest.approx(claim[name], abs=1e-6)


def test_certificates_are_of_the_kept_policies():
    for name in ("simplegoal_faithful", "simplegoal_limit", "mountaincar_limit", "pendulum_faithful"):
        policy = load_certificate(name)[0]
        kept = vsp.VoronoiPolicy.load(comparison.RESULTS / f"{name.split('_')[1]}_{policy.task.name}.policy")
        for part in ("codewords", "coefficients", "scale"):
            assert np.array_equal(getattr(policy, part), getattr(kept, part))


def test_policies_with_the_theorem():
    """From every start outside the pit the program reaches the goal."""
    rows = vsp.paper.results.read_results("proofs", RESULTS).set_index("name")
    certain = rows.index[rows["program"] == 1.0]
    assert {"simplegoal_tuned", "simplegoal_faithful", "simplegoal_margin"} <= set(certain)
    assert (rows.loc[certain, "failing_outside"] == 0).all()
    steps = steps_to_goal(load_certificate("simplegoal_tuned")[0])
    assert proved(steps) and steps.max() == rows.loc["simplegoal_tuned", "program_steps"]


# Files and the command

check_command = functools.partial(runpy.run_module, "vsp_beyond.proofs.check", run_name="__main__")


def seal(path, payload):
    path.write_bytes(hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload)
    return path


@pytest.mark.usefixtures("no_collection")
@pytest.mark.parametrize("payload", [b"no JSON", b'{"task": []}', b'{"task": "%s"}' % (b"x" * 9999), b"[" * 10**6])
def test_a_sealed_file_that_is_no_certificate_is_refused(tmp_path, payload):
    with pytest.raises(check.Refused) as refused:
        check.check(seal(tmp_path / "x.json", payload))
    assert len(str(refused.value)) < 1000


@pytest.mark.parametrize("name", ["simplegoal_simplified", "mountaincar_limit", "pendulum_faithful"])
@pytest.mark.parametrize("wrong", [None, [], "x", {"a": 1}, 10**400, [{"a": []}]], ids=str)
def test_a_certificate_with_wrong_types_is_refused(name, wrong):
    certificate = load_certificate(name)[1]
    policy = certificate["policy"]
    parts = [(where, part) for where in (certificate, policy) for part in where]
    for where, part in [*parts, (certificate["pieces"], 0), (policy["coefficients"][0], 0)]:
        kept, where[part] = where[part], wrong
        with pytest.raises(check.Refused) as refused:
            check.check_content(certificate)
        assert len(str(refused.value)) < 1000
        where[part] = kept


def test_the_command_prints_what_is_proved_or_says_in_one_line_why_not(tmp_path, capsys):
    vsp_beyond.prove(TWO).save(good := tmp_path / "two.json")
    called(check_command, good)
    assert capsys.readouterr().out.startswith(f"{good} proves {{'goal': ")
    (altered := tmp_path / "altered.json").write_bytes(good.read_bytes().replace(b"goal", b"goat", 1))
    for paths in ((), (tmp_path / "none.json",), (good, seal(tmp_path / "x.json", b"[]")), (altered,)):
        with pytest.raises(SystemExit) as end:
            called(check_command, *paths)
        assert end.value.code and "\n" not in str(end.value.code)
