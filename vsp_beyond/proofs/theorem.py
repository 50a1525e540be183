"""Let a proof kernel, Coq, check that SimpleGoal's policy with a margin always reaches the goal: `make theorem`.

coq/Statement.v has the claim. The proof needs a number of steps for each box of a grid. Coq checks these, but takes
Policy.v as it is: we trust that `files` writes the certificate's numbers exactly. `rounding` leads from the theorem,
which is about rational numbers, to the episodes of `vsp.evaluate`.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from fractions import Fraction
from math import floor
from pathlib import Path

import numpy as np

from vsp.policy import VoronoiPolicy
from vsp.run import atomic
from vsp.tasks.simplegoal import TASK

from .grid import Way, steps_into
from .proof import check_provable, load_certificate

POLICY = "simplegoal_margin"  # the certificate with the policy
SOURCES = Path(__file__).parent / "coq"
ORDER = "Statement Check Sound Policy Ranks Theorem".split()  # in which Coq compiles; Policy and Ranks are data
N, FINE = 300, 2**24  # boxes per axis; units of a box's width, to which the check rounds outwards
ERROR, TIE = Fraction(1, 2**20), Fraction(1, 2**16)  # as in Statement.v, of a step and of squared distances
UNPROVED = 62  # steps from a box of which nothing is proved: more than an episode has
SEEN, UNIT = Fraction(1, 2**25), Fraction(1, 2**53)  # most that float32 alters a state; that float64 does, relative


def terms(policy: VoronoiPolicy) -> list[list[Fraction]]:
    """Return codeword (2) and coefficients (3 for Δx, 3 for Δy) of every cell, exactly."""
    rows = zip(policy.codewords.tolist(), policy.coefficients.transpose(0, 2, 1).tolist())
    return [[Fraction(number) for part in (codeword, *maps) for number in part] for codeword, maps in rows]


def steps(policy: VoronoiPolicy) -> np.ndarray:
    """Return the most steps from any state of each box to the goal, as Coq checks them; `UNPROVED` where the pit may be
    entered or the boxes are too coarse. (N, N)

    Raises ValueError for a policy that is not made of linear maps for SimpleGoal, with Euclidean distances."""
    check_provable(policy, TASK, ["euclidean"])
    boxes = np.stack(np.meshgrid(np.arange(N), np.arange(N), indexing="ij")).reshape(2, -1)
    goal = (boxes < N // 10).all(axis=0).reshape(N, N)
    found = steps_into(goal, [_way(policy, cell, boxes) for cell in range(len(policy))], TASK.max_steps)
    return np.where(found > 0, found, UNPROVED)


def _way(policy: VoronoiPolicy, cell: int, boxes: np.ndarray) -> Way:
    """Bound where a step by the map of `cell` leads, from those boxes where it may act, with the numbers of Check.v."""
    cells, squares = terms(policy), [Fraction(unit) ** 2 for unit in policy.scale.tolist()]
    own, may_act = cells[cell], np.ones(boxes.shape[1], dtype=bool)
    for other in cells:
        weights = [2 * (other[i] - own[i]) / squares[i] for i in (0, 1)]
        constant = sum((own[i] ** 2 - other[i] ** 2) / squares[i] for i in (0, 1))
        may_act &= _least([*weights, constant - TIE], boxes) <= 0
    boxes = boxes[:, may_act]
    ends, tenth, spread = [], N * FINE // 10, floor(N * FINE * ERROR)
    for axis, action in enumerate((own[2:5], own[5:8])):
        stride = np.array(action) / 10
        moved = stride + [i == axis for i in range(3)]
        low, high = _least(stride, boxes), -_least(-stride, boxes)
        first, last = boxes[axis] * FINE + np.clip([low, high], -tenth, tenth) + [[0], [FINE]]
        first = np.where(high <= tenth, np.maximum(first, _least(moved, boxes)), first)
        last = np.where(low >= -tenth, np.minimum(last, -_least(-moved, boxes)), last)
        ends.append(np.clip([first - spread, last + spread], 0, N * FINE))
    lows, highs = np.array(ends).transpose(1, 0, 2)  # (2, m) each
    safe = ((highs <= 4 * tenth) | (lows >= 6 * tenth)).any(axis=0)
    first, last = (np.minimum(end // FINE, N - 1).astype(np.int32) for end in (lows, highs))
    return Way(np.flatnonzero(may_act), first, last + 1, safe)


def _least(form: Sequence[Fraction] | np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Bound p x + q y + r from below over boxes (2, m), in units of 1 / (N FINE). (m,)"""
    p, q, r = floor(form[0] * FINE), floor(form[1] * FINE), floor(form[2] * FINE * N)
    return p * boxes[0] + q * boxes[1] + (r + min(p, 0) + min(q, 0))


