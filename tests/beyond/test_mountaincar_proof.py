import copy
import math
import shutil
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL

import vsp
from studies import comparison
from vsp_beyond.proofs import check, load_certificate, mountaincar
from vsp_beyond.proofs.mountaincar import MountainCarProof, Program, first_steps, prove_mountaincar, run_block, step


def policy_of(codewords, maps):
    return vsp.VoronoiPolicy(codewords, maps, task=MOUNTAINCAR, metric="euclidean")


PUSHING = policy_of([[-0.5, -0.01], [-0.5, 0.01]], [[[0], [0], [-1]], [[0], [0], [1]]])
MANY = policy_of(np.arange(130).reshape(65, 2), np.zeros((65, 3, 1)))


@pytest.fixture(scope="module")
def policy():
    return vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{MOUNTAINCAR}.policy")


@pytest.fixture(scope="module")
def env():
    found = gymnasium.make(MOUNTAINCAR).unwrapped
    found.reset(seed=0)
    return found


def stepped(env, state, action):
    env.state = state
    seen, _, ended, *_ = env.step(np.array([action]))
    return *seen, ended


def test_the_step_is_gymnasiums_bit_for_bit(env):
    rng, n = np.random.default_rng(0), 20_000
    states = rng.uniform([-1.2, -0.07], [0.6, 0.07], size=(n, 2)).astype(np.float32)
    states[::50, 0], states[1::50, 1], states[2::50, 1] = -1.2, 0.0699, -0.0699  # the wall, and the highest speed
    actions = np.clip(rng.uniform(-1.5, 1.5, size=n), -1, 1)
    found = step(states, actions)
    wanted = np.array([stepped(env, *one) for one in zip(states, actions)])
    assert np.array_equal(np.column_stack([found["x"], found["v"], found["ended"]]), wanted.astype(np.float32))


def test_our_batched_step_rounds_otherwise_in_some_steps(env):
    rng = np.random.default_rng(0)
    states = rng.uniform([-1.2, -0.07], [0.6, 0.07], size=(20_000, 2)).astype(np.float32)
    actions = rng.uniform(-1, 1, size=len(states))
    ours = vsp.get_task(MOUNTAINCAR).step(states.astype(float), actions[:, None])[0].astype(np.float32)
    program = step(states, actions)
    differ = (ours != np.column_stack([program["x"], program["v"]])).any(axis=1)
    assert 0.03 < differ.mean() < 0.06  # "about 4 %" in notebook 08


@pytest.mark.parametrize("first", [0, 2_500_000, 5_033_166 - 300])
def test_all_first_steps_are_among_those_found(policy, env, first):
    low, high = (check.mountaincar.edge(first + i, -1) for i in (0, 300))
    seen = mountaincar._floats(mountaincar._numbers(np.float32(-0.6)) + np.arange(first, first + 300))
    edges = np.array([check.mountaincar.edge(first + i, -1) for i in range(301)])
    states, owner, returns = first_steps(Program(policy), seen, edges[:-1], edges[1:])
    starts, found = np.random.default_rng(1).uniform(low, high, size=3000), {tuple(one) for one in states.tolist()}
    played = set()
    for start in starts:
        action = policy.predict(np.array([start, 0.0], dtype=np.float32))[0][0]
        played.add(tuple(float(one) for one in stepped(env, np.array([start, 0.0]), action)[:2]))
    assert played <= found and len(found) < 3 * len(played)
    assert set(owner) == set(range(300)) and (returns <= 0).all()


@pytest.mark.parametrize("push", [1.0, 40.0, -40.0])  # at the limits; up to the wall; never there
def test_the_checker_plays_as_gymnasium_does(env, push):
    codewords, maps = [[-0.5, -0.01], [-0.5, 0.01]], [[[0.0], [push], [-0.9]], [[0.3], [push], [0.9]]]
    player = check.mountaincar.Policy(codewords, maps, [1.0, 0.02], "euclidean")
    for start in np.random.default_rng(0).uniform(-0.6, -0.4, size=20):
        env.state = state = np.array([start, 0.0])
        seen, total, ended, steps = state.astype(np.float32), 0.0, False, 0
        while not ended and steps < 999:
            cell = np.abs(seen[1] - np.array([-0.01, 0.01])).argmin()
            action = np.clip(np.append(seen.astype(float), 1.0) @ np.array(maps[cell])[:, 0], -1, 1)
            seen, reward, ended, *_ = env.step(np.array([action]))
            total, steps = total + reward, steps + 1
        assert player.play(start) == (pytest.approx(total, abs=1e-9), steps, bool(ended))


def test_a_block_is_what_the_checker_plays(policy):
    block = run_block(policy, 100_000, 200)
    low, high = (check.mountaincar.edge(100_000 + i, -1) for i in (0, 200))
    player = check.mountaincar.Policy(
        policy.codewords.tolist(), policy.coefficients.tolist(), policy.scale.tolist(), policy.metric
    )
    played = [player.play(start) for start in np.random.default_rng(2).uniform(low, high, size=100)]
    returns, steps, arrived = map(np.array, zip(*played))
    assert arrived.all() and block.n_left == 0 and block.least <= returns.min() and steps.max() <= block.longest
    deviation = returns.std() / np.sqrt(len(returns))
    assert block.mean_low - 5 * deviation < returns.mean() < block.mean_high + 5 * deviation
    assert block.n_states > 200 and block.mean_high - block.mean_low < 1e-4
    assert block.width == pytest.approx((high - low) / 0.2)


