"""Export a policy as text that needs no vsp: JSON, Python, C, LaTeX and plain words.

Numbers are written so that they read back as the same float64. The cells write their own part (`cells.Cells`).
"""

import json
import re

import numpy as np

from .cells import Cells, Nearest, braces
from .checks import check_count
from .subpolicies.base import SHARED, PolicyClass, number
from .tasks.base import Task

# What LaTeX would take as a command
_SPECIAL = {"\\": r"\backslash ", "^": r"\wedge ", "~": r"\sim "} | {one: f"\\{one}" for one in "%&#$_{}"}
_SYMBOLS = {"Δ": r"\Delta ", "θ": r"\theta", "ω": r"\omega", "τ": r"\tau"}
PROTOTYPES = """/* The index of the cell; -1 for a state that is not finite. */
int vsp_cell(const double *state);
void vsp_act(const double *state, double *action);
"""
_FUNCTION = re.compile(r"\b(sin|cos|tan|tanh|exp|log)\b(?=[ (])")  # as in "sin θ" or "sin(3 x)"


class Exportable:
    """The exports of a policy as methods: `PiecewisePolicy` inherits them and sets the fields that they read."""

    task: Task
    policy_class: PolicyClass
    where: Cells
    coefficients: np.ndarray  # (k, p, m)

    def __len__(self) -> int:
        return len(self.where)

    def equations(self, cell: int, digits: int | None = 3) -> tuple[str, ...]:
        """Return the equations of one cell, one per action, such as "F = 0.500 x - 1.200 v + 0.300".

        `digits` is the number of decimals. None prints each number exactly and leaves out terms that are zero, which
        suits policies of `simplify`.
        Raises ValueError for a cell that does not exist."""
        check_count("cell", cell, least=0, most=len(self) - 1)
        return tuple(
            f"{output} = {self.policy_class.expression(self.coefficients[cell, :, j], digits)}"
            for j, output in enumerate(self.task.outputs)
        )

    def to_json(self) -> str:
        """Return all numbers of the policy by name, as JSON."""
        task = self.task
        about = {
            "task": task.name,
            "inputs": list(task.inputs),
            "sub_policy": self.policy_class.name,
            "rows": list(self.policy_class.rows),
            "outputs": list(task.outputs),
            **self.where.options,
            "action_low": task.action_low.tolist(),
            "action_high": task.action_high.tolist(),
            **{name: array.tolist() for name, array in self.where.arrays.items()},
            "coefficients": self.coefficients.tolist(),
        }
        return json.dumps(about, ensure_ascii=False, indent=1) + "\n"

    def to_python(self) -> str:
        """Return a Python module with `cell(state)` and `act(state)`, which returns a list of actions.

        It imports only the standard library. For a state that is not finite the functions return -1 and nan.
        Raises ValueError for features that are not plain arithmetic, and for cells that cannot be written."""
        task = self.task
        numbers = {"LOW": task.action_low, "HIGH": task.action_high}
        numbers["COEFFICIENTS"] = self.coefficients.transpose(0, 2, 1)
        return "\n".join([
            f'"""{escaped(_headline(self))}"""',
            "",
            f"from math import {', '.join(SHARED)}, isfinite, nan  # noqa: F401",
            "",
            *(f"{name} = {value.tolist()}" for name, value in numbers.items()),
            *self.where.python(),
            "",
            "",
            "def cell(state):",
            '    """Index of the cell; -1 for a state that is not finite."""',
            "    return locate(state) if all(map(isfinite, state)) else -1",
            "",
            "",
            "def output(row, features):",
            "    return sum(w * f for w, f in zip(row, features))",
            "",
            "",
            "def act(state):",
            f'    """From [{_names(task.inputs)}] to [{_names(task.outputs)}]; nan for a state that is not finite."""',
            "    i = cell(state)",
            "    if i < 0:",
            "        return [nan for _ in LOW]",
            f"    features = [{self.policy_class.feature_code()}]",
            "    raw = [output(row, features) for row in COEFFICIENTS[i]]",
            "    return [min(max(a, low), high) for a, low, high in zip(raw, LOW, HIGH)]",
            "",
        ])  # fmt: skip

    def to_c(self) -> str:
        """Return C99 code: `int vsp_cell(const double *state)`, `void vsp_act(const double *state, double *action)`.

        It needs only the standard library. For a state that is not finite the functions give -1 and NAN.
        Raises ValueError for features that are not plain arithmetic, and for cells that cannot be written."""
        (k, p, m), d, inputs = self.coefficients.shape, len(self.task.low), len(self.policy_class.code) + 1
        return f"""/* {escaped(_headline(self))}
   state: {_names(self.task.inputs)}; action: {_names(self.task.outputs)}. */
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "compiled like this, a state that is not a number would not be seen"
#endif
#include <math.h>

{PROTOTYPES}
{self.where.c()}
static const double coefficients[{k}][{m}][{p}] = {braces(self.coefficients.transpose(0, 2, 1))};
static const double low[{m}] = {braces(self.task.action_low)};
static const double high[{m}] = {braces(self.task.action_high)};
static const double safe[{m}] = {{{", ".join(["(double)NAN"] * m)}}}; /* for a state that is not finite */

int vsp_cell(const double *state) {{
    for (int j = 0; j < {d}; j++) if (!isfinite(state[j])) return -1;
    return locate(state);
}}

static double output(const double *row, const double *features) {{
    double sum = 0.0;
    for (int i = 0; i < {inputs}; i++) sum += row[i] * features[i];
    return sum;
}}

void vsp_act(const double *state, double *action) {{
    const double features[{inputs}] = {{{self.policy_class.feature_code()}}};
    int i = vsp_cell(state);
    for (int j = 0; j < {m}; j++) {{
        double raw = i < 0 ? safe[j] : output(coefficients[i][j], features);
        action[j] = raw < low[j] ? low[j] : raw > high[j] ? high[j] : raw;
    }}
}}
"""

    def to_text(self, digits: int | None = 3) -> str:
        """Return the whole policy in words: the distance, if there is one, and place and equations of every cell."""
        lines = [_headline(self)]
        if len(self) > 1:
            lines += [f"{about}." for about in [self.where.about(self.task.inputs, digits)] if about]
        for i in range(len(self)):
            lines += [f"{self.where.place(i, self.task.inputs, digits)}:"] if len(self) > 1 else []
            lines += [f"  {equation}" for equation in self.equations(i, digits)]
        lows, highs = ([number(limit, None) for limit in box] for box in (self.task.action_low, self.task.action_high))
        limits = (f"{name} from {low} to {high}" for name, low, high in zip(self.task.outputs, lows, highs))
        return "\n".join([*lines, f"limited to {', '.join(limits)}", ""])

    def to_latex(self, digits: int | None = 3) -> str:
        """Return a table of the cells and their equations, one row per cell, and the distance; needs booktabs."""
        outputs = [f"${symbol(output)}$" for output in self.task.outputs]
        cells = ([codeword_latex(self, i, digits), *equations_latex(self, i, digits)] for i in range(len(self)))
        head, *rows = (" & ".join(row) + " \\\\\n" for row in ([self.where.column, *outputs], *cells))
        columns = "l" * (1 + len(outputs))
        note = rf"\multicolumn{{{len(columns)}}}{{l}}{{{distances_latex(self, digits)}}} \\" + "\n"
        return (
            f"\\begin{{tabular}}{{{columns}}}\n\\toprule\n{head}\\midrule\n"
            f"{''.join(rows)}\\midrule\n{note}\\bottomrule\n\\end{{tabular}}\n"
        )


