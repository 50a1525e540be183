"""Run MountainCar's program from every state that it can reach, without sampling and without a theory of its dynamics.

Gymnasium keeps the state in float32 after the first step, so there are finitely many states. The starts are float64,
but the policy observes them in float32: some five million observations. From each of them the first step leads to a few
states. From every one of these, C plays the episode to its end (mountaincar.c). Actions and cosines may differ slightly
from one library to the next; the difference is bounded. Where it decides how a state is rounded or which cell is
nearest, all branches are followed. So the result holds for Gymnasium's `step` with NumPy 2 and the float64 actions of
`VoronoiPolicy.predict`, and for any library whose cosine is accurate to `COSINE`.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.run import workers
from vsp.tasks.mountaincar import TASK

from .proof import Proof, check_provable

LEFT, RIGHT = -0.6, -0.4  # ends of the range of starts
COSINE = 1e-15  # several times the difference between libraries
SUMS = 1e-15  # relative to the terms added up: more than float64 loses in four sums, in any order
TIES = 1e-12  # likewise, for distances
BLOCK = 10_000  # observations at a time
MOST = 20_000_000  # most states after the first step of a block; exceeded where the car hardly moves
MOST_CELLS = 64  # in mountaincar.c
MOST_WAYS = 10_000  # most states that one step may lead to
COMPILE = ("-O2", "-std=c11", "-ffp-contract=off", "-shared", "-fPIC")  # no fused multiply-add

ENDS = np.dtype([("least", "f8"), ("most", "f8"), ("longest", "i4"), ("left", "i4"), ("doubts", "i4")], align=True)


class Program(ctypes.Structure):
    """A policy, in the form that mountaincar.c reads."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("slopes_at", "offsets_at", "maps_at")),
        *((name, ctypes.c_double) for name in ("tie", "sums", "cosine")),
        *((name, ctypes.c_int) for name in ("k", "most_steps", "most_ways")),
    ]  # fmt: skip

    def __init__(self, policy: VoronoiPolicy):
        codewords, weights = policy.codewords, 1.0 / policy.scale**2
        reach = np.abs([TASK.low, TASK.high]).max(axis=0) + np.abs(codewords).max(axis=0)
        self.slopes, self.offsets = 2 * codewords * weights, np.square(codewords) @ weights
        self.maps = policy.coefficients[:, :, 0].copy()
        tie, parts = TIES * float(np.square(reach) @ weights), (self.slopes, self.offsets, self.maps)
        addresses = (part.ctypes.data for part in parts)
        super().__init__(*addresses, tie, SUMS, COSINE, len(policy), TASK.max_steps, MOST_WAYS)

    def play(self, states: np.ndarray, returns: np.ndarray) -> np.ndarray:
        """Play the episodes that are in `states` (n, 2) after one step, with `returns` (n,) so far. Return how each
        ends. (n,)"""
        states, returns, ends = np.ascontiguousarray(states), np.ascontiguousarray(returns), np.empty(len(states), ENDS)
        addresses = (part.ctypes.data_as(ctypes.c_void_p) for part in (states, returns, ends))
        _compiled().play_all(ctypes.byref(self), ctypes.c_long(len(states)), *addresses)
        if (ends["doubts"] < 0).any():
            raise ValueError(f"from state {states[ends['doubts'] < 0][0]} a step leads to more than {MOST_WAYS} others")
        return ends


@dataclass(frozen=True)
class Block:
    """The result for a block of observations."""

    first: int  # index of the first of these observations, from the left
    n: int
    n_states: int  # after the first step
    n_doubts: int  # how often several branches were followed
    n_left: int  # episodes that did not arrive
    longest: int  # most steps
    least: float  # lowest return, to 1e-9
    mean_low: float  # bounds on the mean return over the starts of these observations
    mean_high: float
    width: float  # share of these starts among all


@dataclass(frozen=True)
class MountainCarProof(Proof):
    """The result of running the program from every start."""

    blocks: tuple[Block, ...]

    @property
    def claim(self) -> dict:
        """The number `n` of observations, of states after the first step, and of episodes that do not arrive; the most
        steps, the lowest return, and bounds on the mean return."""
        claim = {name: sum(getattr(block, name) for block in self.blocks) for name in ("n", "n_states", "n_left")}
        claim |= {"longest": max(b.longest for b in self.blocks), "least": min(b.least for b in self.blocks)}
        means = ("mean_low", "mean_high")
        return claim | {name: sum(b.width * getattr(b, name) for b in self.blocks) for name in means}

    def parts(self) -> list:
        """Return the blocks."""
        return [asdict(block) for block in self.blocks]


def prove_mountaincar(policy: VoronoiPolicy, *, jobs: int | str = -1) -> MountainCarProof:
    """Run the program from every start. Takes four minutes on two cores.

    `jobs` as in `vsp.run.workers`. Raises ValueError for a policy that is not made of linear
    maps and Euclidean cells for MountainCar, and for one with a start from which the car hardly moves."""
    check_provable(policy, TASK, ["euclidean"])
    if len(policy) > MOST_CELLS:
        raise ValueError(f"the policy has {len(policy)} cells, expected at most {MOST_CELLS}")
    n = 1 + int(np.subtract(*_numbers(np.array([RIGHT, LEFT], dtype=np.float32))))
    work = [(policy, begin, min(BLOCK, n - begin)) for begin in range(0, n, BLOCK)]
    blocks = dict(workers.results(run_block, work, "every start", jobs=jobs, total=len(work), unit="blocks"))
    return MountainCarProof(policy, tuple(blocks[i] for i in range(len(work))))


