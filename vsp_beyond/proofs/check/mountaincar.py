"""Check MountainCar's certificates by a sample; for a full check, run the proof again.

The blocks of starts must cover all starts and agree with the claim. Then one start of each block, drawn anew at every
check, is played in Python, with the types that Gymnasium uses. Its episode must end within what the block says.
"""

from __future__ import annotations

import math
import random
import struct

from .refused import Refused

LOW, HIGH, N_STEPS = -0.6, -0.4, 999
BLOCK = 10_000  # observations, at most
SAME = 1e-9  # tolerance for returns that are summed in another order
ERRORS = 5  # standard errors by which the sample's mean may differ


def check_content(content: dict) -> dict:
    """Return the claim of a certificate that was read. Raises `Refused` if the blocks or the sample contradict it."""
    claim, blocks, policy, n = content["claim"], content["pieces"], Policy(**content["policy"]), 0
    if not all(math.isfinite(number) for part in (claim, *blocks) for number in part.values()):
        raise Refused("the claim or a block has numbers that are not finite: no comparison would find them wrong")
    for block in blocks:
        counted = block["n"] <= block["n_states"] >= block["n_left"] >= 0
        if block["first"] != n or not 1 <= block["n"] <= BLOCK or not counted:
            counts = {name: block[name] for name in ("first", "n", "n_states", "n_left")}
            raise Refused(f"a block is {counts}, expected 1 to {BLOCK} observations from {n}, and as many states")
        n += block["n"]
    if n != magnitude(LOW) - magnitude(HIGH) + 1:
        raise Refused(f"the blocks have {n} observations, expected {magnitude(LOW) - magnitude(HIGH) + 1}")
    widths = [edge(block["first"] + block["n"], -1) - edge(block["first"], -1) for block in blocks]
    proved = {name: sum(block[name] for block in blocks) for name in ("n", "n_states", "n_left")}
    proved |= {"longest": max(block["longest"] for block in blocks), "least": min(block["least"] for block in blocks)}
    for name in ("mean_low", "mean_high"):
        proved[name] = sum(width * block[name] for width, block in zip(widths, blocks)) / sum(widths)
    if set(claim) != set(proved) or any(abs(claim[name] - proved[name]) > SAME for name in proved):
        raise Refused(f"the blocks prove {proved}, but the claim is {claim}")
    gaps = [played(policy, block) for block in blocks]
    deviation = math.sqrt(sum(gap * gap for gap in gaps) / len(gaps) / len(gaps))
    if abs(sum(gaps) / len(gaps)) > ERRORS * deviation + SAME:
        raise Refused(f"one start of each block returns {sum(gaps) / len(gaps)} more on average than the blocks say")
    return claim


def played(policy: Policy, block: dict) -> float:
    """Play one start of the block, and return by how much its return exceeds the block's mean. Raises `Refused` where
    the block is wrong."""
    start = random.SystemRandom().uniform(edge(block["first"], -1), edge(block["first"] + block["n"], -1))
    total, steps, arrived = policy.play(start)
    if total < block["least"] - SAME or steps > block["longest"] or arrived < (block["n_left"] == 0):
        raise Refused(f"from {start} the car returns {total} in {steps} steps (arrived: {arrived}), against {block}")
    return total - (block["mean_low"] + block["mean_high"]) / 2


class Policy:
    """Linear maps, each for the states that are nearest to its codeword; of equally near codewords the first counts."""

    def __init__(self, codewords, coefficients, scale, metric):
        if metric != "euclidean":
            raise Refused(f"the metric is {metric!r}, expected 'euclidean'")
        self.cells = list(zip(codewords, coefficients))
        self.scale = scale

    def action(self, x: float, v: float) -> float:
        """Return the limited force."""
        _, ((a,), (b,), (c,)) = min(
            self.cells, key=lambda cell: sum(((s - w) / r) ** 2 for s, w, r in zip((x, v), cell[0], self.scale))
        )
        return max(-1.0, min(1.0, a * x + b * v + c))

    def play(self, start: float) -> tuple[float, int, bool]:
        """Play an episode as Gymnasium does: the first step in float64, then the state in float32. Return its return,
        its steps, and whether the car arrives."""
        x, v, total = start, 0.0, 0.0
        for t in range(1, N_STEPS + 1):
            action = self.action(single(x), v)
            triple = 3 * x if t == 1 else single(3 * x)
            speed = v + action * 0.0015 - 0.0025 * math.cos(triple)
            if abs(speed) > 0.07:  # a limited speed is a Python float, so the sum is one of float32
                speed = math.copysign(0.07, speed)
                after, wall, flag = single(x + single(speed)), single(-1.2), single(0.45)
            else:
                after, wall, flag = x + speed, -1.2, 0.45
            if (after := min(after, 0.6)) <= wall:
                after, speed = wall, max(speed, 0.0)
            total -= 0.1 * action**2
            if after >= flag and speed >= 0:
                return total + 100.0, t, True
            x, v = single(after), single(speed)
        return total, N_STEPS, False


def single(value: float) -> float:
    """Return the nearest float32."""
    return struct.unpack("f", struct.pack("f", value))[0]


def magnitude(value: float) -> int:
    """Return the number of the nearest float32 among those of its sign, by their size."""
    return struct.unpack("I", struct.pack("f", abs(value)))[0]


def edge(i: int, side: int) -> float:
    """Return the left end (side -1) or right end (1) of the starts that are seen as the float32 number `i` from -0.6
    on."""
    here, there = (-struct.unpack("f", struct.pack("I", magnitude(LOW) - j))[0] for j in (i, i + side))
    return min(HIGH, max(LOW, (here + there) / 2))
