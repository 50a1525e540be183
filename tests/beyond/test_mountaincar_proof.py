import copy
import ctypes
import math
import shutil
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, called
from test_simplegoal_proof import check_command, refuse

import vsp
from studies import comparison
from vsp_beyond.proofs import check, load_certificate, mountaincar
from vsp_beyond.proofs.mountaincar import MountainCarProof, Program, first_steps, prove_mountaincar, run_block
from vsp_beyond.proofs.proof import CERTIFICATES

edge = check.mountaincar.edge


def policy_of(codewords, coefficients):
    return vsp.VoronoiPolicy(codewords, coefficients, task=MOUNTAINCAR, metric="euclidean")


def player_of(policy):
    parts = policy.codewords.tolist(), policy.coefficients.tolist(), policy.scale.tolist()
    return check.mountaincar.Policy(*parts, policy.metric)


@pytest.fixture(scope="module")
def policy():
    return vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{MOUNTAINCAR}.policy")


@pytest.fixture(scope="module")
def env():
    env = gymnasium.make(MOUNTAINCAR).unwrapped
    env.reset(seed=0)
    return env


def stepped(env, state, action):
    env.state = state
    observation, _, ended, *_ = env.step(np.array([action]))
    return *observation, ended


def test_the_step_is_gymnasiums_bit_for_bit(env):
    """Our batched step rounds otherwise in some steps."""
    rng, n = np.random.default_rng(0), 20_000
    states = rng.uniform([-1.2, -0.07], [0.6, 0.07], size=(n, 2)).astype(np.float32)
    states[::50, 0], states[1::50, 1], states[2::50, 1] = -1.2, 0.0699, -0.0699  # the wall, and the highest speed
    actions = np.clip(rng.uniform(-1.5, 1.5, size=n), -1, 1)
    after = np.empty(n, [("x", "f4"), ("v", "f4"), ("ended", "i4")])
    addresses = (part.ctypes.data_as(ctypes.c_void_p) for part in (states, actions, after))
    mountaincar._compiled().step_all(ctypes.c_long(n), *addresses)
    wanted = np.array([stepped(env, *pair) for pair in zip(states, actions)])
    assert np.array_equal(np.column_stack([after["x"], after["v"], after["ended"]]), wanted.astype(np.float32))
    ours = vsp.get_task(MOUNTAINCAR).step(states.astype(float), actions[:, None])[0].astype(np.float32)
    differ = (ours != np.column_stack([after["x"], after["v"]])).any(axis=1)
    assert 0.03 < differ.mean() < 0.06  # "about 4 %" in notebook 08


def listed(policy, first, n):
    """The states after the first step from n observations, their owners and returns, and the ends of the starts."""
    edges = np.array([edge(first + i, -1) for i in range(n + 1)])
    observed = mountaincar._floats(mountaincar._numbers(np.float32(-0.6)) + np.arange(first, first + n))
    states, owner, returns = first_steps(Program(policy), observed, edges[:-1], edges[1:])
    return set(map(tuple, states.tolist())), owner, returns, edges[[0, -1]]


@pytest.mark.parametrize("first", [0, 2_500_000, 5_033_166 - 300])
def test_all_first_steps_are_among_those_listed(policy, env, first):
    (states, owner, returns, ends), played = listed(policy, first, 300), set()
    for start in np.random.default_rng(1).uniform(*ends, size=3000):
        action = policy.predict(np.array([start, 0.0], dtype=np.float32))[0][0]
        played.add(tuple(map(float, stepped(env, np.array([start, 0.0]), action)[:2])))
    assert played <= states and len(states) < 3 * len(played)
    assert set(owner) == set(range(300)) and (returns <= 0).all()


@pytest.mark.parametrize(("doubt", "size", "most"), [("SUMS", 1e-4, 2), ("COSINE", 1e-7, 1)])
def test_the_doubtful_steps_are_listed_too(policy, monkeypatch, doubt, size, most):
    exact = listed(policy, 100_000, 50)[0]
    monkeypatch.setattr(mountaincar, doubt, size)
    doubtful = listed(policy, 100_000, 50)[0]
    assert exact <= doubtful and len(doubtful) > most * len(exact)


