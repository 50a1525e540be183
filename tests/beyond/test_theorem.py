"""The theorem that Coq checks is about this policy and this task."""

import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from vsp.tasks import GOAL, PIT, RUNNING, simplegoal
from vsp_beyond.proofs import theorem

POLICY = theorem.load_certificate(theorem.POLICY)[0]
ROOT = 2**60  # times this, states and the policy's numbers are whole
MEANING = Path(__file__).with_name("Meaning.v").read_text()
ACTS = "exists c, nth_error (cells the_policy) 0 = Some c /\\ {} may_act the_policy c {}"


def exact(states, cells, errors=0):
    """The statement's `moved` for states (n, 2): whole numbers (n, 2), in units of 1 / (10 ROOT²)."""
    x, maps = whole(states), whole(POLICY.coefficients)[cells]
    actions = x[:, :1] * maps[:, 0] + x[:, 1:] * maps[:, 1] + ROOT * maps[:, 2]
    return np.clip(10 * ROOT * x + np.clip(actions, -(ROOT**2), ROOT**2) + 10 * ROOT**2 * errors, 0, 10 * ROOT**2)


def whole(numbers):
    parts = [(Fraction(number) * ROOT).as_integer_ratio() for number in numbers.flat]
    assert all(denominator == 1 for _, denominator in parts)
    return np.array([numerator for numerator, _ in parts], dtype=object).reshape(numbers.shape)


def distances(state):
    """The statement's `distance` of one state from each codeword."""
    rows, scale = theorem.terms(POLICY), [Fraction(unit) for unit in POLICY.scale]
    return [sum(((Fraction(state[i]) - row[i]) / scale[i]) ** 2 for i in (0, 1)) for row in rows]


def height(gap, x=0.5):
    """The y at which the distance of cell 0 exceeds the least by `gap`; further down it does linearly."""
    low, high = (distances((x, y))[0] - min(distances((x, y))) for y in (0.125, 0.25))
    return Fraction(1, 8) + (low - gap) / (low - high) / 8


def coq(value):
    text = " ".join("({:#x} # {:#x})".format(*Fraction(number).as_integer_ratio()) for number in np.atleast_1d(value))
    return f"(State {text})" if np.ndim(value) else text


def starts(n):
    return np.random.default_rng(0).uniform(size=(n, 2))


def test_the_dynamics_of_the_statement_are_those_of_the_task():
    states, one = starts(100_000), 10 * ROOT**2
    cells = POLICY.cells(states)
    cells[::2] = np.arange(50_000) % len(POLICY)  # some of these lead into the pit
    actions = POLICY.policy_class.outputs(states, POLICY.coefficients[cells])
    assert (np.clip(actions, -1, 1)[1::2] == POLICY.predict(states)[0][1::2]).all()
    after, _, ended = simplegoal.step(states, actions)
    moved = exact(states, cells)
    assert np.abs((moved / one).astype(float) - after).max() < 1e-12
    goal, pit = (10 * moved < one).all(1), ((10 * moved > 4 * one) & (10 * moved < 6 * one)).all(1)
    assert (np.select([goal, pit], [GOAL, PIT], RUNNING) == ended).all() and set(ended) == {GOAL, PIT, RUNNING}
    assert ((after == 0) | (after == 1)).any(axis=0).all()  # walls stop some
    nearest = [np.argmin(distances(state)) for state in states[:2000]]
    assert (POLICY.cells(states[:2000]) == nearest).all() and len(set(nearest)) == len(POLICY)


@pytest.mark.skipif(shutil.which("coqc") is None, reason="no Coq")
def test_coq_computes_these_dynamics(tmp_path):
    states, size, cells = starts(200), theorem.ERROR, np.arange(200) % len(POLICY)  # also cells that are far
    errors = np.array([[size * (i % 5 - 2), -size * (i % 7 - 3)] for i in range(200)])
    moved = exact(states, cells, errors) / Fraction(10 * ROOT**2)
    rows = zip(states, moved, errors, cells)
    rows = [f"({coq(s)}, {coq(t)}, {coq(e)}, {c}%nat, {coq(distances(s)[c])})" for s, t, e, c in rows]
    text = f"{MEANING}Goal forallb right [{'; '.join(rows)}] = true. Proof. vm_cast_no_check (eq_refl true). Qed.\n"
    claims = {f"small {coq(error)}": abs(error) <= size for error in (size, -size, size * 1.01, -size * 1.01)}
    edges = [Fraction(k, 100) + d for k in (10, 40, 49, 51, 60) for d in (-Fraction(1, 2**70), 0, Fraction(1, 2**70))]
    for place in [*moved[:20], *(pair for e in edges for q in (0.05, 0.5) for pair in ((e, q), (q, e)))]:
        for name, low, high in ("in_goal", -1, 10), ("in_pit", 40, 60), ("deep_in_pit", 49, 51):
            claims[f"{name} {coq(place)}"] = all(low < 100 * Fraction(q) < high for q in place)
    text += "".join(f"Goal {'' if true else '~ '}{claim}. Proof. holds. Qed.\n" for claim, true in claims.items())
    for no, y, proof in ("", height(theorem.TIE), "may"), ("~", height(theorem.TIE) - Fraction(1, 2**70), "may_not"):
        text += f"Goal {ACTS.format(no, coq((0.5, y)))}. Proof. {proof}. Qed.\n"
    for name, content in (theorem.files(POLICY, np.array([[1]])) | {"Try": text}).items():
        (tmp_path / f"{name}.v").write_text(content)
    theorem.compiled(tmp_path, ["Statement", "Policy", "Try"])
    assert POLICY.task.max_steps == 50  # as in Meaning.v


def test_float64_steps_that_see_float32_are_steps_of_the_statement():
    error, tie = theorem.rounding(POLICY)
    assert error < theorem.ERROR and tie < theorem.TIE
    goal, low, high = (10 * Fraction(edge) for edge in (simplegoal.GOAL_EDGE, simplegoal.PIT_LOW, simplegoal.PIT_HIGH))
    assert goal >= 1 and low >= 4 and high <= 6  # so the program's goal is no smaller, its pit no larger
    seen = POLICY.task.observe(states := starts(100_000))
    assert seen.dtype == np.float32 and np.abs(seen - states).max() <= theorem.SEEN
    after, _, _ = simplegoal.step(states, POLICY.predict(seen)[0])
    gaps = np.abs((exact(states, POLICY.cells(seen)) / (10 * ROOT**2)).astype(float) - after)
    assert error / 3 < gaps.max() <= error
    states = (2 * starts(2000) - 1) * theorem.SEEN + [0.75, height(0, 0.75)]  # around a border
    cells = POLICY.cells(POLICY.task.observe(states.astype(float)))
    over = [distances(state)[cell] - min(distances(state)) for state, cell in zip(states.astype(float), cells)]
    assert tie / 2 < max(over) <= tie


def test_without_coq_one_line_says_what_to_install(tmp_path):
    call = [sys.executable, "-m", "vsp_beyond.proofs.theorem", tmp_path]
    done = subprocess.run(call, env={"PATH": str(tmp_path)}, capture_output=True, text=True)
    assert done.returncode == 1 and not list(tmp_path.iterdir())
    assert done.stderr == "error: no coqc found: install Coq 8.16 or newer, for instance with `apt-get install coq`\n"
