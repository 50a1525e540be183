"""Fly many times at once, and measure: how often a drone stays in the room, how far from its aim, how calm."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsp.rollouts import Policy

from .quadrotor import (
    ATTITUDE,
    CRAZYFLIE,
    HISTORY,
    HOVER,
    MOST_RPM,
    POSITION,
    ROOM,
    VELOCITY,
    Body,
    Starts,
    advance,
    see,
)

Command = Callable[[np.ndarray], np.ndarray]  # states with a history (n, 149) to commands (n, 4)
STEPS, LAST = 500, 100  # of a flight, and of its last second
PUSH_AT, PUSH = 200, 0.5  # step, and m/s in a direction of its own for each flight
BODIES = {
    "as built": CRAZYFLIE,
    "mass + 20 %": replace(CRAZYFLIE, mass=1.2 * CRAZYFLIE.mass),
    "mass - 20 %": replace(CRAZYFLIE, mass=0.8 * CRAZYFLIE.mass),
    "inertia x 2": replace(CRAZYFLIE, inertia=(7.7e-6, 7.7e-6, 11.935e-6)),
    "motor lag x 1.5": replace(CRAZYFLIE, lag=1.5 * CRAZYFLIE.lag),
    "motor lag x .5": replace(CRAZYFLIE, lag=0.5 * CRAZYFLIE.lag),
}
EASY = [Starts(tilt=tilt) for tilt in (60, 90, 120, 180)]
HARD = [Starts(position=0.3, velocity=1.0, rates=1.0, tilt=tilt) for tilt in (60, 90, 120, 180)]


class Flights(NamedTuple):
    """How n flights went; what those lost would have done is not measured (NaN)."""

    kept: np.ndarray  # (n,) whether it never left the room
    distance: np.ndarray  # (n,) m from the origin at the end
    change: np.ndarray  # (n,) rpm, mean change of a command per step in the last second


def command_of(policy: Policy) -> Command:
    """Return how a policy of the 16 inputs flies."""
    return lambda states: np.asarray(policy.predict(see(states))[0], np.float64)


def with_history(starts: np.ndarray) -> np.ndarray:
    """Return states (n, 149): the drones have hovered before."""
    return np.hstack([starts, np.full((len(starts), 4 * HISTORY), HOVER)])


def fly(
    command: Command, starts: np.ndarray, body: Body = CRAZYFLIE, *, pushes: np.ndarray | None = None,
    watch: Callable[[int, np.ndarray, np.ndarray], object] = lambda step, states, commands: None,
) -> Flights:  # fmt: skip
    """Fly from each start (n, 21) for five seconds; `pushes` (n, 3) are added to the velocities after two.

    `watch` sees each step's number, states (n, 149), and commands (n, 4). What has left the room is held at its centre.
    """
    states, kept = with_history(starts), np.ones(len(starts), dtype=bool)
    change, before = np.zeros(len(starts)), None
    for step in range(STEPS):
        if pushes is not None and step == PUSH_AT:
            states[:, VELOCITY] += pushes
        commands = np.clip(command(states), -1.0, 1.0)
        watch(step, states, commands)
        if step >= STEPS - LAST:
            change += np.abs(commands - before).mean(axis=1)
        before, states = commands, advance(states, commands, body)
        kept &= (np.abs(states[:, POSITION]) <= ROOM).all(axis=1)
        states[~kept, :13], states[~kept, ATTITUDE.start] = 0.0, 1.0
    distance = np.linalg.norm(states[:, POSITION], axis=1)
    change *= MOST_RPM / 2 / LAST
    return Flights(kept, *(np.where(kept, numbers, np.nan) for numbers in (distance, change)))