@pytest.mark.parametrize("push", [1.0, 40.0, -40.0])  # at the limits; up to the wall; never there
def test_the_checker_plays_as_gymnasium_does(env, push):
    policy = policy_of([[-0.5, -0.01], [-0.5, 0.01]], [[[0.0], [push], [-0.9]], [[0.3], [push], [0.9]]])
    player = player_of(policy)
    for start in np.random.default_rng(0).uniform(-0.6, -0.4, size=20):
        env.state = state = np.array([start, 0.0])
        observation, total, ended, steps = state.astype(np.float32), 0.0, False, 0
        while not ended and steps < 999:
            observation, reward, ended, *_ = env.step(policy.predict(observation)[0])
            total, steps = total + reward, steps + 1
        assert player.play(start) == (pytest.approx(total, abs=1e-9), steps, bool(ended))


def test_a_block_is_what_the_checker_plays(policy):
    block, low, high = run_block(policy, 100_000, 200), edge(100_000, -1), edge(100_200, -1)
    player = player_of(policy)
    played = [player.play(start) for start in np.random.default_rng(2).uniform(low, high, size=100)]
    returns, steps, arrived = map(np.array, zip(*played))
    assert arrived.all() and block.n_left == 0 and block.least <= returns.min() and steps.max() <= block.longest
    deviation = returns.std() / np.sqrt(len(returns))
    assert block.mean_low - 5 * deviation < returns.mean() < block.mean_high + 5 * deviation
    assert block.n_states > 200 and block.mean_high - block.mean_low < 1e-4


def test_on_a_border_both_ways_are_followed():
    """At rest both codewords are as near, but for rounding."""
    pushing = policy_of([[-0.5, -0.01], [-0.5, 0.01 + 1e-13]], [[[0], [0], [-1]], [[0], [0], [1]]])
    ways = [run_block(policy_of([[0, 0]], [[[0], [0], [side]]]), 0, 100).n_states for side in (-1, 1)]
    block = run_block(pushing, 0, 100)
    assert block.n_states == sum(ways) and block.n_left == 0
    assert block.width == pytest.approx((edge(100, -1) + 0.6) / 0.2)  # no start is below -0.6


def test_the_mean_lies_between_the_lowest_and_the_highest_returns(monkeypatch):
    ends = lambda self, states, returns: np.array([(1.0, 2.0, 9, 0, 1)] * len(states), mountaincar.ENDS)  # noqa: E731
    monkeypatch.setattr(Program, "play", ends)
    block = run_block(policy_of([[0, 0]], [[[0], [0], [1]]]), 0, 20)
    assert (block.mean_low, block.mean_high) == pytest.approx((1.0, 2.0))


def test_a_car_that_does_not_move_is_not_run():
    at_the_bottom = int(mountaincar._numbers(np.float32(-np.pi / 6)) - mountaincar._numbers(np.float32(-0.6)))
    with pytest.raises(ValueError, match="does not move"):
        run_block(policy_of([[-0.5, 0.0]], np.zeros((1, 3, 1))), at_the_bottom - 5, 10)


@pytest.mark.parametrize(
    ("wrong", "match"),
    [(vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 1)), task=MOUNTAINCAR), "metric is 'manhattan'"),
     (vsp.VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task=SIMPLEGOAL), MOUNTAINCAR),
     (vsp.VoronoiPolicy([[0, 0]], [[[0]]], task=MOUNTAINCAR, sub_policy="constant", metric="euclidean"), "linear"),
     (policy_of(np.arange(130).reshape(65, 2), np.zeros((65, 3, 1))), "at most 64")],
)  # fmt: skip
def test_other_policies_get_one_clear_error(wrong, match):
    with pytest.raises(ValueError, match=match):
        prove_mountaincar(wrong)


