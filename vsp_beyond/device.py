"""C code for a device: of floats, with a safe action, a header, and a comment that says what goes in and out."""

import re

import numpy as np

from vsp.cells import Nearest, braces
from vsp.checks import check_array
from vsp.export import PROTOTYPES, escaped
from vsp.policy import PiecewisePolicy

_REAL = re.compile(r"(?<![\w.])(\d+(\.\d*)?e[-+]?\d+|\d+\.\d*)")  # a number with a point or an exponent


def to_c(
    policy: PiecewisePolicy, *, real: str = "double", safe: np.ndarray | None = None, states: np.ndarray | None = None
) -> str:
    """Return `policy.to_c()` for a device. With `real` "float" all its numbers are floats: an action is right to about
    six digits, and on a border another cell may act. `safe` (m,) is the action for a state that is not finite, by
    default NAN. Of `states` (n, d), a comment says how much the action jumps at the borders around them, at most.
    Raises ValueError as `to_c` does, for another `real`, and for a safe action beyond the limits."""
    code, task = policy.to_c(), policy.task
    if real not in ("double", "float"):
        raise ValueError(f"real is {real!r}, expected 'double' or 'float'")
    if safe is not None:
        safe = check_array("safe", safe, (len(task.outputs),))
        if ((safe < task.action_low) | (safe > task.action_high)).any():
            raise ValueError(f"safe is {safe.tolist()}, expected an action within the limits of {task.name}")
        code = re.sub(r"(safe\[\d+\] = )\{.*?\}", lambda found: found[1] + braces(safe), code)
    if real == "float":
        code = _REAL.sub(r"\1f", code).replace("double", "float").replace("<math.h>", "<tgmath.h>")
    return f"/* {_about(policy, states)} */\n{code}"


def to_header(policy: PiecewisePolicy, *, real: str = "double") -> str:
    """Return the header of `to_c`."""
    code = PROTOTYPES.replace("double", real)
    return f"#ifndef VSP_POLICY_H\n#define VSP_POLICY_H\n\n/* {_about(policy)} */\n{code}\n#endif\n"


def _about(policy: PiecewisePolicy, states: np.ndarray | None = None) -> str:
    task, lines = policy.task, ["Call vsp_act once in each step of the task."]
    for what, names, lows, highs in (
        ("state", task.input_labels, task.low, task.high), ("action", task.outputs, task.action_low, task.action_high),
    ):  # fmt: skip
        lines += [f"{what}[{i}]: {name}, {lows[i]:g} to {highs[i]:g}" for i, name in enumerate(names)]
    if states is not None and len(policy) > 1 and isinstance(policy.where, Nearest):
        jumps = ", ".join(f"{jump:.3g}" for jump in largest_jump(policy, states))
        lines.append(f"At a border the action jumps by at most {jumps}, as found around {len(states)} states.")
    return "\n   ".join(map(escaped, lines))


def largest_jump(policy: PiecewisePolicy, states: np.ndarray) -> np.ndarray:
    """Return by how much each action jumps at most where the ways between successive `states` (n, d) leave a cell. (m,)
    Each such way is halved until both its ends are next to the border."""
    here, there = states[:-1].copy(), states[1:].copy()
    cells = policy.cells(here)
    crossed = cells != policy.cells(there)
    here, there, cells = here[crossed], there[crossed], cells[crossed]
    for _ in range(50):
        middle = (here + there) / 2
        inside = (policy.cells(middle) == cells)[:, None] if len(middle) else np.zeros((0, 1), bool)
        here, there = np.where(inside, middle, here), np.where(inside, there, middle)
    return np.abs(policy.predict(here)[0] - policy.predict(there)[0]).max(axis=0, initial=0.0)
