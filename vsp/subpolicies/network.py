"""A class of nonlinear sub-policies: small networks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..tasks.base import Task
from .base import PolicyClass, Pullback, expression, reach, state_code

if TYPE_CHECKING:
    import pandas as pd

HIDDEN = 4  # tanh units of a network


@dataclass(frozen=True)
class Network(PolicyClass):
    """A network per action with one hidden layer of `HIDDEN` tanh units. Its features are the inputs.

    The parameters of an action are, in this order: the weights from the first input to every unit, the same for each
    further input, the units' biases, the weights from the units to the output, the output's bias. A merge compares
    parameters one by one, so it misses equal networks whose units are in a different order.
    """

    OUTPUT_IN_PYTHON = f"""
def output(row, features):
    hidden = [sum(w * f for w, f in zip(row[h::{HIDDEN}], features)) for h in range({HIDDEN})]
    return sum(w * u for w, u in zip(row[-{HIDDEN + 1} :], [*map(tanh, hidden), 1.0]))
"""
    OUTPUT_IN_C = """
static double output(const double *row, const double *features) {
    double sum = row[(INPUTS + 1) * HIDDEN];
    for (int h = 0; h < HIDDEN; h++) {
        double unit = 0.0;
        for (int i = 0; i < INPUTS; i++) unit += row[i * HIDDEN + h] * features[i];
        sum += row[INPUTS * HIDDEN + h] * tanh(unit);
    }
    return sum;
}
""".replace("HIDDEN", str(HIDDEN))

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the p rows of the parameters; a number at the end is that of a unit."""
        units = range(1, HIDDEN + 1)
        return (*(f"{name}_{h}" for name in (*self.terms, "bias", "unit") for h in units), "bias")

    @property
    def units(self) -> np.ndarray:
        """Factors as in `PolicyClass`: `sizes` for the weights of the inputs, 1 for the others. (p, 1)"""
        return np.concatenate([np.repeat(self.sizes, HIDDEN), np.ones(2 * HIDDEN + 1)])[:, None]

    @property
    def bounds(self) -> np.ndarray:
        """Bounds of initial parameters, as in torch.nn.Linear, layer by layer. (p, 1)"""
        hidden = (len(self.terms) + 1) * HIDDEN
        fan_in = np.repeat([len(self.terms), HIDDEN], [hidden, HIDDEN + 1])
        return 1.0 / np.sqrt(fan_in)[:, None]

    def _layers(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return weights of the units (..., q + 1, HIDDEN, m) and of the output (..., HIDDEN, m), its bias (..., m)."""
        *stack, _, m = parameters.shape
        hidden = parameters[..., : -HIDDEN - 1, :].reshape(*stack, len(self.terms) + 1, HIDDEN, m)
        return hidden, parameters[..., -HIDDEN - 1 : -1, :], parameters[..., -1, :]

    def outputs(self, features: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Actions (..., m) at inputs (..., q) with parameters (..., p, m), not limited to the action box."""
        hidden, weights, bias = self._layers(parameters)
        units = np.tanh(np.einsum("...q,...qhm->...hm", features, hidden[..., :-1, :, :]) + hidden[..., -1, :, :])
        return (units * weights).sum(axis=-2) + bias

    def batch(self, inputs: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, Pullback]:
        """Do as `PolicyClass.batch`, with explicit formulas for the gradient."""
        c, size, _ = inputs.shape
        hidden, weights, bias = self._layers(parameters)
        units = np.tanh(inputs @ hidden.reshape(c, inputs.shape[2], -1)).reshape(c, size, *weights.shape[1:])

        def pull_back(error: np.ndarray) -> np.ndarray:
            by_units = (1.0 - units**2) * weights[:, None] * error[:, :, None]
            by_hidden = inputs.transpose(0, 2, 1) @ by_units.reshape(c, size, -1)
            by_weights = (units * error[:, :, None]).sum(axis=1)
            parts = by_hidden.reshape(c, -1, error.shape[2]), by_weights, error.sum(axis=1, keepdims=True)
            return np.concatenate(parts, axis=1)

        return (units * weights[:, None]).sum(axis=2) + bias[:, None], pull_back

    def contributions(self, state: np.ndarray, parameters: np.ndarray) -> pd.DataFrame:
        """Return the output to first order: each input times the output's slope along it. The rest has no input."""
        import pandas as pd  # here, because it takes long to import

        hidden, weights, _ = self._layers(parameters)
        units = np.tanh(np.tensordot(state, hidden[:-1], 1) + hidden[-1])
        first = np.einsum("q,qhm,hm->mq", state, hidden[:-1], weights * (1.0 - units**2))
        rest = self.outputs(state, parameters) - first.sum(axis=1)
        return pd.DataFrame(np.column_stack([first, rest]), columns=[*self.terms, "rest"])

    def expression(self, column: np.ndarray, digits: int | None, symbol: Callable[[str], str] = str) -> str:
        """Return one action's output as text, such as "0.5 tanh(1.2 x - 0.3 v + 0.1) + ... + 0.2"."""
        hidden, weights, bias = self._layers(column[:, None])
        inner = [super(Network, self).expression(one, digits, symbol) for one in hidden[..., 0].T]
        names = tuple(f"{symbol('tanh')}({text})" for text in inner)
        return expression(np.append(weights, bias), names, digits)


def network(task: Task) -> Network:
    """A small network per action that takes the inputs."""
    return Network("network", task.inputs, state_code(task), reach(task), lambda states: states)
