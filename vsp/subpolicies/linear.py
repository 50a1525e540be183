"""Classes of sub-policies that are linear in their coefficients, by name. The paper uses `linear`.

To add one, write a function that takes a task and returns a `PolicyClass`, and pass it as `Config.sub_policy`.
"""

from collections.abc import Callable

import numpy as np

from ..checks import check_choice
from ..tasks.base import Task
from .base import PolicyClass, reach, state_code


def constant(task: Task) -> PolicyClass:
    """One action for the whole cell, as in a table."""
    return PolicyClass("constant", (), (), np.ones(0), lambda states: states[..., :0])


def linear(task: Task) -> PolicyClass:
    """Linear in the raw state, as in the paper."""
    return PolicyClass("linear", task.inputs, state_code(task), np.ones(len(task.inputs)), lambda states: states)


def quadratic(task: Task) -> PolicyClass:
    """Linear in the inputs, their squares and their products in pairs."""
    pairs = np.triu_indices(len(task.inputs))
    squares = [f"({name})²" if " " in name else f"{name}²" for name in task.inputs]
    terms = [squares[i] if i == j else f"{task.inputs[i]}·{task.inputs[j]}" for i, j in zip(*pairs)]
    code = [f"state[{i}] * state[{j}]" for i, j in zip(*pairs)]

    def features(states: np.ndarray) -> np.ndarray:
        return np.concatenate([states, states[..., pairs[0]] * states[..., pairs[1]]], axis=-1)

    return PolicyClass("quadratic", (*task.inputs, *terms), (*state_code(task), *code), features(reach(task)), features)


SubPolicy = str | Callable[[Task], PolicyClass]  # a class by its name, or what makes it for a task
POLICY_CLASSES = {"constant": constant, "linear": linear, "quadratic": quadratic}


def policy_class(sub_policy: SubPolicy, task: Task) -> PolicyClass:
    """Return the class of sub-policies for `task`: by its name, or by a function of the task. Raises ValueError for an
    unknown name, and for a function that returns something else."""
    if not callable(sub_policy):
        check_choice("sub_policy", sub_policy, POLICY_CLASSES)
        return POLICY_CLASSES[sub_policy](task)
    made = sub_policy(task)
    if not isinstance(made, PolicyClass):
        raise ValueError(f"sub_policy {sub_policy!r:.60} returns {made!r:.60}, expected a PolicyClass")
    return made