def rounding(policy: VoronoiPolicy) -> tuple[Fraction, Fraction]:
    """Bound how far the steps of `vsp.evaluate` are from those of the statement: the error of a coordinate before the
    walls, and how much the squared scaled distance of the acting cell exceeds the least.

    The policy sees a float32 copy of the state. All else is float64: each operation errs by at most `UNIT`, relative to
    its result. A term of an action is rounded as a product and in two sums: 3, here 5. The stride 0.1 and the product
    with it err by 0.1 `UNIT` each, the sum, below 1.1, by 1.1: here 2. A gap is a difference of two quotients, so it
    errs by 2 `UNIT` of its bound, its square by 5, the sum of two by 6, and the roots that are compared add 2: here 16.
    """
    rows, units = terms(policy), [Fraction(unit) for unit in policy.scale.tolist()]
    maps = [numbers for row in rows for numbers in (row[2:5], row[5:8])]
    error = max((abs(p) + abs(q)) * SEEN / 10 + (abs(p) + abs(q) + abs(r)) * UNIT / 2 for p, q, r in maps) + 2 * UNIT
    size = max(sum(((1 + abs(row[i])) / units[i]) ** 2 for i in (0, 1)) for row in rows)
    slope = max(sum(2 * abs(row[i] - other[i]) / units[i] ** 2 for i in (0, 1)) for row in rows for other in rows)
    return error, slope * SEEN + 2 * 16 * size * UNIT


def files(policy: VoronoiPolicy, found: np.ndarray) -> dict[str, str]:
    """Return all that Coq reads, by name, with the result (N, N) of `steps` as letters: A is one step."""
    cells = []
    for i, row in enumerate(terms(policy)):
        codeword, *equations = (" ".join(map(rational, part)) for part in (row[:2], row[2:5], row[5:8]))
        cells.append(f"  (* {', '.join(policy.equations(i))} *)\n  Cell (State {codeword})")
        cells[-1] += "".join(f"\n    (Equation {equation})" for equation in equations)
    scale, ranks = map(rational, policy.scale), (f'  "{bytes(row).decode()}"' for row in (64 + found).tolist())
    head = "From Coq Require Import List QArith.\nFrom VSP Require Import {}.\nImport ListNotations.\n\nDefinition "
    texts = {path.stem: path.read_text() for path in SOURCES.glob("*.v")}
    numbers = f"Policy (State {' '.join(scale)}) [\n{(';' + chr(10)).join(cells)}\n]%Q"
    texts["Policy"] = f"{head.format('Statement')}the_policy := {numbers}.\n"
    texts["Ranks"] = f"{head.format('Check')}ranks := [\n{(';' + chr(10)).join(ranks)}\n]%row.\n"
    return texts


def rational(number: float | Fraction) -> str:
    """Write a number exactly, as Coq reads it: an integer and the power of 2 that divides it."""
    numerator, denominator = Fraction(number).as_integer_ratio()
    return f"({numerator} # {f'2 ^ {denominator.bit_length() - 1}' if denominator > 1 else 1})"


def compiled(folder: Path, names: Sequence[str] = ORDER) -> str:
    """Let Coq check these of the `files` in `folder`, and return what it prints. Raises ValueError if it refuses."""
    printed = ""
    for name in names:
        done = subprocess.run(["coqc", "-R", ".", "VSP", f"{name}.v"], cwd=folder, capture_output=True, text=True)
        if done.returncode:
            raise ValueError(f"Coq refuses {name}.v: {done.stderr.strip()[-500:]}")
        printed += done.stdout
    return printed


def main() -> None:
    """Prove the theorem in the folder that is named, and say how long it took."""
    if shutil.which("coqc") is None:
        sys.exit("error: no coqc found: install Coq 8.16 or newer, for instance with `apt-get install coq`")
    begun, folder, policy = time.perf_counter(), Path(sys.argv[1]), load_certificate(POLICY)[0]
    for name, text in files(policy, steps(policy)).items():
        atomic.write_text(folder / f"{name}.v", text)
    try:
        printed = compiled(folder)
    except ValueError as refusal:
        sys.exit(f"error: {refusal}")
    if printed != 3 * "Closed under the global context\n":
        sys.exit(f"error: the theorem rests on\n{printed}")
    print(f"Coq proved {folder}/Statement.v of Policy.v there in {time.perf_counter() - begun:.0f} s, without axioms")


if __name__ == "__main__":
    main()
