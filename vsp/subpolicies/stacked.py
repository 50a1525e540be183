"""The sub-policies of all cells, stacked in one array, so that one step trains them all."""

import numpy as np

from .base import PolicyClass

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8  # Adam (Kingma & Ba 2015), its published constants
RIDGE = 1e-6  # weight of the current coefficients in a fit, as a number of states


def adam(gradient, mean, square, steps) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Adam's two moments after `gradient`, the last of `steps`, and the spread that divides its step."""
    mean = BETA1 * mean + (1 - BETA1) * gradient
    square = BETA2 * square + (1 - BETA2) * gradient**2
    return mean, square, np.sqrt(square / (1 - BETA2**steps)) + EPSILON


class SubPolicies:
    """One sub-policy per cell, all of the same class, trained on the mean squared error of their actions (m,)."""

    def __init__(self, policy_class: PolicyClass, m: int, *, initial: str = "uniform"):
        self.policy_class, self.initial = policy_class, initial
        self.coefficients = np.zeros((0, len(policy_class.rows), m))  # (k, p, m)
        self._moments = np.zeros((2, *self.coefficients.shape))  # Adam's: of gradients and of their squares
        self._steps = np.zeros(0, dtype=np.int64)
        self._units = policy_class.units

    def add(self, rng: np.random.Generator) -> None:
        """Append an untrained cell."""
        shape = (1, *self.coefficients.shape[1:])
        bounds = self.policy_class.bounds / self._units if self.initial == "uniform" else np.zeros((shape[1], 1))
        self.coefficients = np.concatenate([self.coefficients, rng.uniform(-bounds, bounds, size=shape)])
        self._moments = np.concatenate([self._moments, np.zeros((2, *shape))], axis=1)
        self._steps = np.append(self._steps, 0)

    def keep(self, kept: np.ndarray) -> None:
        """Keep only the cells of the mask `kept` (k,)."""
        self.coefficients, self._moments = self.coefficients[kept], self._moments[:, kept]
        self._steps = self._steps[kept]

    def restart_adam(self, cells: np.ndarray | slice) -> None:
        """Set Adam's moments and step counts of `cells` (c,) to zero."""
        self._moments[:, cells] = 0.0
        self._steps[cells] = 0

    def predict(self, cell: int, state: np.ndarray) -> np.ndarray:
        """Action (m,) of one cell at one state (d,), not limited to the action box."""
        return self.policy_class.outputs(self.policy_class.features(state), self.coefficients[cell])

    def comparable(self) -> np.ndarray:
        """Return the coefficients in the units of training, in which one distance limit suits all. (k, p, m)"""
        return self.coefficients * self._units

    def train(self, cells: np.ndarray, inputs: np.ndarray, actions: np.ndarray, *, learning_rate: float) -> np.ndarray:
        """Take one Adam step for each of `cells` (c,) on its own minibatch of B states.

        `inputs` (c, B, q + 1) are features and a final column of ones; `actions` are (c, B, m). Returns the mean
        squared error of each minibatch before the step. (c,)"""
        chosen = slice(None) if len(cells) == len(self.coefficients) else cells  # all cells: views, no copies
        theta, steps = self.coefficients[chosen], self._steps[chosen] + 1
        outputs, pull_back = self.policy_class.batch(inputs, theta)
        error = outputs - actions
        gradient = (2.0 / error[0].size) * pull_back(error)
        counts = steps[:, None, None]
        mean, square = self._moments[:, chosen]
        mean, square, spread = adam(gradient, mean, square, counts)
        rate = learning_rate / (1 - BETA1**counts)
        self.coefficients[chosen] = theta - rate * mean / spread / self._units
        self._moments[:, chosen], self._steps[chosen] = (mean, square), steps
        return np.square(error).sum(axis=(1, 2)) / error[0].size

    def solve(self, cells: np.ndarray, products: np.ndarray, targets: np.ndarray) -> None:
        """Solve least squares for each of `cells` (c,) from `SufficientStatistics`: X'X (c, p, p) and X'y (c, p, m).

        A small ridge term pulls towards the current coefficients, so coefficients that the states do not determine keep
        their values. Repeated solutions with the same sums converge to plain least squares."""
        theta, units = self.coefficients[cells], self._units
        slope = (targets - products @ theta) / units
        ridged = products / units / units.T + RIDGE * np.eye(len(units))
        self.coefficients[cells] = theta + np.linalg.solve(ridged, slope) / units