def run_block(policy: VoronoiPolicy, first: int, n: int) -> Block:
    """Run the program from `n` observations; the first is `first` floats to the right of -0.6."""
    program, seen = Program(policy), _floats(_numbers(np.float32(LEFT)) + np.arange(first, first + n))
    low, high = np.maximum(_halfway(seen, -1), LEFT), np.minimum(_halfway(seen, 1), RIGHT)  # ends of the starts seen so
    states, owner, returns = first_steps(program, seen, low, high)
    ends, least, most = program.play(states, returns), np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(least, owner, ends["least"])
    np.maximum.at(most, owner, ends["most"])
    widths = high - low
    mean_low, mean_high = (float(widths @ bound / widths.sum()) for bound in (least, most))
    doubts, left = (int(ends[name].sum()) for name in ("doubts", "left"))
    longest, width = int(ends["longest"].max()), float(widths.sum() / (RIGHT - LEFT))
    return Block(first, n, len(states), doubts, left, longest, float(least.min()), mean_low, mean_high, width)


def first_steps(program: Program, seen: np.ndarray, low: np.ndarray, high: np.ndarray):
    """Compute the states after the first step from starts between `low` and `high` (n,), all of which are observed as
    `seen` (n,).

    Returns the states (m, 2), the index of the observation that each comes from (m,), and their returns (m,)."""
    near = program.slopes[:, :1] * seen - program.offsets[:, None]
    cells, index = np.nonzero(near >= near.max(axis=0) - program.tie)
    along, bias = program.maps[cells, 0] * seen[index], program.maps[cells, 2]
    slack = SUMS * (np.abs(along) + np.abs(bias))
    actions = np.clip(np.stack([along + bias - slack, along + bias + slack]), -1.0, 1.0)
    low, high = low[index], high[index]
    # Along the starts the velocity falls and the position rises, because 3 x is near -pi / 2
    most = actions[1] * 0.0015 - 0.0025 * (np.cos(3 * low) - COSINE)
    least = actions[0] * 0.0015 - 0.0025 * (np.cos(3 * high) + COSINE)
    doubt = (actions[1] - actions[0]) * 0.0015 + 0.005 * COSINE
    which, velocities = _between(least, most)
    low, high, least, most, doubt = (values[which] for values in (low, high, least, most, doubt))
    above, below = (np.clip(_halfway(velocities, side), least, most) for side in (1, -1))
    steepness = 0.0075 * np.abs(np.sin(3 * low))
    begin = np.maximum(low, low + (most - above - doubt) / steepness * (1 - 1e-6) - 1e-12)
    end = np.minimum(high, low + (most - below + doubt) / steepness * (1 + 1e-6) + 1e-12)
    again, positions = _between(begin + above - doubt, end + below + doubt)
    which = which[again]
    rewards = -0.1 * np.square(actions).max(axis=0)
    return np.column_stack([positions, velocities[again]]), index[which], rewards[which]


@cache
def _compiled() -> ctypes.CDLL:
    """Compile mountaincar.c for this machine. Raises FileNotFoundError if there is no C compiler."""
    if not (compiler := os.environ.get("CC") or shutil.which("cc")):
        raise FileNotFoundError("no C compiler found: install one (`apt-get install gcc`), or name it in CC")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "mountaincar.so"
        source = Path(__file__).with_suffix(".c")
        subprocess.run([compiler, *COMPILE, "-o", library, source, "-lm"], check=True)
        return ctypes.CDLL(str(library))


def _between(least: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List every float32 that a number between `least` and `most` (n,) can be rounded to: the index of the pair, and
    the float."""
    first, last = _numbers(least.astype(np.float32)), _numbers(most.astype(np.float32))
    counts = last - first + 1
    if counts.sum() > MOST:
        i = int(counts.argmax())
        raise ValueError(
            f"between {least[i]:.3g} and {most[i]:.3g} there are {counts[i]:,} float32, too many to run each: "
            "use `at_rest` to look for a start from which the car does not move"
        )
    which = np.repeat(np.arange(len(counts)), counts)
    return which, _floats(first[which] + np.arange(len(which)) - (counts.cumsum() - counts)[which])


def _halfway(values: np.ndarray, side: int) -> np.ndarray:
    """Return the end, on one side, of the interval of numbers that are rounded to `values` (float32)."""
    return (values.astype(np.float64) + _floats(_numbers(values) + side)) / 2


def _numbers(values: np.ndarray | np.floating) -> np.ndarray:
    """Convert float32 to integers that number them from the lowest to the highest."""
    bits = np.asarray(values, dtype=np.float32).view(np.int32).astype(np.int64)
    return np.where(bits >= 0, bits, -(2**31) - bits)


def _floats(numbers: np.ndarray) -> np.ndarray:
    """Convert integers to float32: the inverse of `_numbers`."""
    bits = np.where(numbers >= 0, numbers, -(2**31) - numbers)
    return bits.astype(np.int32).view(np.float32)
