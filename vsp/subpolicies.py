"""Classes of local model. The models of all cells are stacked in one array, so that one step trains them all."""

from __future__ import annotations

import numpy as np

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8  # Adam (Kingma & Ba 2015), its published constants


class LinearCells:
    """One linear map from states (d,) to actions (m,) per cell, trained by Adam on the mean squared error."""

    def __init__(self, d: int, m: int, *, initial: str = "uniform"):
        self.initial = initial
        self.parameters = np.zeros((0, d + 1, m))  # (k, d + 1, m): weights, then bias
        self._mean = np.zeros((0, d + 1, m))  # Adam's moments
        self._square = np.zeros((0, d + 1, m))
        self._steps = np.zeros(0, dtype=np.int64)

    def add(self, rng: np.random.Generator) -> None:
        """Append an untrained cell."""
        _, rows, m = self.parameters.shape
        bound = 1.0 / np.sqrt(rows - 1) if self.initial == "uniform" else 0.0
        self.parameters = np.concatenate([self.parameters, rng.uniform(-bound, bound, size=(1, rows, m))])
        self._mean = np.concatenate([self._mean, np.zeros((1, rows, m))])
        self._square = np.concatenate([self._square, np.zeros((1, rows, m))])
        self._steps = np.append(self._steps, 0)

    def keep(self, kept: np.ndarray) -> None:
        """Drop all cells but those of the mask `kept` (k,)."""
        self.parameters, self._steps = self.parameters[kept], self._steps[kept]
        self._mean, self._square = self._mean[kept], self._square[kept]

    def restart_adam(self, cells: np.ndarray) -> None:
        """Forget the moments of `cells` (c,)."""
        self._mean[cells] = self._square[cells] = 0.0
        self._steps[cells] = 0

    def predict(self, cell: int, state: np.ndarray) -> np.ndarray:
        """Action (m,) of one cell at one state (d,), not limited to the action box."""
        return state @ self.parameters[cell, :-1] + self.parameters[cell, -1]

    def train(self, cells: np.ndarray, inputs: np.ndarray, actions: np.ndarray, *, learning_rate: float) -> np.ndarray:
        """One Adam step of each of `cells` (c,) on its own minibatch of B states.

        `inputs` (c, B, d + 1) end in a column of ones, `actions` are (c, B, m). Returns the mean squared error of each
        minibatch before the step. (c,)
        """
        theta = self.parameters[cells]
        error = inputs @ theta - actions
        gradient = (2.0 / error[0].size) * (inputs.transpose(0, 2, 1) @ error)
        mean = BETA1 * self._mean[cells] + (1 - BETA1) * gradient
        square = BETA2 * self._square[cells] + (1 - BETA2) * gradient**2
        steps = self._steps[cells] + 1
        rate = (learning_rate / (1 - BETA1**steps))[:, None, None]
        spread = np.sqrt(square / (1 - BETA2**steps)[:, None, None]) + EPSILON
        self.parameters[cells] = theta - rate * mean / spread
        self._mean[cells], self._square[cells], self._steps[cells] = mean, square, steps
        return np.square(error).mean(axis=(1, 2))
