"""What the critics of a teacher say: the value of an action, and the cost of a wrong one."""

import itertools
from typing import Any

import numpy as np

from vsp.teachers.actors import Actor, layers_of


class Critics:
    """The critics of a teacher. Values are in units of the discounted return. Raises ValueError for a teacher without
    critics, or whose critics give more than a value, as TQC's quantiles."""

    def __init__(self, teacher: Any):
        tensors, self.teacher = getattr(teacher, "critic", {}), teacher
        if not tensors:
            raise ValueError(f"{type(teacher).__name__} has no critics, expected qf0.0.weight, ...: load one with them")
        names, act = sorted({name.partition(".")[0] for name in tensors}), teacher.actor.activation
        self.networks = [Actor(layers_of(tensors, name), act, squashed=False) for name in names]
        if any(len(network.layers[-1][1]) != 1 for network in self.networks):
            raise ValueError("the critics give several numbers for an action, expected one value: not those of TQC")

    def criticality(self, obs: np.ndarray) -> np.ndarray:
        """Return the cost of a wrong action in the states (n, d), the weights of VIPER (Bastani et al. 2018): the value
        of the teacher's own action minus that of the worst corner of the action box, by the lower of its critics; at
        least 0. (n,)"""
        states = self.teacher.inputs(obs)
        corners = np.array(list(itertools.product((-1, 1), repeat=len(self.teacher.half))), dtype=np.float32)
        # The critics see actions in units of the action box, from -1 to 1
        actions = (self.teacher.predict(obs)[0] - self.teacher.centre) / self.teacher.half
        worst = np.min([self._value(states, np.broadcast_to(corner, actions.shape)) for corner in corners], axis=0)
        return np.maximum(self._value(states, actions) - worst, 0.0).astype(np.float64)

    def _value(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        inputs = np.column_stack([states, actions])
        return np.min([network.forward(inputs)[:, 0] for network in self.networks], axis=0)
