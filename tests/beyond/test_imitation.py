import struct

import numpy as np
import pytest

from vsp.evaluation import r_squared
from vsp.policy import VoronoiPolicy
from vsp_beyond.drone import imitation
from vsp_beyond.drone.flights import BODIES, command_of, fly, with_history
from vsp_beyond.drone.flown import SIZES, Flown
from vsp_beyond.drone.quadrotor import CRAZYFLIE, HOVER, Starts, quadrotor, see, see_all

RNG = np.random.default_rng(0)


def simple(thrust=1.0):
    """A hand-made controller: height by thrust, place by tilt, each turn by its rate, against the motors' lag."""
    thrusts, roll, pitch, yaw = np.array([[1, 1, 1, 1], [-1, -1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]])
    maps = np.zeros((17, 4))
    maps[2], maps[8], maps[16] = -0.6 * thrusts, -0.4 * thrusts, HOVER
    maps[1], maps[3], maps[7], maps[9] = 0.3 * roll, -0.8 * roll, 0.2 * roll, -0.12 * roll
    maps[0], maps[4], maps[6], maps[10] = -0.3 * pitch, -0.8 * pitch, -0.2 * pitch, -0.12 * pitch
    maps[5], maps[11] = -0.4 * yaw, -0.1 * yaw
    maps[12:16] = -1.1 * (np.outer(roll, roll) + np.outer(pitch, pitch))
    return VoronoiPolicy(np.zeros((1, 16)), thrust * maps[None], task=quadrotor())


def test_the_gradient_of_an_eigenvalue_is_its_slope():
    weights, loop = simple().coefficients[0, :16], imitation.loop_of(CRAZYFLIE)
    value, gradient = imitation.radius(weights, loop)
    way = RNG.normal(size=(16, 4))
    ends = [imitation.radius(weights + step * way, loop)[0] for step in (1e-6, -1e-6)]
    assert (ends[0] - ends[1]) / 2e-6 == pytest.approx((gradient * way).sum(), rel=1e-4)
    assert 0.9 < value < 1
    trembling, (here, steer, seen) = simple(4.0).coefficients[0, :16], loop
    largest = np.abs(np.linalg.eigvals(here + steer @ trembling.T @ seen)).max()
    assert imitation.radius(trembling, loop)[0] == pytest.approx(largest + imitation.TREMBLE)


def test_a_map_is_found_again(monkeypatch):
    monkeypatch.setattr(imitation, "FLIGHTS", 100)
    monkeypatch.setattr(imitation, "ROUNDS", 1)
    known = simple()
    found = imitation.few_maps(command_of(known), seed=0, calm=False)
    seen = see(Starts(0.3, 1.0, 1.0, 90.0)(RNG, 500))
    assert r_squared(found.predict(seen)[0], known.predict(seen)[0]) > 0.9995
    assert np.abs(found.coefficients - known.coefficients)[0, :12].max() < 0.02  # motors say partly what others say
    monkeypatch.setattr(imitation, "N_STEPS", 50)
    monkeypatch.setattr(imitation, "BODIES", {"as built": CRAZYFLIE})
    blind, again = (imitation.few_maps(command_of(known), seed=0, calm=False, memory=False) for _ in range(2))
    assert not blind.coefficients[0, 12:16].any() and np.array_equal(blind.coefficients, again.coefficients)


def test_two_maps_are_found_in_two_cells(monkeypatch):
    """On one side of the origin the height counts six times as much as on the other."""
    known, other = simple(), simple().coefficients[0].copy()
    other[2] *= 6
    known = VoronoiPolicy(
        np.array([[-0.2], [0.2]]) * np.eye(16)[0], np.stack([known.coefficients[0], other]), task=known.task
    )
    few = {"FLIGHTS": 100, "OWN_FLIGHTS": 20, "ROUNDS": 1, "DIVIDED": 1, "N_STEPS": 400, "BODIES": {"": CRAZYFLIE}}
    for name, value in few.items():
        monkeypatch.setattr(imitation, name, value)
    seen = see(Starts(0.3, 1.0, 1.0, 30.0)(RNG, 500))
    found = [imitation.few_maps(command_of(known), seed=0, n_cells=n, calm=False, progress=False) for n in (1, 2)]
    left = [r_squared(policy.predict(seen)[0], known.predict(seen)[0]) for policy in found]
    assert left[0] < 0.7 and left[1] > 0.85
    assert abs(np.corrcoef(found[1].cells(seen), known.cells(seen))[0, 1]) > 0.7


