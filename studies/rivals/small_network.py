"""A network with one hidden layer and as few parameters as a distilled policy: a baseline without cells."""

import warnings

import numpy as np

from vsp import Task, get_task
from vsp.rollouts import standard


class SmallNetwork:
    """One hidden layer of tanh units on standardised states, fitted by scikit-learn's L-BFGS."""

    ITERATIONS = 500

    def __init__(self, states: np.ndarray, actions: np.ndarray, *, units: int, task: str | Task, seed: int):
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        self.task = get_task(task)
        how = {"activation": "tanh", "solver": "lbfgs", "max_iter": self.ITERATIONS, "max_fun": 2 * self.ITERATIONS}
        model = MLPRegressor(hidden_layer_sizes=(units,), random_state=seed, **how)
        self.centre, self.scale = standard(states)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # the limit of iterations is intended
            model.fit((states - self.centre) / self.scale, actions if actions.shape[1] > 1 else actions[:, 0])
        self.layers = list(zip(model.coefs_, model.intercepts_))  # (d, units), (units,), then (units, m), (m,)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), limited to the action box."""
        (hidden, shift), (weights, bias) = self.layers
        raw = np.tanh((obs - self.centre) / self.scale @ hidden + shift) @ weights + bias
        return np.clip(raw, self.task.action_low, self.task.action_high), None


def units_for(cells: int, task: Task) -> int:
    """Return the largest number of units whose network has at most as many numbers as `cells` Voronoi cells with linear
    maps; at least one."""
    d, m = len(task.low), len(task.action_low)
    numbers = cells * (d + 1) * m + (cells > 1) * (cells + 1) * d
    return max(1, (numbers - m) // (d + 1 + m))
