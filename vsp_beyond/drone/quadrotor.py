"""A Crazyflie quadrotor that has to hover at the origin: rigid body and motor lag, on arrays of states.

Dynamics and constants are those in which the network of "Learning to Fly in Seconds" (Eschmann, Albani, Loianno 2024,
arXiv 2311.13081) was trained: github.com/arplaboratory/learning-to-fly, `simulator/parameters/dynamics/crazy_flie.h`.
There is no air drag, wind, ground or noise.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from vsp.tasks import PIT, RUNNING, Task

G = 9.81  # m/s2
MOST_RPM = 21_702.0
THRUST = 3.16e-10  # N per rpm2
STEP = 0.01  # s
HISTORY = 32  # commands that the flown network sees
ROOM = 3.0  # m from the origin along each axis
ARM, TORQUE = 0.028, 0.005964552  # m from the axes to a motor; m of yaw torque per thrust
# Of four motors about the body's axes x, y, z, per thrust: front right, back right, back left, front left
TORQUES = np.array([[-ARM, -ARM, -TORQUE], [-ARM, ARM, TORQUE], [ARM, ARM, -TORQUE], [ARM, -ARM, TORQUE]])
INPUTS = ("x", "y", "z", "ex", "ey", "ez", "vx", "vy", "vz", "p", "q", "r", "n1", "n2", "n3", "n4")
LABELS = (
    *(f"position {axis} (m)" for axis in "xyz"), *(f"attitude error {axis} (sin of the angle)" for axis in "xyz"),
    *(f"velocity {axis} (m/s)" for axis in "xyz"), "roll rate (rad/s)", "pitch rate (rad/s)", "yaw rate (rad/s)",
    *(f"remembered speed of motor {i} (-1: none, 1: 21,702 rpm)" for i in range(1, 5)),
)  # fmt: skip
# Of the inputs: position and velocity as the flown network's firmware limits them, rates as the gyroscope does
HIGH = np.repeat([0.5, 1.0, 2.0, 35.0, 1.0], [3, 3, 3, 3, 4])
POSITION, ATTITUDE, VELOCITY, RATES, MOTORS, MEMORY = (slice(*ends) for ends in
    ((0, 3), (3, 7), (7, 10), (10, 13), (13, 17), (17, 21)))  # fmt: skip  # of a state's numbers; then the history


@dataclass(frozen=True)
class Body:
    """What a perturbation changes."""

    mass: float = 0.027  # kg
    inertia: tuple[float, float, float] = (3.85e-6, 3.85e-6, 5.9675e-6)  # kg m2
    lag: float = 0.15  # s, time constant of the motors
    delay: int = 0  # steps until the motors get a command, in states with a history


CRAZYFLIE = Body()
HOVER = 2 * np.sqrt(CRAZYFLIE.mass * G / 4 / THRUST) / MOST_RPM - 1  # command at which thrust and weight are equal


@dataclass(frozen=True)
class Starts:
    """Limits of start states, each uniform: position (m), velocity (m/s), rates (rad/s), and tilt (degrees), a turn
    about an axis of any direction. The motors turn as in hovering, and the controller remembers that."""

    position: float = 0.2
    velocity: float = 0.3
    rates: float = 0.3
    tilt: float = 120.0

    def __call__(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """Draw n states (n, 21)."""
        states = np.full((n, 21), HOVER)
        for part, most in ((POSITION, self.position), (VELOCITY, self.velocity), (RATES, self.rates)):
            states[:, part] = rng.uniform(-most, most, (n, 3))
        axis, half = rng.normal(size=(n, 3)), np.deg2rad(rng.uniform(0, self.tilt, (n, 1))) / 2
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        states[:, ATTITUDE] = np.hstack([np.cos(half), np.sin(half) * axis])
        return states


def derivative(states: np.ndarray, commands: np.ndarray, body: Body) -> np.ndarray:
    """Return the time derivative (n, 17) of position, attitude, velocity, rates and motors. Commands are (n, 4)."""
    w, x, y, z = states[:, ATTITUDE].T
    p, q, r = states[:, RATES].T
    thrusts = THRUST * (MOST_RPM / 2 * (1 + states[:, MOTORS])) ** 2
    torques, lift = thrusts @ TORQUES, thrusts.sum(axis=1) / body.mass
    i, j, k = body.inertia
    change = np.empty((len(states), 17))
    change[:, POSITION] = states[:, VELOCITY]
    change[:, 3] = -(x * p + y * q + z * r) / 2
    change[:, 4] = (w * p + y * r - z * q) / 2
    change[:, 5] = (w * q + z * p - x * r) / 2
    change[:, 6] = (w * r + x * q - y * p) / 2
    change[:, 7] = 2 * (x * z + w * y) * lift
    change[:, 8] = 2 * (y * z - w * x) * lift
    change[:, 9] = (1 - 2 * (x * x + y * y)) * lift - G
    change[:, 10] = (torques[:, 0] - (k - j) * q * r) / i
    change[:, 11] = (torques[:, 1] - (i - k) * r * p) / j
    change[:, 12] = (torques[:, 2] - (j - i) * p * q) / k
    change[:, MOTORS] = (commands - states[:, MOTORS]) / body.lag
    return change


def advance(states: np.ndarray, commands: np.ndarray, body: Body = CRAZYFLIE) -> np.ndarray:
    """Return the states (n, 21 or more) after one step: Runge-Kutta 4, the attitude set to length 1 again.

    What a controller remembers moves on, too: the motor speeds as they would be in a Crazyflie, from its commands."""
    commands, now = np.clip(commands, -1.0, 1.0), states[:, :17]
    got = np.hstack([states[:, 21:], commands])[:, -4 * (body.delay + 1) :][:, :4]
    first = derivative(now, got, body)
    second = derivative(now + STEP / 2 * first, got, body)
    third = derivative(now + STEP / 2 * second, got, body)
    fourth = derivative(now + STEP * third, got, body)
    after = now + STEP / 6 * (first + 2 * second + 2 * third + fourth)
    after[:, ATTITUDE] /= np.linalg.norm(after[:, ATTITUDE], axis=1, keepdims=True)
    memory = commands + np.exp(-STEP / CRAZYFLIE.lag) * (states[:, MEMORY] - commands)
    history = np.hstack([states[:, 21:], commands])[:, 4:]  # the oldest leaves; none without a history
    return np.hstack([after, memory, history])


def rotation(attitudes: np.ndarray) -> np.ndarray:
    """Return the matrices (n, 3, 3) of the unit quaternions w, x, y, z (n, 4)."""
    w, x, y, z = attitudes.T
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def see(states: np.ndarray) -> np.ndarray:
    """Return the 16 inputs of a controller (n, 16), position, velocity and rates limited to `HIGH`.

    The attitude's error is half the skew part of the rotation matrix: the sine of the angle times the axis."""
    error = 2 * states[:, 3:4] * states[:, 4:7]
    seen = np.hstack([states[:, POSITION], error, states[:, VELOCITY], states[:, RATES], states[:, MEMORY]])
    return np.clip(seen, -HIGH, HIGH)


