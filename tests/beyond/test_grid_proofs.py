"""Proofs over a grid, and those of Pendulum."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import PENDULUM, SIMPLEGOAL
from test_simplegoal_proof import refuse

import vsp
from studies import comparison
from vsp_beyond.proofs import check, pendulum, pendulum_starts, prove_pendulum
from vsp_beyond.proofs.grid import Way, around, steps_into
from vsp_beyond.proofs.pendulum_starts import Boxes, shares_of_starts, stepped

N = 400
STILL = vsp.VoronoiPolicy([[0.0, 0.0, 0.0]], np.zeros((1, 4, 1)), task=PENDULUM, metric="euclidean")


def way(boxes, first, last, safe=True):
    return Way(np.array(boxes), np.array(first).T, np.array(last).T, np.full(len(boxes), safe))


def test_steps_into_a_target_by_hand():
    target = np.zeros((2, 3), dtype=bool)
    target[0, 0] = True
    # 0 stays; 1 to 0; 2 to 0 or 1; 3 to 5; 4 to 1, by another way to 3; 5 to itself
    ways = [
        way([0, 1, 2, 3, 4, 5], [[0, 0], [0, 0], [0, 0], [1, 2], [0, 1], [1, 2]],
            [[1, 1], [1, 1], [1, 2], [2, 3], [1, 2], [2, 3]]),
        way([4], [[1, 0]], [[2, 1]]),
    ]  # fmt: skip
    assert steps_into(target, ways, 10).tolist() == [[1, 1, 2], [0, 0, 0]]
    assert steps_into(target, ways, 1).tolist() == [[1, 1, 0], [0, 0, 0]]
    assert steps_into(target, [ways[0]], 10).tolist() == [[1, 1, 2], [0, 2, 0]]
    assert not steps_into(target, [way([0, 1], [[0, 0], [0, 0]], [[1, 1], [1, 1]], safe=False), *ways], 10)[0, :2].any()


def test_an_angle_comes_round():
    target = np.array([[True], [False], [False]])
    ways = [way([0, 1, 2], [[0, 0], [2, 0], [2, 0]], [[1, 1], [4, 1], [3, 1]])]  # from 1 to 2 or, a turn on, 0
    assert steps_into(target, ways, 10, periodic=True).tolist() == [[1], [0], [0]]
    ways = [way([0, 1, 2], [[0, 0], [3, 0], [2, 0]], [[1, 1], [4, 1], [4, 1]])]
    assert steps_into(target, ways, 10, periodic=True).tolist() == [[1], [1], [0]]


def test_boxes_around_numbers():
    first, last = around(np.array([0.5, 1.0, -3.0, 2.9]), np.array([1.5, 1.0, -2.0, 9.0]), 3)
    assert first.tolist() == [0, 0, 0, 2] and last.tolist() == [2, 2, 1, 3]


# Pendulum


@pytest.fixture(scope="module")
def proof():
    return prove_pendulum(vsp.VoronoiPolicy.load(comparison.RESULTS / f"faithful_{PENDULUM}.policy"), n=N)


def boxes_of(states):
    angle, speed = (states[:, 0] + np.pi) % (2 * np.pi) / (2 * np.pi), (states[:, 1] + 8) / 16
    return tuple(np.clip((share * N).astype(int), 0, N - 1) for share in (angle, speed))


def stepped_by(policy, states):
    task = vsp.get_task(PENDULUM)
    return task.step(states, policy.predict(task.see(states).astype(np.float32))[0])[0]


def test_episodes_do_what_is_proved(proof):
    states = np.random.default_rng(0).uniform([-np.pi, -8.0], [np.pi, 8.0], size=(20_000, 2))
    states = states[proof.steps[boxes_of(states)] > 0]
    promised, arrived = proof.steps[boxes_of(states)], proof.kept[boxes_of(states)]
    assert len(states) > 10_000
    for t in range(1, 130):
        states = stepped_by(proof.policy, states)
        inside = proof.kept[boxes_of(states)]
        assert not (arrived & ~inside).any()  # it is never left
        arrived |= inside
        assert arrived[promised <= t].all()


def test_the_set_is_around_upright_and_most_starts_get_there(proof):
    angles = np.abs(np.pi * (2 * (np.arange(N) + 0.5) / N - 1))
    assert proof.kept[N // 2, N // 2] and not proof.kept[angles > 0.5].any()
    assert 0.6 < proof.share == proof.claim["proved"] / proof.claim["starts"] < 1.0


def test_without_a_torque_nothing_is_proved():
    """Nor by smaller boxes of starts."""
    proof = prove_pendulum(STILL, n=16)
    assert not proof.kept.any() and proof.claim["longest"] == 0
    assert check.check_content(proof.certificate()) == proof.claim
    assert shares_of_starts(proof) == [0.0] * 4


# Smaller boxes of starts


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.floats(1e-4, 0.05))
def test_a_step_of_small_boxes_holds_all_that_happens(seed, half):
    rng, m = np.random.default_rng(seed), 500
    policy = vsp.VoronoiPolicy([[0, 0, 0]], rng.normal(size=(1, 4, 1)) * [[4], [4], [2], [1]], task=PENDULUM)
    slopes, rest = rng.uniform(-half, half, size=(2, 2, m)), rng.uniform(0, half, size=(2, m))
    boxes = Boxes(np.arange(m), rng.uniform([[-4], [-8]], [[4], [8]], size=(2, m)), slopes, rest)
    after = stepped(policy, 0, boxes)
    for _ in range(20):
        along, off = rng.uniform(-1, 1, size=(2, m)), rng.uniform(-rest, rest)
        linear = boxes.centre + np.einsum("ijm,jm->im", slopes, along)
        states = np.clip(linear + off, [[-9], [-8]], [[9], [8]])
        inside = (np.abs(states - linear) <= rest).all(axis=0)
        gap = np.abs(stepped_by(policy, states.T).T - after.centre - np.einsum("ijm,jm->im", after.slopes, along))
        assert (gap <= after.rest)[:, inside].all()


def test_a_step_from_a_large_box_stays_within_its_bounds(monkeypatch):
    """From its corners, sides and middle."""
    rng, n, ends = np.random.default_rng(0), 16, []
    kept = lambda *given: ends.extend(given[:2]) or np.zeros((2, 2, n * n), dtype=int)  # noqa: E731
    monkeypatch.setattr(pendulum, "boxes_between", kept)
    policy = vsp.VoronoiPolicy([[0, 0, 0]], rng.normal(size=(1, 4, 1)) * [[4], [4], [2], [1]], task=PENDULUM)
    pendulum._way(policy, 0, n)
    box, at = rng.integers(n * n, size=100_000), rng.choice([0.0, 0.5, 1.0], size=(2, 100_000))
    states = [(2 * (box // n + at[0]) / n - 1) * np.pi, (2 * (box % n + at[1]) / n - 1) * 8]
    angle, speed = stepped_by(policy, np.stack(states, axis=1)).T
    (left, right), (low, high) = np.array(ends)[:, :, box]
    assert ((angle - left + 1e-9) % (2 * np.pi) <= right - left + 2e-9).all()
    assert ((low - 1e-9 <= speed) & (speed <= high + 1e-9)).all()


def test_small_boxes_prove_more_and_episodes_agree(proof, monkeypatch):
    monkeypatch.setattr(pendulum_starts, "LEVELS", 1)
    before, share = shares_of_starts(proof)
    assert before == proof.share and share > 0.98
    states = vsp.get_task(PENDULUM).start(np.random.default_rng(0), 5000)
    for _ in range(200):
        states = stepped_by(proof.policy, states)
    assert proof.kept[boxes_of(states)].mean() >= share - 0.001


# Certificates


def mutants(content, rng):
    """Certificates of Pendulum whose claim is false, or whose boxes do not prove it."""
    for kind in ("claim", "longest", "sooner", "proved", "kept", "policy", "row"):
        mutant = {**content, "claim": dict(content["claim"]), "pieces": [list(row) for row in content["pieces"]]}
        runs = [(i, j) for i, row in enumerate(mutant["pieces"]) for j in range(0, len(row), 2)]
        of = {name: [(i, j) for i, j in runs if wanted(mutant["pieces"][i][j])] for name, wanted in
              (("later", lambda n: n > 5), ("unproved", lambda n: n == 0))}  # fmt: skip
        i, j = of["unproved" if kind in ("proved", "kept") else "later"][rng.integers(20)]
        if kind == "claim":
            mutant["claim"]["proved"] += 1
        elif kind == "longest":
            mutant["claim"]["longest"] -= 1
        elif kind == "sooner":
            mutant["pieces"][i][j] -= 3
        elif kind in ("proved", "kept"):
            mutant["pieces"][i][j] = 100 if kind == "proved" else -1
            numbers = check.pendulum.unpacked(mutant["pieces"])
            middle = (2 * (np.arange(len(numbers)) + 0.5) / len(numbers) - 1) * 8
            mutant["claim"]["proved"] = int((numbers[:, np.abs(middle) < 1.0] != 0).sum())
            mutant["claim"]["longest"] = int(numbers.max())
        elif kind == "policy":
            coefficients = (np.array(content["policy"]["coefficients"]) * 0.5).tolist()
            mutant["policy"] = {**content["policy"], "coefficients": coefficients}
        else:
            mutant["pieces"][i], mutant["pieces"][i - 90] = mutant["pieces"][i - 90], mutant["pieces"][i]
        yield kind, mutant


def test_the_checker_agrees_and_refuses_every_mutant(proof):
    content = proof.certificate()
    assert check.check_content(content) == content["claim"]
    refuse(mutants(content, np.random.default_rng(3)))


def all_five(content):
    """All boxes lead to others of five steps."""
    content |= {"pieces": [[5, 16]] * 16, "claim": content["claim"] | {"proved": 32, "longest": 5}}


def kept_beyond(content):
    """Of these rows around upright, the outer ones begin within 0.5 rad and end beyond."""
    content["claim"] = {"n": 48, "proved": 48, "starts": 288, "longest": 0}
    content["pieces"] = 20 * [[0, 48]] + 8 * [[-1, 48]] + 20 * [[0, 48]]


@pytest.mark.parametrize(
    ("alter", "match"),
    [(lambda c: c["pieces"].__setitem__(0, [-0.5, 16]), "whole numbers"),
     (lambda c: c["pieces"].__setitem__(0, [201, 16]), "numbers are 0 to 201"),
     (lambda c: c["policy"]["codewords"].__setitem__(0, [1e200] * 3), "malformed"),
     (lambda c: c["policy"]["coefficients"].pop(), "1 codewords, but 0 maps"),
     (lambda c: c["policy"]["coefficients"][0].__setitem__(1, [200.0]), "too steep"),
     (all_five, "may lead to one with 5"), (kept_beyond, "more than 0.5 rad from upright")],
)  # fmt: skip
def test_a_forged_certificate_is_refused(alter, match):
    alter(forged := copy.deepcopy(prove_pendulum(STILL, n=16).certificate()))
    with pytest.raises(check.Refused, match=match):
        check.check_content(forged)


def test_other_policies_and_grids_get_one_clear_error():
    other = vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task=SIMPLEGOAL)
    for policy, n, match in ((other, 80, PENDULUM), (STILL, 100, "n is 100, expected a multiple of 16")):
        with pytest.raises(ValueError, match=match):
            prove_pendulum(policy, n=n)
