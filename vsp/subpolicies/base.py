"""`PolicyClass`: how a sub-policy computes actions from a state and its coefficients.

Coefficients (p, m) have a column per action; the last row is the bias.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import check_count
from ..tasks.base import Task

if TYPE_CHECKING:
    import pandas as pd

Pullback = Callable[[np.ndarray], np.ndarray]

# Functions that `PolicyClass.code` may use: C and Python's math have them under the same names
SHARED = ("sin", "cos", "tan", "atan2", "exp", "log", "sqrt", "tanh", "hypot", "fabs", "pow", "remainder")
_CODE = re.compile(rf"(?:state\[\d+\]|\b(?:{'|'.join(SHARED)})\b|(?<=\d)e-?(?=\d)|[-+*/(),. \d])+")
PYTHON = re.compile(r"\*\*|//| if |(?<![.\d])\d+ */ *\d+(?![.\d])")  # what C has not, or takes for something else


@dataclass(frozen=True)
class PolicyClass:
    """A class of sub-policy that is linear in its coefficients: output = features @ weights + bias.

    Features are in the units of the task, and so are the equations. Training divides features by `sizes`, so that one
    step size suits all of them."""

    name: str
    terms: tuple[str, ...]  # symbols of the q features
    code: tuple[str, ...]  # code of the features, valid in C and Python, from an array `state`
    sizes: np.ndarray  # (q,) largest absolute value of each feature in the state box; 1 for raw features
    features: Callable[[np.ndarray], np.ndarray]  # states (..., d) to features (..., q)

    def feature_code(self) -> str:
        """Return code of the features and a final 1, valid in C and Python. Raises ValueError for other code."""
        for code in self.code:
            if PYTHON.search(code) or not _CODE.fullmatch(code):
                raise ValueError(f"code {code!r}, expected arithmetic with state[0], ... and functions of {SHARED}")
        return ", ".join([*self.code, "1.0"])

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the p rows of the coefficients."""
        return (*self.terms, "bias")

    @property
    def units(self) -> np.ndarray:
        """Factors that convert coefficients to their values in training. (p, 1)"""
        return np.append(self.sizes, 1.0)[:, None]

    @property
    def bounds(self) -> np.ndarray:
        """Initial coefficients are uniform in +- `bounds` / `units`: 1 / sqrt(inputs), as in torch.nn.Linear. (p, 1)"""
        return np.full((len(self.rows), 1), 1.0 / np.sqrt(max(1, len(self.terms))))

    def outputs(self, features: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
        """Actions (..., m) at features (..., q) with coefficients (..., p, m), not limited to the action box."""
        return linear_outputs(features, coefficients)

    def batch(self, inputs: np.ndarray, coefficients: np.ndarray) -> tuple[np.ndarray, Pullback]:
        """Return outputs (c, B, m) of c cells with coefficients (c, p, m) at `inputs` (c, B, q + 1): features and a 1.

        Also returns a function that maps the gradient of the loss with respect to these outputs to the gradient with
        respect to the coefficients."""
        return inputs @ coefficients, lambda error: inputs.transpose(0, 2, 1) @ error

    def contributions(self, state: np.ndarray, coefficients: np.ndarray) -> "pd.DataFrame":
        """Return the terms of the output at `state` (d,): m rows, one per action; a column per feature and the bias."""
        import pandas as pd  # here, because it takes long to import

        return pd.DataFrame(coefficients.T * np.append(self.features(state), 1.0), columns=list(self.rows))

    def expression(self, column: np.ndarray, digits: int | None, symbol: Callable[[str], str] = str) -> str:
        """Return one action's output as text, for coefficients (p,); `symbol` formats a variable's name. `digits` is
        the number of decimals. None prints each number exactly, in its shortest form, without terms that are zero."""
        return combination(column, [*map(symbol, self.terms), ""], digits)


def combination(column: np.ndarray, names: Sequence[str], digits: int | None) -> str:
    """Return a sum of `names`, each times its coefficient in `column` (p,), as text; an empty name is a constant.
    `digits` as in `PolicyClass.expression`."""
    terms = [(c, name) for c, name in zip(column, names, strict=True) if c or digits is not None]
    parts = [f"{'-' if c < 0 else '+'} {number(abs(c), digits)} {name}".rstrip() for c, name in terms] or ["+ 0"]
    text = " ".join(parts)
    return text.removeprefix("+ ") if text.startswith("+") else "-" + text[2:]


def linear_outputs(features: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Features (..., q) times weights plus bias, for coefficients (..., q + 1, m). (..., m)"""
    return np.einsum("...q,...qm->...m", features, coefficients[..., :-1, :]) + coefficients[..., -1, :]


def state_code(task: Task) -> tuple[str, ...]:
    """Return code that reads the inputs, valid in C and Python."""
    return tuple(f"state[{i}]" for i in range(len(task.inputs)))


def reach(task: Task) -> np.ndarray:
    """Largest absolute value of each input in the state box; 1 where it has no limit. (d,)"""
    reach = np.maximum(np.abs(task.low), np.abs(task.high))
    return np.where(np.isfinite(reach) & (reach > 0), reach, 1.0)


def number(value: float, digits: int | None) -> str:
    """Format a number with `digits` decimals; None: exactly, in its shortest form."""
    if digits is not None:
        check_count("digits", digits, least=0)
    return np.format_float_positional(value, trim="-") if digits is None else f"{value:.{digits}f}"
