"""What the critics of a teacher say: the value of an action, and the cost of a wrong one."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from vsp.checks import check_array, check_observations
from vsp.teachers.teacher import Teacher, forward, layers_of


class Critics:
    """The two critics of a TD3 teacher. Values are in units of the discounted return.

    Raises ValueError for a teacher without critics.
    """

    def __init__(self, teacher: Teacher):
        named = (layers_of(getattr(teacher, "critic", {}), name) for name in ("qf0", "qf1"))
        self.teacher, self.networks = teacher, [layers for layers in named if layers]
        if not self.networks:
            raise ValueError(f"{type(teacher).__name__} has no critics, expected qf0.0.weight, ...: load one with them")

    def criticality(self, obs: np.ndarray) -> np.ndarray:
        """Return the cost of a wrong action in the states (n, d): the weights of VIPER (Bastani et al. 2018). (n,)

        This is the value of the teacher's own action minus that of the worst corner of the action box, by the lower of
        its two critics; at least 0.
        """
        task = self.teacher.task
        states = check_observations(obs, len(task.low), task.name).astype(np.float32)
        corners = np.array(list(itertools.product((-1, 1), repeat=len(task.action_low))), dtype=np.float32)
        actions = self._scaled(self.teacher.predict(states)[0])
        worst = np.min([self._value(states, np.broadcast_to(corner, actions.shape)) for corner in corners], axis=0)
        return np.maximum(self._value(states, actions) - worst, 0.0).astype(np.float64)

    def value(self, obs: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return the value of `actions` (n, m) in the states (n, d), by the lower of the two critics. (n,)"""
        task = self.teacher.task
        states = check_array("observations", obs, (-1, len(task.low))).astype(np.float32)
        actions = check_array("actions", actions, (len(states), len(task.action_low))).astype(np.float32)
        return self._value(states, self._scaled(actions)).astype(np.float64)

    def _scaled(self, actions: np.ndarray) -> np.ndarray:
        """Return `actions` (n, m) in units of the action box, from -1 to 1, as the critics see them."""
        return (actions - self.teacher.centre) / self.teacher.half

    def _value(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        inputs = np.column_stack([states, actions])
        return np.min([forward(layers, inputs)[:, 0] for layers in self.networks], axis=0)


def critics_of(teacher: Any) -> Critics:
    """Return the critics of `teacher`, or `teacher` itself if it says what is critical."""
    return teacher if hasattr(teacher, "criticality") else Critics(teacher)
