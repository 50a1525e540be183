"""Our quadrotor against `l2f`, the simulator of those who trained the network that flew. Not in environment.lock."""

import json

import numpy as np
import pytest

from vsp_beyond.drone import quadrotor as q

FLIGHTS, STEPS = 200, 100


def test_flights_are_like_those_of_l2f(record):
    """A second from random states; commands around hovering stay for a tenth of it. l2f is in float32."""
    l2f = pytest.importorskip("l2f")
    rng = np.random.default_rng(0)
    commands = q.HOVER + rng.uniform(-0.2, 0.2, (STEPS // 10, FLIGHTS, 4)).repeat(10, axis=0)
    states = q.Starts(0.3, 1.0, 1.0, 180.0)(rng, FLIGHTS)
    theirs = [_Theirs(l2f, state) for state in states]
    unlike = []
    for step in range(STEPS):
        states = q.advance(states, commands[step])
        unlike.append(np.abs(states[:, :17] - [one.advance(commands[step, i]) for i, one in enumerate(theirs)]))
    for part in ("POSITION", "ATTITUDE", "VELOCITY", "RATES", "MOTORS"):
        most = {step: max(one[:, getattr(q, part)].max() for one in unlike[:step]) for step in (1, STEPS)}
        note = f"{FLIGHTS} flights of {STEPS} steps; after the first step {most[1]:.1e}"
        record("same", f"a quadrotor's {part.lower()} against l2f in float32", most[STEPS], "", at_most=2e-3, note=note)


class _Theirs:
    """A drone in l2f, with our parameters, from our state."""

    def __init__(self, l2f, state):
        self.l2f, self.all = l2f, [kind() for kind in (l2f.Device, l2f.Environment, l2f.Parameters, l2f.State)]
        self.rng, self.state = l2f.Rng(), self.all.pop()
        device, environment, parameters = self.all
        l2f.initialize_rng(device, self.rng, 0)
        l2f.initialize_environment(device, environment)
        l2f.initial_parameters(device, environment, parameters)
        known = json.loads(l2f.parameters_to_json(device, environment, parameters))
        thrust, inertia = q.THRUST * q.MOST_RPM**2, np.array(q.CRAZYFLIE.inertia)
        known["dynamics"] |= {
            "rotor_thrust_coefficients": [[0.0, 0.0, thrust]] * 4, "rotor_torque_constants": [q.TORQUE] * 4,
            "rotor_time_constants_rising": [q.CRAZYFLIE.lag] * 4, "mass": q.CRAZYFLIE.mass,
            "rotor_time_constants_falling": [q.CRAZYFLIE.lag] * 4,
            "J": np.diag(inertia).tolist(), "J_inv": np.diag(1 / inertia).tolist(),
        }  # fmt: skip
        l2f.parameters_from_json(device, environment, json.dumps(known), parameters)
        l2f.initial_state(device, environment, parameters, self.state)
        self.state.position, self.state.orientation = state[q.POSITION], state[q.ATTITUDE]
        self.state.linear_velocity, self.state.angular_velocity = state[q.VELOCITY], state[q.RATES]
        self.state.rpm = (1 + state[q.MOTORS]) / 2

    def advance(self, command):
        after = self.l2f.State()
        self.l2f.step(*self.all, self.state, command.tolist(), after, self.rng)
        self.state = after
        numbers = after.position, after.orientation, after.linear_velocity, after.angular_velocity
        return np.concatenate([*numbers, 2 * np.asarray(after.rpm) - 1])
