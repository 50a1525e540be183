import numpy as np
import pytest
from support import MOUNTAINCAR

import vsp
from studies import comparison
from studies.proofs import mountaincar_reals
from studies.proofs.mountaincar_reals import Loop, prove_part, started
from vsp.tasks.mountaincar import TASK

CAR = vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{MOUNTAINCAR}.policy")


def policy_of(codewords, maps):
    return vsp.VoronoiPolicy(codewords, maps, task=MOUNTAINCAR, metric="euclidean")


def step(policy, states):
    """In float64: the program rounds to float32, real numbers do not."""
    x, v = states.T
    v = v + 0.0015 * policy.predict(states)[0][:, 0] - 0.0025 * np.cos(3 * x)
    return np.column_stack([x + v, v])


@pytest.mark.parametrize("seed", range(3))
def test_states_are_where_their_pieces_say(seed):
    """From random starts, along with the pieces in which they lie."""
    rng = np.random.default_rng(seed)
    codewords = rng.uniform([-0.8, -0.02], [0.0, 0.02], size=(3, 2))
    policy = policy_of(codewords, rng.normal(scale=[[[1.0], [30.0], [0.5]]] * 3))
    low = rng.uniform(-0.6, -0.42)
    pieces, loop = started(np.array([low]), np.array([low + 0.01])), Loop(policy)
    starts = rng.uniform(low, low + 0.01, size=50)
    states = np.column_stack([starts, np.zeros(50)])
    for _ in range(40):
        pieces, arrived, failed = loop.step(pieces)
        states = step(policy, states)
        if len(arrived) or len(failed):
            break
        for start, state in zip(starts, states):
            inside = np.flatnonzero((pieces.low <= start) & (start <= pieces.high))
            middle, half = (pieces.low + pieces.high)[inside] / 2, (pieces.high - pieces.low)[inside] / 2
            t = np.divide(start - middle, half, out=np.zeros(len(inside)), where=half > 0)
            gap = state[:, None] - pieces.centre[:, inside] - t * pieces.along[:, inside]
            size = pieces.rest[inside] + 2e-16 / np.maximum(half, 1e-300) * np.hypot(*pieces.along[:, inside])
            assert (np.hypot(gap[0], gap[1] / 0.0866) <= size + 1e-13).any()


def test_a_part_of_the_starts_surely_arrives():
    part = prove_part(CAR, -0.5, -0.4995, 200)
    starts = np.column_stack([np.random.default_rng(0).uniform(-0.5, -0.4995, size=50), np.zeros(50)])
    found = vsp.rollout(CAR, TASK, starts)
    assert part.share == 1.0 and found.lengths.max() <= part.longest + 1 and part.least <= found.returns.min() + 1e-3


def test_shorter_pieces_prove_what_long_ones_leave_open(monkeypatch):
    monkeypatch.setattr(mountaincar_reals, "LOST", 3e-5)
    whole = prove_part(CAR, -0.5, -0.49998, 2)
    monkeypatch.setattr(mountaincar_reals, "N_TRIALS", 1)
    once = prove_part(CAR, -0.5, -0.49998, 2)
    assert once.share < 1.0 == whole.share


def test_what_is_given_up_counts_however_short_it_is():
    none = np.zeros(0, dtype=int)

    class Hopeless:
        @staticmethod
        def step(pieces):
            return pieces.at(none), pieces.at(none), pieces

    lost, steps, _ = mountaincar_reals._followed(Hopeless, started(np.array([-0.5]), np.array([-0.5])))
    assert lost[0, 0] < -0.5 < lost[0, 1] and steps == 0


def test_a_car_that_just_passes_the_flag_has_arrived():
    """Left of this start the car rolls back before the flag and swings once more."""
    assert prove_part(CAR, -0.40513, -0.40512, 10).share == 1.0


def test_where_the_car_never_moves_nothing_is_proved(monkeypatch):
    monkeypatch.setattr(mountaincar_reals, "N_TRIALS", 1)
    still = policy_of([[-0.5, 0.0]], np.zeros((1, 3, 1)))
    assert prove_part(still, -0.53, -0.52, 10).share == 0.0
    slow = policy_of([[-0.5, 0.0]], [[[0.0], [12.0], [0.0]]])  # its dead point is at -π/6
    assert prove_part(slow, -0.6, -0.599, 100).share == 1.0 and 0.0 < prove_part(slow, -0.53, -0.52, 1000).share < 1.0


def test_the_wall_stops_the_car():
    left = policy_of([[-0.5, 0.0]], [[[0.0], [0.0], [-1.0]]])
    pieces, loop = started(np.array([-0.6]), np.array([-0.599])), Loop(left)
    pieces = pieces.at(np.zeros(1, dtype=int))
    object.__setattr__(pieces, "centre", np.array([[-1.19], [-0.05]]))
    moved, arrived, failed = loop.step(pieces)
    assert not len(arrived) and not len(failed)
    assert moved.centre.tolist() == [[-1.2], [0.0]] and moved.rest[0] == 0.0