def see_all(states: np.ndarray) -> np.ndarray:
    """Return the 146 inputs of the flown network in states with a history (n, 149): instead of the error the rotation
    matrix, instead of the motor speeds the last 32 commands, oldest first."""
    seen = see(states)
    return np.hstack([seen[:, :3], rotation(states[:, ATTITUDE]).reshape(-1, 9), seen[:, 6:12], states[:, 21:]])


def step(states: np.ndarray, actions: np.ndarray, body: Body = CRAZYFLIE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fly one step. One near the origin, level and calm, earns up to .1; leaving the room costs 2."""
    after = advance(states, actions, body)
    distance = np.linalg.norm(after[:, POSITION], axis=1)
    calm = np.abs(after[:, RATES]).sum(axis=1) / 200 + np.abs(actions - states[:, MEMORY]).mean(axis=1) / 10
    rewards = 0.1 - 0.05 * (distance + 1 - after[:, 3] ** 2) - 0.1 * calm
    lost = (np.abs(after[:, POSITION]) > ROOM).any(axis=1)
    return after, np.where(lost, -2.0, rewards), np.where(lost, PIT, RUNNING)


def quadrotor(starts: Starts = Starts(), body: Body = CRAZYFLIE) -> Task:
    """Return the task: to hover at the origin for 5 s. An episode fails ("pit") that leaves the room."""
    return Task(
        name="Quadrotor-v0", inputs=INPUTS, outputs=("u1", "u2", "u3", "u4"), input_labels=LABELS,
        low=-HIGH, high=HIGH, action_low=-np.ones(4), action_high=np.ones(4), max_steps=500,
        start=starts, step=partial(step, body=body), see=see, start_size=21,
    )  # fmt: skip
