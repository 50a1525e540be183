"""The classes of sub-policies by name. To add one, write a function that takes a task and returns a `PolicyClass`."""

from __future__ import annotations

from ..checks import check_choice
from ..tasks.base import Task
from .base import PolicyClass
from .linear import constant, linear, pid, quadratic


def policy_class(sub_policy: str, task: Task) -> PolicyClass:
    """Return the class of sub-policies called `sub_policy`, for `task`. Raises ValueError for an unknown name, and for
    "pid" if the task has no signals."""
    check_choice("sub_policy", sub_policy, POLICY_CLASSES)
    return POLICY_CLASSES[sub_policy](task)


POLICY_CLASSES = {"constant": constant, "linear": linear, "quadratic": quadratic, "pid": pid}