def test_what_an_eigenvalue_exceeds_costs(monkeypatch):
    """A map that is too strong trembles; the calm map does not, for any body."""
    monkeypatch.setattr(imitation, "FLIGHTS", 100)
    monkeypatch.setattr(imitation, "ROUNDS", 0)
    strong = simple(4.0)
    loops = [imitation.loop_of(body) for body in BODIES.values()]
    fits = {calm: imitation.few_maps(command_of(strong), seed=0, calm=calm) for calm in (False, True)}
    radii = [max(imitation.radius(fit.coefficients[0, :16], loop)[0] for loop in loops) for fit in fits.values()]
    assert radii[0] > 1 and radii[1] < 0.995
    two = VoronoiPolicy(np.array([[9.0], [0.0]]) * np.ones(16), strong.coefficients.repeat(2, axis=0), task=strong.task)
    flown = imitation._flown(command_of(strong), command_of(strong), imitation.STARTS(RNG, 100))
    maps = imitation._fitted(two, np.ones((17, 1)), *flown, loops, RNG).coefficients[:, :16]
    paid = [max(imitation.radius(one, loop)[0] for loop in loops) for one in maps]
    assert paid[0] > 1 and paid[1] < 0.995  # the cell that hovers is the second


def header(layers, inputs, outputs, spoilt=lambda text: text):
    """Return a file like `actor.h`."""
    arrays = [part for weight, bias in layers for part in (weight.T, bias)] + [inputs, outputs]
    lines = []
    for array in arrays:
        numbers = ", ".join(str(byte) for byte in struct.pack(f"<{array.size}f", *array.ravel()))
        lines.append(f"alignas(float) const unsigned char memory[] = {{{numbers}}};")
    return spoilt("\n".join(lines))


def network():
    shapes = (146, 64), (64, 64), (64, 4)
    layers = [(RNG.normal(size=shape).astype("f4") / 8, RNG.normal(size=shape[1]).astype("f4")) for shape in shapes]
    inputs = RNG.normal(size=146).astype("f4")
    hidden = inputs
    for weight, bias in layers:
        x = np.clip(hidden @ weight + bias, -3, 3)
        hidden = x * (27 + x**2) / (27 + 9 * x**2)
    return layers, inputs, hidden


def test_a_network_in_a_header_flies_as_it_says(tmp_path):
    layers, inputs, outputs = network()
    (tmp_path / "actor.h").write_text(header(layers, inputs, outputs))
    flown, states = Flown(tmp_path / "actor.h"), with_history(Starts()(RNG, 5))
    assert np.allclose(flown.outputs(inputs), outputs, atol=1e-6) and flown.numbers == sum(SIZES[:6]) == 13_828
    assert np.array_equal(flown.command(states), flown.outputs(see_all(states))) and len(flown.digest) == 64
    assert fly(flown.command, Starts()(RNG, 3)).kept.shape == (3,)


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        (lambda text: text.replace("memory", "other", 1), "expected"),
        (lambda text: text.replace("{", "{256, 0, 0, 0, ", 1), "no float32"),
        (lambda text: text.replace("{", "{7, ", 1), "no float32"),
        (lambda text: text.replace("{", "{0, 0, 0, 0, ", 1), "expected"),
        (lambda text: text + " " * 2**21, "bytes"),
        (lambda text: text[: len(text) // 2], "expected"),
    ],
)
def test_a_spoilt_header_is_refused(spoilt, said, tmp_path):
    (tmp_path / "actor.h").write_text(header(*network(), spoilt))
    with pytest.raises(ValueError, match=said):
        Flown(tmp_path / "actor.h")


@pytest.mark.parametrize(("number", "said"), [(np.nan, "finite"), (0.5, "its own test"), (3e38, "its own test")])
def test_a_network_that_misses_its_own_test_is_refused(number, said, tmp_path):
    layers, inputs, outputs = network()
    layers[2][1][3] = number
    if number > 1:  # its outputs are no numbers
        layers[0][0][:, 0] = number * np.sign(inputs) * np.tile([1, -1], 73)
    (tmp_path / "actor.h").write_text(header(layers, inputs, outputs))
    with pytest.raises(ValueError, match=said):
        Flown(tmp_path / "actor.h")