def distances_latex(policy: Exportable, digits: int | None = 3) -> str:
    """Describe the distance to the codewords, or other cells, as a caption for their table."""
    if not isinstance(policy.where, Nearest):
        return f"Each map is valid {policy.where.valid}"
    if len(policy) == 1:
        return "One cell, wherever its codeword is"
    name, scale = policy.where.metric.name.capitalize(), policy.where.scale
    units = ",\\ ".join(number(unit, digits) for unit in scale)
    return f"{name} distances" + ("" if (scale == 1).all() else f" of states divided by $[{units}]$")


def codeword_latex(policy: Exportable, cell: int, digits: int | None = 3) -> str:
    """Return the codeword of a cell, or its half-spaces, between dollar signs."""
    check_count("cell", cell, least=0, most=len(policy) - 1)
    return policy.where.latex(cell, tuple(map(symbol, policy.task.inputs)), digits)


def equations_latex(policy: Exportable, cell: int, digits: int | None = 3) -> list[str]:
    """Return the right-hand sides of the equations of a cell, one per action, between dollar signs."""
    check_count("cell", cell, least=0, most=len(policy) - 1)
    return [f"${policy.policy_class.expression(column, digits, symbol)}$" for column in policy.coefficients[cell].T]


def symbol(name: str) -> str:
    """Return a variable's name, or that of a product or square of variables, in LaTeX's math mode."""
    if "·" in name:
        return " ".join(symbol(factor) for factor in name.split("·"))
    if name.endswith("²"):
        return symbol(name[:-1]) + "^2"
    words = " " in name and name.isascii() and not _FUNCTION.search(name)
    name = "".join(_SPECIAL.get(one, one) for one in name)
    if words:
        return rf"\mathrm{{{name}}}".replace(" ", r"\ ")
    for plain, code in _SYMBOLS.items():
        name = name.replace(plain, code)
    name = _FUNCTION.sub(r"\\\1", name)
    if name.isascii() and name.isalpha() and len(name) == 2 and name.startswith("v"):
        return f"v_{name[1]}"
    return rf"\mathrm{{{name}}}" if name.isalpha() and len(name) > 1 else name


def _headline(policy: Exportable) -> str:
    if len(policy) == 1:
        return f"{policy.task.name}: one {policy.policy_class.name} policy."
    policies = f"{len(policy)} {policy.policy_class.name} policies"
    return f"{policy.task.name}: {policies}, each valid {policy.where.valid}."


def _names(symbols: tuple[str, ...]) -> str:
    return escaped(", ".join(symbols))


def escaped(text: str) -> str:
    """Escape `text` for a docstring and a C comment: a name can neither end them nor start a new line."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace("*/", "* /").replace("/*", "/ *")