def test_on_a_border_both_ways_are_followed():
    block = run_block(PUSHING, 0, 100)  # at rest both codewords are as near
    pushes = [
        vsp.VoronoiPolicy([[0, 0]], [[[0], [0], [side]]], task=MOUNTAINCAR, metric="euclidean") for side in (-1, 1)
    ]
    alone = [run_block(policy, 0, 100).n_states for policy in pushes]
    assert block.n_states == sum(alone) and block.n_left == 0


def test_a_car_that_does_not_move_is_not_run():
    still = policy_of([[-0.5, 0.0]], np.zeros((1, 3, 1)))
    at_the_bottom = int(mountaincar._numbers(np.float32(-np.pi / 6)) - mountaincar._numbers(np.float32(-0.6)))
    with pytest.raises(ValueError, match="does not move"):
        run_block(still, at_the_bottom - 5, 10)


@pytest.mark.parametrize(
    ("wrong", "match"),
    [("a name", "expected a VoronoiPolicy"),
     (vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 1)), task=MOUNTAINCAR), "metric 'euclidean'"),
     (vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task=SIMPLEGOAL), MOUNTAINCAR),
     (MANY, "at most 64")],
)  # fmt: skip
def test_other_policies_get_one_clear_error(wrong, match):
    with pytest.raises(ValueError, match=match):
        prove_mountaincar(wrong)


def test_without_a_compiler_one_sentence_says_so(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(FileNotFoundError, match="install one"):
        mountaincar._compiled.__wrapped__()


def test_blocks_make_the_claim(policy):
    blocks = tuple(run_block(policy, first, 50) for first in (0, 50))
    claim = MountainCarProof(policy, blocks).claim
    assert claim["n"] == 100 and claim["least"] == min(block.least for block in blocks)
    assert claim["mean_low"] == pytest.approx(sum(block.mean_low * block.width for block in blocks))
    gap = replace(blocks[1], first=60)
    content = MountainCarProof(policy, (blocks[0], gap)).certificate()
    with pytest.raises(check.Refused, match="expected 1 to 10000 observations from 50"):
        check.check_content(content)


def test_one_block_of_all_is_refused(policy):
    """A check plays a start of each block: with few blocks it would look at few starts."""
    content = load_certificate("mountaincar_limit")[1]
    n = sum(block["n"] for block in content["pieces"])
    one = {**content["pieces"][0], **content["claim"], "n": n}
    with pytest.raises(check.Refused, match=f"{n}.*expected 1 to 10000 observations"):
        check.check_content({**content, "pieces": [one]})


def claimed(blocks):
    """What these blocks would prove if they were all."""
    last = blocks[-1]
    firsts = (*(block["first"] for block in blocks), last["first"] + last["n"])
    edges = [check.mountaincar.edge(first, -1) for first in firsts]
    found = {name: sum(block[name] for block in blocks) for name in ("n", "n_states", "n_left")}
    found |= {"least": min(block["least"] for block in blocks), "longest": max(block["longest"] for block in blocks)}
    means = {name: np.diff(edges) @ [block[name] for block in blocks] for name in ("mean_low", "mean_high")}
    return found | {name: value / (edges[-1] - edges[0]) for name, value in means.items()}


def mutants(content):
    """Certificates whose claim is false, or whose blocks do not prove it."""
    for kind in ("drop", "end", "swap", "shift", "claim", "least", "longest", "mean", "policy", "stuck", "metric",
                 "states", "nan", "left"):  # fmt: skip
        mutant = copy.deepcopy(content)
        blocks, claim = mutant["pieces"], mutant["claim"]
        worst = min(blocks, key=lambda block: block["least"])
        if kind == "drop":
            del blocks[7]
        elif kind == "end":  # the last starts are left out, also of the claim
            del blocks[-100:]
            claim |= claimed(blocks)
        elif kind == "stuck":  # a car that never moves is said to arrive
            mutant["policy"]["coefficients"] = np.zeros_like(mutant["policy"]["coefficients"]).tolist()
            for part in (*blocks, claim):
                part |= {"least": -1.0, "longest": 999, "mean_low": 0.0, "mean_high": 0.0}
        elif kind == "metric":
            mutant["policy"]["metric"] = "manhattan"
        elif kind == "states":
            blocks[0]["n_states"], blocks[1]["n_states"] = 1, blocks[1]["n_states"] + blocks[0]["n_states"] - 1
        elif kind == "nan":  # no comparison with it is true
            blocks[0]["least"], claim["least"] = math.nan, 150.0
        elif kind == "left":
            blocks[0]["n_left"], blocks[1]["n_left"] = 5, -5
        elif kind == "swap":
            blocks[3], blocks[4] = blocks[4], blocks[3]
        elif kind == "shift":
            blocks[3]["n"] -= 1
            blocks[4]["first"] -= 1
        elif kind == "claim":
            claim["least"] += 1e-3
        elif kind == "least":
            for block in blocks:
                block["least"] = max(block["least"], claim["least"] + 0.1)
            claim["least"] = min(block["least"] for block in blocks)
        elif kind == "longest":
            for block in blocks:
                block["longest"] = min(block["longest"], claim["longest"] - 50)
            claim["longest"] -= 50
        elif kind == "mean":
            for part in (*blocks, claim):
                part["mean_low"], part["mean_high"] = part["mean_low"] + 0.02, part["mean_high"] + 0.02
        else:
            mutant["policy"]["coefficients"][worst["n"] % 3][1][0] += 2.0
        yield kind, mutant


def test_the_checker_refuses_every_mutant():
    for kind, mutant in mutants(load_certificate("mountaincar_limit")[1]):
        with pytest.raises(check.Refused):
            check.check_content(mutant)
            pytest.fail(f"accepted a mutant: {kind}")
