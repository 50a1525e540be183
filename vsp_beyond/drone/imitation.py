"""One linear map of 16 inputs, or one for each of a few cells, limited to the commands' range, that flies as a network
flies.

It is fitted to the network's commands on the network's own flights, then also on those of the map (DAgger, Ross et al.
2011). A map that only imitates may chatter: imitation does not see whether its closed loop near hovering is stable.
So what the loop's largest eigenvalue exceeds costs, for each of `flights.BODIES`.
"""

import numpy as np
from threadpoolctl import threadpool_limits

from vsp.policy import VoronoiPolicy
from vsp.run.progress import shown, steps
from vsp.subpolicies.stacked import BETA1, adam
from vsp_beyond.few_cells.search import least_error
from vsp_beyond.few_cells.units import LabelledStates, Scaling

from .flights import BODIES, Command, command_of, fly
from .quadrotor import ATTITUDE, CRAZYFLIE, HOVER, MOST_RPM, MOTORS, THRUST, Body, G, Starts, advance, quadrotor, see

VERSION = 1  # raise it when the same arguments give another map
STARTS = Starts(position=0.3, velocity=1.0, rates=1.0, tilt=150.0)
FLIGHTS, OWN_FLIGHTS, ROUNDS = 800, 50, 4  # of the network; of the map with each body in each round of corrections
EVERY, SEEN = 3, 300  # every third state of a flight's first 300 is kept
N_STEPS, BATCH, RATE = 1200, 2048, 0.02  # of Adam, for each round
SLOPE = 0.01  # of a limited command beyond its limits, in the gradient, so that this does not vanish
DIVIDED = 3  # the first round with cells; before it there is one map
N_STATES, N_DESCENTS = 10_000, 4  # states and descents in the search for cells
CALM, PRICE = 0.987, 1000.0  # largest eigenvalue of a loop that is free; the price of 1 beyond it, squared
TREMBLE, TURN = 0.05, 0.2  # an eigenvalue that turns by more than so many rad a step counts so much more
PARTS = [0, 1, 2, *range(4, 21)]  # of a state near hovering: the attitude's w follows from x, y, z

Loop = tuple[np.ndarray, np.ndarray, np.ndarray]


def loop_of(body: Body) -> Loop:
    """Return the linear step around level hovering at the origin: states' (20, 20), commands' (20, 4), and how the 16
    inputs follow from a state (16, 20). By central differences."""
    rest = np.full((1, 21), 2 * np.sqrt(body.mass * G / 4 / THRUST) / MOST_RPM - 1)
    rest[:, :13], rest[:, ATTITUDE.start] = 0.0, 1.0
    command, tiny = rest[:, MOTORS], 1e-5

    def moved(parts: np.ndarray) -> np.ndarray:
        states = np.repeat(rest, len(parts), axis=0)
        states[:, PARTS] += parts
        states[:, 3] = np.sqrt(1 - np.square(states[:, 4:7]).sum(axis=1))
        return states

    def difference(f, n: int) -> np.ndarray:
        return (f(tiny * np.eye(n)) - f(-tiny * np.eye(n))).T / (2 * tiny)

    here = difference(lambda parts: advance(moved(parts), np.tile(command, (20, 1)), body)[:, PARTS], 20)
    steer = difference(lambda more: advance(np.repeat(rest, 4, axis=0), command + more, body)[:, PARTS], 4)
    return here, steer, difference(lambda parts: see(moved(parts)), 20)


def radius(weights: np.ndarray, loop: Loop) -> tuple[float, np.ndarray]:
    """Return the closed loop's largest absolute eigenvalue under the map `weights` (16, 4), and its gradient.

    What trembles counts `TREMBLE` more, so that it dies out sooner."""
    here, steer, seen = loop
    values, right = np.linalg.eig(here + steer @ weights.T @ seen)
    sizes = np.abs(values) + TREMBLE * (np.abs(np.angle(values)) > TURN)
    i = int(sizes.argmax())
    left = np.linalg.inv(right)[i]
    towards = np.conj(values[i]) / abs(values[i]) * np.outer(seen @ right[:, i], left @ steer)
    return float(sizes[i]), towards.real


