"""`Method`: anything that turns an agent into a policy, with what identifies its results."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from .. import algorithms
from ..algorithms import MergePass, SplitPass
from ..checks import check_count
from ..config import Config, paper_preset
from ..rollouts import Episodes, Policy
from ..run.identity import identity
from ..tasks import Task


@dataclass(frozen=True)
class Method:
    """A method: `make(agent, task, data, seed)` returns a policy; the same arguments give the same policy.

    `data` are `n_data` episodes of the agent, whose starts follow from the seed; None if `n_data` is 0, for a method
    that needs none or plays its own. `version` is raised when `make` returns something else; None: the source of `make`
    stands for it, and so does a change of what `make` uses from its own module (`run.identity`). `settings` of a task
    are what else the policy depends on. Raises ValueError if `make` cannot be identified."""

    make: Callable[[Policy, Task, Episodes | None, int], Policy]
    n_data: int = 0
    version: int | None = None
    name: str = ""
    settings: Callable[[Task], dict[str, Any]] = field(default=lambda task: {})

    def __post_init__(self) -> None:
        check_count("n_data", self.n_data, least=0)
        if self.version is None:
            identity(self.make)
        elif not self.name:
            raise ValueError(f"version is {self.version} without a name, expected one: other methods have this version")

    def __call__(self, agent: Policy, task: Task, data: Episodes | None, seed: int) -> Policy:
        """Make a policy."""
        return self.make(agent, task, data, seed)

    def identity(self, task: Task) -> dict[str, Any]:
        """Return what its policies for `task` depend on, apart from the agent and the seed."""
        make = {"name": self.name or self.make.__qualname__} if self.version is not None else identity(self.make)
        return {"make": make, "version": self.version, "data": self.n_data, "settings": identity(self.settings(task))}


def paper_method(
    config: Config | None = None, *, split: SplitPass | None = None, merge: MergePass | None = None
) -> Method:
    """Return the paper's method: Algorithms 1 to 3, by default with the paper's settings of the task. `split` and
    `merge` replace Algorithms 2 and 3."""

    def make(agent: Policy, task: Task, data: Episodes | None, seed: int) -> Policy:
        return algorithms.distill(agent, task, config or paper_preset(task), seed=seed, split=split, merge=merge)[0]

    def settings(task: Task) -> dict[str, Any]:
        passes = {"split": split, "merge": merge}
        chosen = {name: identity(one) for name, one in passes.items() if one is not None}
        return (config or paper_preset(task)).settings() | chosen

    return Method(make, version=algorithms.VERSION, name="the paper's method", settings=settings)
