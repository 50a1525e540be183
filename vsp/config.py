"""`Config`: the hyperparameters of the paper (table T2), and most of its open questions R1 to R15 as fields.

Code that depends on an open question names it: search this folder for "R9", for example. R2, R6, R13 and R14, which
change the passes themselves, are fields of `paper.readings.Readings`. R11 (which states a splitting pass reads) has no
field: the paper's prose answers it, "this iteration's episode".
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from .geometry import LOOKUP, Metric
from .subpolicies import PolicyClass
from .tasks import Task, get_task

# Fields beyond the paper, with the values of the paper's method
EXTENSIONS = {"metric": LOOKUP, "sub_policy": "linear", "fit": "adam"}


@dataclass(frozen=True)
class Config:
    """All settings of a distillation, apart from the teacher, the task and the seed. Raises ValueError for a value out
    of range; the message shows the value and what was expected."""

    # Table T2
    n_epochs: int
    """Iterations of Algorithm 1; each uses one teacher episode."""
    n_split: int
    """A splitting pass runs every `n_split` iterations."""
    n_merge: int
    """A merging pass runs every `n_merge` iterations."""
    n_freeze: int
    """Length, in iterations, of the phase that R1 is about."""
    n_reset: int
    """Period, in iterations, of the reset that R5 is about."""
    min_param_distance: float
    """Neighbours whose coefficients are closer than this (L-infinity) are merged."""
    min_pol_distance: float
    """A state closer to its codeword than this never becomes a codeword; in units of the (scaled) state."""
    max_pol_loss: float
    """A cell is split where its running mean loss exceeds this; in squared units of the action."""
    one_split: bool = False
    """R4. Whether a pass makes at most one split. Only T2 names this setting (False in both columns), so its meaning is
    inferred from the name."""

    # Open questions
    freeze: Literal["last_n_freeze", "first_n_freeze", "last_n_split"] = "last_n_freeze"
    """R1. When cells are neither split nor merged: in the last `n_freeze` iterations (prose, twice), in all but the
    first `n_freeze` iterations (Algorithm 1 prints n < n_freeze), or in the last `n_split` (prose, once)."""
    split_metric: Literal["manhattan", "euclidean"] = "manhattan"
    """R3. Metric of `min_pol_distance`. In T3, 1 pair of codewords is closer than 0.3 in Manhattan distance, which the
    look-up uses; 12 pairs are closer in Euclidean distance."""
    periodic_reset: Literal["buffers", "off"] = "buffers"
    """R5. What happens every `n_reset` iterations: nothing, or all buffers are cleared, which also bounds memory."""
    batch_size: int = 64
    """R7. States per minibatch and cell, drawn with replacement. The paper does not state it."""
    n_minibatches: int = 1
    """R7. Minibatches per iteration and cell. The paper does not state it. With the default learning rate, a
    coefficient can move by about 5 in 5000 iterations and by 2 in 2000; the largest printed ones are 5.3 (T3) and 3.0
    (T4)."""
    learning_rate: float = 1e-3
    """R7. Step size of Adam. The paper does not state it, so this is Adam's default."""
    initial: Literal["uniform", "zeros"] = "uniform"
    """R7. Initial coefficients, "initialized randomly": uniform in +-1/sqrt(d), as in torch.nn.Linear."""
    adam_on_reset: Literal["keep", "restart"] = "keep"
    """R7. Whether a buffer reset keeps Adam's moments. The paper resets buffers and nothing else."""
    scale: Literal["raw", "box"] = "raw"
    """R8. Whether distances are taken between raw states or between states divided by the widths of the state box. This
    applies to the look-up, `min_pol_distance` and neighbours. T4's codewords are in raw units."""
    neighbours: Literal["delaunay", "lookup"] = "delaunay"
    """R9. Which cells are neighbours: those that share a Euclidean Delaunay edge (prose), or those that touch inside
    the state box under the look-up's metric."""
    split_loss: Literal["raw", "clipped"] = "raw"
    """R10. Whether the loss of splitting uses the raw output, as training does, or the output clipped to the action
    box."""
    merge_parameters: Literal["all", "weights"] = "all"
    """R12. Whether `min_param_distance` compares biases too: "both sets of parameters" includes them."""
    inclusive: bool = False
    """R15. The range of n. False: n = 0 ... n_epochs - 1; n = 0, where one cell was trained once, neither splits nor
    merges. True: n = n_epochs is included ("n = 0 to n_epochs"), and n = 0 splits and merges."""

    # Beyond the paper
    metric: Literal["manhattan", "euclidean", "chebyshev"] | Metric = "manhattan"
    """The distance that finds the cell of a state: a name, or a `vsp.Metric` of your own; the paper's is Manhattan."""
    sub_policy: Literal["linear", "constant", "quadratic"] | Callable[[Task], PolicyClass] = "linear"
    """Class of the sub-policies: an entry of `subpolicies.POLICY_CLASSES`, or a function of the task that returns a
    `PolicyClass`; the paper's is linear."""
    fit: Literal["adam", "closed_form"] = "adam"
    """How each iteration fits a cell: by `n_minibatches` steps of Adam, or by least squares over all states since the
    last reset. Least squares uses running sums and no buffer; the settings of minibatches and Adam have no effect."""

    def __post_init__(self) -> None:
        for name, kind in kinds_of(type(self)).items():
            check_field(name, getattr(self, name), kind)
        if self.n_freeze > self.n_epochs:
            raise ValueError(
                f"n_freeze is {self.n_freeze}, expected at most n_epochs = {self.n_epochs}: "
                "lower n_freeze or raise n_epochs"
            )

    @property
    def n_iterations(self) -> int:
        """Number of iterations that run: `n_epochs`, and one more if `inclusive`."""
        return self.n_epochs + self.inclusive

    def settings(self) -> dict:
        """Return all fields by name. Extensions appear only if used, so that earlier results keep their id."""
        from .run.identity import identity  # here: a run needs it once, an import of vsp never

        own = {name: identity(value) for name, value in vars(self).items()}
        return {name: value for name, value in own.items() if name not in EXTENSIONS or value != EXTENSIONS[name]}

    def quick(self) -> "Config":
        """Return the same method with a tenth of the iterations: for a first look, not for results."""
        tenth = {name: max(1, getattr(self, name) // 10) for name in ("n_epochs", "n_freeze")}
        return dataclasses.replace(self, **tenth)


# The kinds of the fields of a class, kept, because a table of results asks for them thousands of times
kinds_of: Callable[[type], dict[str, Any]] = functools.cache(get_type_hints)


def check_field(name: str, value: object, kind: object) -> None:
    """Raise ValueError unless `value` is of `kind`: one of a Literal's names, a bool, a positive int or float, or in a
    union with a Literal an object."""
    if get_origin(kind) is Union:
        kind, other = get_args(kind)
        if isinstance(value, get_origin(other) or other):
            return
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value > 0
    if get_origin(kind) is Literal:
        good, expected = isinstance(value, str) and value in get_args(kind), f"one of {list(get_args(kind))}"
    elif kind is bool:
        good, expected = isinstance(value, bool), "True or False"
    elif kind is int:
        good, expected = number and isinstance(value, int), "a positive integer"
    else:
        good, expected = number, "a positive number"
    if not good:
        raise ValueError(f"{name} is {value!r}, expected {expected}")


PAPER_TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0")  # the tasks of the paper, in the order of T2's columns
_T2: dict[str, tuple[Any, Any]] = {
    "n_epochs": (5000, 2000),
    "n_split": (20, 50),
    "n_merge": (100, 100),
    "n_freeze": (1000, 400),
    "n_reset": (500, 500),
    "min_param_distance": (0.5, 0.3),
    "min_pol_distance": (0.3, 0.04),
    "max_pol_loss": (1e-4, 1e-5),
}
_PRESETS = {task: Config(**{name: row[i] for name, row in _T2.items()}) for i, task in enumerate(PAPER_TASKS)}


def paper_preset(task: str | Task) -> Config:
    """Return the paper's settings for `task`: table T2 and the default answers to R1 to R15. Raises ValueError for a
    task that is not in the paper."""
    name = get_task(task).name
    if name not in _PRESETS:
        raise ValueError(
            f"the paper has no settings for task {name!r}, expected one of {list(_PRESETS)}: write a "
            f"Config of your own, or call vsp_beyond.faithful(agent, {name!r}, seed=0)"
        )
    return _PRESETS[name]
