from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import Constant

from vsp.rollouts import rollout
from vsp.tasks import PIT, TRUNCATED
from vsp_beyond.drone import quadrotor as q
from vsp_beyond.drone.flights import BODIES, EASY, HARD, command_of, fly, with_history
from vsp_beyond.drone.quadrotor import CRAZYFLIE, HOVER, Starts

RNG = np.random.default_rng(0)
STILL = Constant(*4 * [HOVER])  # keeps a level drone where it is
STATES = Starts(0.3, 1.0, 5.0, 180.0)(RNG, 50)
COMMANDS = RNG.uniform(-1, 1, (50, 4))


def second_route(state, command, body):
    """A step with a rotation matrix and cross products instead of a quaternion, by a method of high order."""
    arms = 0.028 * np.array([[1, -1, 0], [-1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    inertia, start = np.diag(body.inertia), Rotation.from_quat(state[[4, 5, 6, 3]]).as_matrix()

    def change(_, y):
        turned, rates, motors = y[3:12].reshape(3, 3), y[15:18], y[18:]
        lifts = 3.16e-10 * (21_702 * (motors + 1) / 2) ** 2
        forces = np.outer(lifts, [0, 0, 1])
        torque = np.cross(arms, forces).sum(axis=0) + [0, 0, 0.005964552 * lifts @ [-1, 1, -1, 1]]
        skew = np.cross(np.eye(3), rates)
        spin = np.linalg.solve(inertia, torque - np.cross(rates, inertia @ rates))
        fall = turned @ forces.sum(axis=0) / body.mass - [0, 0, 9.81]
        return np.concatenate([y[12:15], (turned @ skew).ravel(), fall, spin, (command - motors) / body.lag])

    y = np.concatenate([state[:3], start.ravel(), state[7:13], state[13:17]])
    return solve_ivp(change, (0, 0.01), y, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


@pytest.mark.parametrize("name", BODIES)
def test_a_step_is_that_of_a_second_integrator(name, monkeypatch):
    """Half the step makes an error a sixteenth, as Runge-Kutta 4 does, until only the second integrator's is left."""
    known = np.stack([second_route(*each, BODIES[name]) for each in zip(STATES, COMMANDS)])
    errors = []
    for n in (1, 2, 16):
        after = STATES
        monkeypatch.setattr(q, "STEP", 0.01 / n)
        for _ in range(n):
            after = q.advance(after, COMMANDS, BODIES[name])
        turned = Rotation.from_quat(after[:, [4, 5, 6, 3]]).as_matrix().reshape(-1, 9)
        errors.append(np.abs(np.hstack([after[:, :3], turned, after[:, 7:17]]) - known).max())
    assert errors[0] < 1e-4 and 12 < errors[0] / errors[1] < 20 and errors[2] < 1e-8
    assert np.allclose(np.linalg.norm(after[:, q.ATTITUDE], axis=1), 1)


def test_a_level_drone_hovers_and_one_without_power_falls():
    still = Starts(0, 0, 0, 0)(RNG, 1)
    assert np.abs(q.advance(still, np.full((1, 4), HOVER)) - still).max() < 1e-15
    still[:, q.MOTORS] = -1
    fallen = q.advance(still, np.full((1, 4), -9.0))  # limited to -1
    assert fallen[0, 2] == pytest.approx(-9.81 * 0.01**2 / 2) and fallen[0, 9] == pytest.approx(-0.0981)


def test_what_a_controller_remembers_are_the_motors_of_the_drone_as_built():
    states = with_history(STATES)
    for i in range(40):
        commands = COMMANDS[(np.arange(50) + i) % 50]
        states = q.advance(states, commands)
    assert np.abs(states[:, q.MEMORY] - states[:, q.MOTORS]).max() < 1e-6
    assert np.array_equal(states[:, -4:], commands) and states.shape == (50, 149)
    slow = q.advance(STATES, COMMANDS, BODIES["motor lag x 1.5"])
    assert np.abs(slow[:, q.MEMORY] - slow[:, q.MOTORS]).max() > 1e-3


def test_inputs_by_another_route():
    matrices = Rotation.from_quat(STATES[:, [4, 5, 6, 3]]).as_matrix()
    skew = (matrices - matrices.swapaxes(1, 2)) / 2
    seen, wide = q.see(STATES), q.see_all(with_history(STATES))
    assert np.allclose(seen[:, 3:6], skew[:, [2, 0, 1], [1, 2, 0]])
    assert np.allclose(wide[:, 3:12], matrices.reshape(50, 9))
    far = STATES.copy()
    far[:, :3], far[:, 7:13] = 2.0, -99.0
    assert (q.see(far)[:, :3] == 0.5).all() and q.see(far)[0, 6:12].tolist() == [-2.0] * 3 + [-35.0] * 3
    assert np.array_equal(q.see_all(with_history(far))[:, 12:18], q.see(far)[:, 6:12])


def test_starts_keep_their_limits():
    states = Starts(tilt=60.0)(RNG, 2000)
    angles = np.rad2deg(Rotation.from_quat(states[:, [4, 5, 6, 3]]).magnitude())
    assert 58 < angles.max() < 60 and abs(angles.mean() - 30) < 2 and (states[:, 13:] == HOVER).all()
    for part, most in ((slice(0, 3), 0.2), (slice(7, 10), 0.3), (slice(10, 13), 0.3)):
        assert 0.99 * most < np.abs(states[:, part]).max() <= most


def test_episodes_end_outside_the_room():
    starts = Starts(tilt=0.0)(RNG, 2)
    starts[0, 7:10], starts[1, 7:10] = (0.7, 0, 0), 0.0
    starts[:, 10:13] = 0
    played = rollout(STILL, q.quadrotor(), starts)
    assert played.outcomes.tolist() == [PIT, TRUNCATED] and 380 < played.lengths[0] < 440 and played.lengths[1] == 500
    distance = np.linalg.norm(starts[1, :3])
    assert played.returns[1] == pytest.approx(500 * (0.1 - 0.05 * distance)) and played.returns[0] < 50 - 2
    flown = fly(command_of(STILL), starts)
    assert flown.kept.tolist() == [False, True] and flown.distance[1] == pytest.approx(distance)
    assert np.isnan(flown.distance[0]) and flown.change[1] == 0
    assert q.step(starts + 3.5 * np.eye(21)[0], np.full((2, 4), HOVER))[1].tolist() == [-2, -2]


def test_the_change_is_that_of_the_last_second_in_rpm():
    moves = iter(np.repeat([0.001, 0.002], [300, 200]) * (np.arange(500) % 2))
    flown = fly(lambda states: np.full((1, 4), HOVER + next(moves)), Starts(0, 0, 0, 0)(RNG, 1))
    assert flown.change[0] == pytest.approx(0.002 * 21_702 / 2)


def test_a_push_comes_after_two_seconds():
    seen, start, push = [], Starts(0, 0, 0, 0)(RNG, 1), np.array([[0.5, 0, 0]])
    fly(command_of(STILL), start, pushes=push, watch=lambda t, s, c: seen.append(s[0, 7]))
    assert seen[:201] == [0.0] * 200 + [0.5] and seen[-1] == pytest.approx(0.5)


def test_a_late_command_reaches_the_motors_later():
    before, commands = with_history(Starts()(RNG, 4)), RNG.uniform(-1, 1, (3, 4, 4))
    late, hovering = before, np.full((4, 4), HOVER)
    for i, command in enumerate(commands):
        late = q.advance(late, command, replace(CRAZYFLIE, delay=2))
        driven = q.advance(before, hovering if i < 2 else commands[0])
        assert np.array_equal(late[:, :17], driven[:, :17])
        assert np.array_equal(late[:, -4:], command)  # the controller remembers what it has sent
        before = driven


def test_the_bodies_and_starts_are_those_that_are_named():
    bodies = np.array([[body.mass / 0.027, body.inertia[2] / 5.9675e-6, body.lag / 0.15] for body in BODIES.values()])
    assert np.allclose(bodies, [[1, 1, 1], [1.2, 1, 1], [0.8, 1, 1], [1, 2, 1], [1, 1, 1.5], [1, 1, 0.5]])
    assert EASY[-1] == Starts(0.2, 0.3, 0.3, 180) and HARD[-1] == Starts(0.3, 1.0, 1.0, 180)