@threadpool_limits.wrap(limits=1)
def few_maps(
    command: Command, *, seed: int, n_cells: int = 1, calm: bool = True, memory: bool = True, progress: bool = True
) -> VoronoiPolicy:
    """Distil what flies by `command` into a linear map for each of `n_cells`. The same arguments give the same maps.

    Without `calm` they only imitate; without `memory` they do not see the remembered motor speeds. `progress` shows how
    far it is."""
    used = np.ones((17, 1))
    used[12:16] = memory
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    loops = [loop_of(body) for body in BODIES.values()] if calm else []
    seen, taken = _flown(command, command, STARTS(rng, FLIGHTS))
    hovering = np.zeros((1, 17, 4))
    hovering[:, 16] = HOVER
    policy = VoronoiPolicy(np.zeros((1, 16)), hovering, task=quadrotor())
    with shown(progress):
        for round_ in steps(range(ROUNDS + 1), "maps", total=ROUNDS + 1, unit="rounds"):
            if n_cells > 1 and round_ >= DIVIDED:
                policy = _cells(seen, taken, n_cells, rng)
            policy = _fitted(policy, used, seen, taken, loops, rng)
            if round_ < ROUNDS:
                for body in BODIES.values():
                    more = _flown(command_of(policy), command, STARTS(rng, OWN_FLIGHTS), body)
                    seen, taken = (np.concatenate(both) for both in zip((seen, taken), more))
    return policy


def _cells(seen: np.ndarray, taken: np.ndarray, n_cells: int, rng: np.random.Generator) -> VoronoiPolicy:
    """Return cells with the maps that imitate best."""
    scaling = Scaling.of(quadrotor(), seen)
    labelled = LabelledStates(scaling.inputs(seen), taken).thinned(N_STATES, rng)
    return scaling.policy(least_error(labelled, n_cells, N_DESCENTS, rng))


def _flown(flies: Command, says: Command, starts: np.ndarray, body: Body = CRAZYFLIE) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs (t, 16) of flights by `flies`, and what `says` commands there (t, 4).

    Of what flies by itself, only flights that stay in the room count."""
    seen: list[np.ndarray] = []
    taken: list[np.ndarray] = []

    def watch(step: int, states: np.ndarray, commands: np.ndarray) -> None:
        if step < SEEN and step % EVERY == 0:
            seen.append(see(states))
            taken.append(commands if flies is says else says(states))

    flights = fly(flies, starts, body, watch=watch)
    rows = flights.kept | (flies is not says)
    return np.concatenate([part[rows] for part in seen]), np.concatenate([part[rows] for part in taken])


def _fitted(
    policy: VoronoiPolicy, used: np.ndarray, seen: np.ndarray, taken: np.ndarray, loops: list[Loop],
    rng: np.random.Generator,
) -> VoronoiPolicy:  # fmt: skip
    """Return `policy` with maps after Adam's steps on the squared error of the limited commands; the map that hovers
    pays for its loops."""
    own, hovers = policy.cells(seen), policy.cells(np.append(np.zeros(12), np.full(4, HOVER))[None])[0]
    scale = np.append(seen.std(axis=0) + 1e-9, 1.0)[:, None]
    features, theta = np.hstack([seen, np.ones((len(seen), 1))]) * (used / scale)[:, 0], policy.coefficients * scale
    mean = square = np.zeros_like(theta)
    for i in range(N_STEPS):
        rows = rng.integers(len(features), size=BATCH)
        inputs, cells = features[rows], own[rows]
        raw = (inputs[:, None] @ theta[cells])[:, 0]
        error = (np.clip(raw, -1, 1) - taken[rows]) * np.where(np.abs(raw) <= 1, 1, SLOPE)
        gradient = np.stack([inputs[cells == cell].T @ error[cells == cell] for cell in range(len(policy))]) / BATCH
        for loop in loops:
            largest, towards = radius(theta[hovers, :16] / scale[:16], loop)
            gradient[hovers, :16] += 2 * PRICE * max(0.0, largest - CALM) * towards / scale[:16]
        mean, square, spread = adam(gradient, mean, square, i + 1)
        theta = theta - RATE * (1 - i / N_STEPS) * mean / (1 - BETA1 ** (i + 1)) / spread
    return policy.with_maps(used * theta / scale)
