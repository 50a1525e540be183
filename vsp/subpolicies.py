"""Classes of sub-policy, and the sub-policies of all cells, stacked in one array, so that one step trains them all.

A class is a `Form`: what one sub-policy makes of a state and of its parameters (p, m), one column per action, the last
row a bias. To add one, write a function of the task that returns its `Form`, and enter it in `FORMS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from .checks import check_array, check_choice, check_count
from .envs import Task

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8  # Adam (Kingma & Ba 2015), its published constants
RIDGE = 1e-6  # what the present parameters weigh in a fit, in states: a millionth of one
HIDDEN = 4  # tanh units of a network

Pullback = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Form:
    """A class of sub-policy that is linear in its parameters: output = features @ weights + bias.

    Features are in the units of the task, so that equations read in them; where `sizes` are not 1, training works on
    features divided by these, for one step size to fit all.
    """

    name: str
    terms: tuple[str, ...]  # symbols of the q features
    code: tuple[str, ...]  # the features, as C and Python compute them from an array `state`
    sizes: np.ndarray  # (q,) the largest that each feature comes to in the state box; 1 for raw features
    features: Callable[[np.ndarray], np.ndarray]  # states (..., d) to features (..., q)

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the p rows of the parameters."""
        return (*self.terms, "bias")

    @property
    def units(self) -> np.ndarray:
        """What training multiplies each row of the parameters with. (p, 1)"""
        return np.append(self.sizes, 1.0)[:, None]

    @property
    def bounds(self) -> np.ndarray:
        """First parameters are uniform in +- this / `units`: 1 / sqrt(inputs), as torch.nn.Linear has it. (p, 1)"""
        return np.full((len(self.rows), 1), 1.0 / np.sqrt(max(1, len(self.terms))))

    def outputs(self, features: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Actions (..., m) at features (..., q) with parameters (..., p, m), not limited to the action box."""
        return np.einsum("...q,...qm->...m", features, parameters[..., :-1, :]) + parameters[..., -1, :]

    def batch(self, inputs: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, Pullback]:
        """Outputs (c, B, m) of c cells with parameters (c, p, m) at `inputs` (c, B, q + 1), features and a 1; and the
        function from the loss's gradient by these outputs to that by the parameters."""
        return inputs @ parameters, lambda error: inputs.transpose(0, 2, 1) @ error

    def contributions(self, state: np.ndarray, parameters: np.ndarray) -> pd.DataFrame:
        """What adds up to the output at `state` (d,): a row per action (m,), a column per feature and the bias."""
        return pd.DataFrame(parameters.T * np.append(self.features(state), 1.0), columns=list(self.rows))

    def expression(self, column: np.ndarray, digits: int | None, symbol: Callable[[str], str] = str) -> str:
        """One action's output as text: parameters (p,), and how a variable's name is printed."""
        return expression(column, tuple(symbol(term) for term in self.terms), digits)


@dataclass(frozen=True)
class Network(Form):
    """A network per action with one hidden layer of `HIDDEN` tanh units. Its features are the inputs.

    Parameters of an action: the weights of the first input to every unit, those of the next, the units' biases, the
    units' weights, the bias. Units may stand in any order, so a merge, which compares parameters as they are, can miss
    two networks that compute the same.
    """

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the p rows of the parameters; the last number is that of the unit."""
        units = range(1, HIDDEN + 1)
        return (*(f"{name}_{h}" for name in (*self.terms, "bias", "unit") for h in units), "bias")

    @property
    def units(self) -> np.ndarray:
        """Those of the inputs for the weights of the units, else 1. (p, 1)"""
        return np.concatenate([np.repeat(self.sizes, HIDDEN), np.ones(2 * HIDDEN + 1)])[:, None]

    @property
    def bounds(self) -> np.ndarray:
        """As torch.nn.Linear has them, layer by layer. (p, 1)"""
        hidden = (len(self.terms) + 1) * HIDDEN
        fan_in = np.repeat([len(self.terms), HIDDEN], [hidden, HIDDEN + 1])
        return 1.0 / np.sqrt(fan_in)[:, None]

    def _layers(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights of the units (..., q + 1, HIDDEN, m) and of the output (..., HIDDEN, m), its bias (..., m)."""
        *stack, _, m = parameters.shape
        hidden = parameters[..., : -HIDDEN - 1, :].reshape(*stack, len(self.terms) + 1, HIDDEN, m)
        return hidden, parameters[..., -HIDDEN - 1 : -1, :], parameters[..., -1, :]

    def outputs(self, features: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Actions (..., m) at inputs (..., q) with parameters (..., p, m), not limited to the action box."""
        hidden, weights, bias = self._layers(parameters)
        units = np.tanh(np.einsum("...q,...qhm->...hm", features, hidden[..., :-1, :, :]) + hidden[..., -1, :, :])
        return (units * weights).sum(axis=-2) + bias

    def batch(self, inputs: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, Pullback]:
        """As `Form.batch`; the gradient is written out."""
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
        """To first order only: each input times the output's slope along it, and the rest, which is no one's."""
        hidden, weights, _ = self._layers(parameters)
        units = np.tanh(np.tensordot(state, hidden[:-1], 1) + hidden[-1])
        first = np.einsum("q,qhm,hm->mq", state, hidden[:-1], weights * (1.0 - units**2))
        rest = self.outputs(state, parameters) - first.sum(axis=1)
        return pd.DataFrame(np.column_stack([first, rest]), columns=[*self.terms, "rest"])

    def expression(self, column: np.ndarray, digits: int | None, symbol: Callable[[str], str] = str) -> str:
        """One action's output as text, such as "0.5 tanh(1.2 x - 0.3 v + 0.1) + ... + 0.2"."""
        hidden, weights, bias = self._layers(column[:, None])
        inner = [super(Network, self).expression(one, digits, symbol) for one in hidden[..., 0].T]
        names = tuple(f"{symbol('tanh')}({text})" for text in inner)
        return expression(np.append(weights, bias), names, digits)


def form_of(sub_policy: str, task: Task) -> Form:
    """The class of sub-policy of that name, for `task`. Raises ValueError for an unknown name, and for "pid" where the
    task has no signals."""
    check_choice("sub_policy", sub_policy, FORMS)
    return FORMS[sub_policy](task)


def _constant(task: Task) -> Form:
    """One action for the whole cell, as in a table."""
    return Form("constant", (), (), np.ones(0), lambda states: states[..., :0])


def _linear(task: Task) -> Form:
    """The paper's. States as they are, and so trained as they are."""
    return Form("linear", task.inputs, _states(task), np.ones(len(task.inputs)), lambda states: states)


def _quadratic(task: Task) -> Form:
    """Also the squares of all inputs and the products of any two."""
    pairs = np.triu_indices(len(task.inputs))
    squares = [f"({name})²" if " " in name else f"{name}²" for name in task.inputs]
    terms = [squares[i] if i == j else f"{task.inputs[i]}·{task.inputs[j]}" for i, j in zip(*pairs)]
    code = [f"state[{i}] * state[{j}]" for i, j in zip(*pairs)]

    def features(states: np.ndarray) -> np.ndarray:
        return np.concatenate([states, states[..., pairs[0]] * states[..., pairs[1]]], axis=-1)

    return Form("quadratic", (*task.inputs, *terms), (*_states(task), *code), features(_reach(task)), features)


def _pid(task: Task) -> Form:
    """Proportional to an error and to its derivative, the signals that the task names.

    A function of the state has no memory, hence no integral. Where the error settles, the integral of a controller
    does too, at the action that holds it there: the bias of each cell takes its place.
    """
    signals = task.signals
    if signals is None:
        raise ValueError(
            f"{task.name} names no error and so has no sub_policy 'pid', expected a task with `signals`, such as "
            "MountainCarContinuous-v0 or Pendulum-v1: give the task signals or take another sub_policy"
        )
    return Form("pid", signals.names, signals.code, np.array(signals.sizes), signals.compute)


def _network(task: Task) -> Network:
    return Network("network", task.inputs, _states(task), _reach(task), lambda states: states)


def _states(task: Task) -> tuple[str, ...]:
    return tuple(f"state[{i}]" for i in range(len(task.inputs)))


def _reach(task: Task) -> np.ndarray:
    """The largest that each input comes to in the state box; 1 where it has no limit. (d,)"""
    reach = np.maximum(np.abs(task.low), np.abs(task.high))
    return np.where(np.isfinite(reach) & (reach > 0), reach, 1.0)


FORMS = {"constant": _constant, "linear": _linear, "quadratic": _quadratic, "pid": _pid, "network": _network}


class SubPolicies:
    """One sub-policy of a class per cell, trained on the mean squared error of its actions (m,)."""

    def __init__(self, form: Form, m: int, *, initial: str = "uniform"):
        self.form, self.initial = form, initial
        self.parameters = np.zeros((0, len(form.rows), m))  # (k, p, m)
        self._mean = np.zeros_like(self.parameters)  # Adam's moments
        self._square = np.zeros_like(self.parameters)
        self._steps = np.zeros(0, dtype=np.int64)
        self._units = form.units

    def add(self, rng: np.random.Generator) -> None:
        """Append an untrained cell."""
        shape = (1, *self.parameters.shape[1:])
        bounds = self.form.bounds / self._units if self.initial == "uniform" else np.zeros((shape[1], 1))
        self.parameters = np.concatenate([self.parameters, rng.uniform(-bounds, bounds, size=shape)])
        self._mean = np.concatenate([self._mean, np.zeros(shape)])
        self._square = np.concatenate([self._square, np.zeros(shape)])
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
        return self.form.outputs(self.form.features(state), self.parameters[cell])

    def comparable(self) -> np.ndarray:
        """The parameters in the units of the training, in which one limit fits all. (k, p, m)"""
        return self.parameters * self._units

    def train(self, cells: np.ndarray, inputs: np.ndarray, actions: np.ndarray, *, learning_rate: float) -> np.ndarray:
        """One Adam step of each of `cells` (c,) on its own minibatch of B states.

        `inputs` (c, B, q + 1) are features and end in a column of ones, `actions` are (c, B, m). Returns the mean
        squared error of each minibatch before the step. (c,)
        """
        theta = self.parameters[cells]
        outputs, pull_back = self.form.batch(inputs, theta)
        error = outputs - actions
        gradient = (2.0 / error[0].size) * pull_back(error)
        mean = BETA1 * self._mean[cells] + (1 - BETA1) * gradient
        square = BETA2 * self._square[cells] + (1 - BETA2) * gradient**2
        steps = self._steps[cells] + 1
        rate = (learning_rate / (1 - BETA1**steps))[:, None, None]
        spread = np.sqrt(square / (1 - BETA2**steps)[:, None, None]) + EPSILON
        self.parameters[cells] = theta - rate * mean / spread / self._units
        self._mean[cells], self._square[cells], self._steps[cells] = mean, square, steps
        return np.square(error).mean(axis=(1, 2))

    def solve(self, cells: np.ndarray, products: np.ndarray, targets: np.ndarray) -> None:
        """Least squares for each of `cells` (c,) from what `Sums` holds of them: X'X (c, p, p) and X'y (c, p, m).

        A whisper of a ridge pulls towards the present parameters, so that what the states leave open stays as it is.
        Solving again for the same sums goes the rest of the way: only plain least squares stays where it is.
        """
        theta, units = self.parameters[cells], self._units
        slope = (targets - products @ theta) / units
        ridged = products / units / units.T + RIDGE * np.eye(len(units))
        self.parameters[cells] = theta + np.linalg.solve(ridged, slope) / units


def expression(coefficients: np.ndarray, names: tuple[str, ...], digits: int | None = 3) -> str:
    """A linear expression as text: coefficients (q + 1,), the last one the bias, of the variables `names` (q,).

    `digits` are decimals; None: each number exactly, as short as it can be written, and no term that is zero.
    """
    coefficients = check_array("coefficients", coefficients, (len(names) + 1,))
    terms = [(c, name) for c, name in zip(coefficients, [*names, ""]) if c or digits is not None]
    parts = [f"{'-' if c < 0 else '+'} {number(abs(c), digits)} {name}".rstrip() for c, name in terms] or ["+ 0"]
    text = " ".join(parts)
    return text.removeprefix("+ ") if text.startswith("+") else "-" + text[2:]


def number(value: float, digits: int | None) -> str:
    """A number with so many decimals; None: exactly, as short as it can be written."""
    if digits is not None:
        check_count("digits", digits, least=0)
    return np.format_float_positional(value, trim="-") if digits is None else f"{value:.{digits}f}"