def test_without_a_compiler_one_sentence_says_so(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(FileNotFoundError, match="install one"):
        mountaincar._compiled.__wrapped__()


def test_blocks_make_the_claim(policy, monkeypatch):
    monkeypatch.setattr(mountaincar, "RIGHT", np.float32(-0.6) + np.float32(2**-24) * 99)  # a hundred starts
    monkeypatch.setattr(mountaincar, "BLOCK", 50)
    proof = prove_mountaincar(policy, jobs=1)
    first, second = proof.blocks
    assert proof.claim["n"] == 100 and proof.claim["least"] == min(first.least, second.least)
    assert proof.claim["mean_low"] == pytest.approx(sum(block.mean_low * block.width for block in proof.blocks))
    content = MountainCarProof(policy, (first, replace(second, first=60))).certificate()
    with pytest.raises(check.Refused, match="expected 1 to 10000 observations from 50"):
        check.check_content(content)


# Mutants of the committed certificate


def claimed(blocks):
    """What these blocks would prove if they were all."""
    last = blocks[-1]
    firsts = (*(block["first"] for block in blocks), last["first"] + last["n"])
    edges = [edge(first, -1) for first in firsts]
    claim = {name: sum(block[name] for block in blocks) for name in ("n", "n_states", "n_left")}
    claim |= {"least": min(block["least"] for block in blocks), "longest": max(block["longest"] for block in blocks)}
    means = {name: np.diff(edges) @ [block[name] for block in blocks] for name in ("mean_low", "mean_high")}
    return claim | {name: value / (edges[-1] - edges[0]) for name, value in means.items()}


def no_end(blocks, claim, policy):
    """The last starts are left out, also of the claim."""
    del blocks[-100:]
    claim |= claimed(blocks)


def one_block(blocks, claim, policy):
    """A check plays a start of each block: with few blocks it would look at few starts."""
    blocks[:] = [{**blocks[0], **claim}]


def stuck(blocks, claim, policy):
    """A car that never moves is said to arrive."""
    policy["coefficients"] = np.zeros_like(policy["coefficients"]).tolist()
    for part in (*blocks, claim):
        part |= {"least": -1.0, "longest": 999, "mean_low": 0.0, "mean_high": 0.0}


def more_left(blocks, claim, policy):
    """The sum of those that do not arrive stays 0."""
    blocks[3]["n_left"], blocks[4]["n_left"] = 5, -5


def perfect(blocks, claim, policy):
    """Something else is claimed, too."""
    claim["share"] = 1.0


def not_a_number(blocks, claim, policy):
    """No comparison with it is true."""
    blocks[0]["least"], claim["least"] = math.nan, 150.0


def too_good(name, gain, choose):
    """Claim more than is true, of each block and so of all."""

    def mutate(blocks, claim, policy):
        claim[name] += gain
        for block in blocks:
            block[name] = choose(block[name], claim[name])

    return mutate


def better_mean(blocks, claim, policy):
    for part in (*blocks, claim):
        part["mean_low"], part["mean_high"] = part["mean_low"] + 0.02, part["mean_high"] + 0.02


def other_policy(blocks, claim, policy):
    worst = min(blocks, key=lambda block: block["least"])
    policy["coefficients"][worst["n"] % 3][1][0] += 2.0


MUTANTS = {
    "drop": lambda blocks, claim, policy: blocks.pop(7),
    "claim": lambda blocks, claim, policy: claim.update(least=claim["least"] + 1e-3),
    "metric": lambda blocks, claim, policy: policy.update(metric="manhattan"),
    "least": too_good("least", 0.1, max), "longest": too_good("longest", -50, min),
    "end": no_end, "one": one_block, "left": more_left, "stuck": stuck, "nan": not_a_number, "mean": better_mean,
    "policy": other_policy, "more": perfect,
}  # fmt: skip


def test_a_sample_is_not_called_a_proof(capsys):
    called(check_command, CERTIFICATES / "mountaincar_limit.json")
    assert ".json agrees, in a sample, with {" in capsys.readouterr().out


def test_the_checker_refuses_every_mutant():
    content = load_certificate("mountaincar_limit")[1]
    mutants = {kind: copy.deepcopy(content) for kind in MUTANTS}
    for kind, mutant in mutants.items():
        MUTANTS[kind](mutant["pieces"], mutant["claim"], mutant["policy"])
    refuse(mutants.items())
