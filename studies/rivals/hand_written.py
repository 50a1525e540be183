"""Hand-written controllers, and a teacher that does nothing."""

from __future__ import annotations

import numpy as np

from vsp import Task


class Heuristic:
    """The hand-written controller of Gymnasium's LunarLander (`gymnasium.envs.box2d.lunar_lander.heuristic`).

    It leans against its drift, keeps a height in proportion to its distance from the pad, and brakes with a leg down.
    """

    PARAMETERS = 12  # numbers in the formulas of `predict`

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return actions (n, 2), main and side engine, for observations (n, 8)."""
        x, y, vx, vy, angle, spin, left, right = np.asarray(obs, dtype=np.float64).T
        down = (left != 0) | (right != 0)
        lean = np.clip(0.5 * x + 1.0 * vx, -0.4, 0.4)
        turn = np.where(down, 0.0, 0.5 * (lean - angle) - 1.0 * spin)
        lift = np.where(down, 0.0, 0.5 * (0.55 * np.abs(x) - y)) - 0.5 * vy
        return np.clip(np.column_stack([20.0 * lift - 1.0, -20.0 * turn]), -1.0, 1.0), None


class PumpAndBalance:
    """Energy-based swing-up of a pendulum, then linear control upright (Åström and Furuta 2000)."""

    PARAMETERS = 6

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return torques (n, 1) for cosine and sine of the angle and angular velocity (n, 3)."""
        cosine, sine, velocity = np.asarray(obs, dtype=np.float64).T
        missing = velocity**2 / 6 + 5.0 * (cosine - 1.0)  # energy of the rod, minus that of standing upright
        torque = np.where(cosine > 0.8, -10.0 * sine - 2.0 * velocity, -2.0 * missing * np.sign(velocity))
        return np.clip(torque, -2.0, 2.0)[:, None], None


class ZeroPolicy:
    """A stand-in for a teacher, whose action is always zero."""

    def __init__(self, task: Task):
        self._action = np.zeros(len(task.action_low))

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return zeros (n, m) for observations (n, d)."""
        return np.tile(self._action, (len(obs), 1)), None
