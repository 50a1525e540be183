"""What a distillation depends on, in two frozen dataclasses: `Config` for the paper's method, `Refinement` for ours.

`Config` has the hyperparameters of the paper (table T2) and the readings of what it leaves open, numbered R1-R15 as in
the comments below. Each reading is a field that names an entry of `readings.py`, or a number. R11 (which states a
splitting pass reads) has one reading in the prose, "this iteration's episode", and so it is no field.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, get_args, get_origin, get_type_hints

from .checks import check_choice
from .envs import get_task

# Fields of `Config` that go beyond the paper, and their values at rest, which are the paper's method
EXTENSIONS = {"sub_policy": "linear", "fit": "adam"}


@dataclass(frozen=True)
class Config:
    """Everything a distillation depends on beside the teacher, the task and the seed.

    Raises ValueError for a value out of range, showing the value and what was expected.
    """

    # Table T2
    n_epochs: int
    """Iterations of Algorithm 1; each plays one teacher episode."""
    n_split: int
    """A splitting pass every `n_split` iterations."""
    n_merge: int
    """A merging pass every `n_merge` iterations."""
    n_freeze: int
    """Length of the phase that `freeze` (R1) speaks of, in iterations."""
    n_reset: int
    """Period of the reset that `periodic_reset` (R5) speaks of, in iterations."""
    min_param_distance: float
    """Neighbours whose parameters are closer than this (L-infinity) are merged."""
    min_pol_distance: float
    """A state closer to its codeword than this never becomes a codeword; in units of the (scaled) state."""
    max_pol_loss: float
    """A running mean loss above this splits the cell; in squared units of the action."""
    one_split: bool = False
    """R4. At most one split per pass; in T2 only, False in both columns, so the name is all there is to go by."""

    # Readings
    freeze: Literal["last_n_freeze", "first_n_freeze", "last_n_split"] = "last_n_freeze"
    """R1. When the partition stands still: the last `n_freeze` iterations, as the prose says twice; all but the first
    `n_freeze`, as Algorithm 1 prints (n < n_freeze may alter it); or the last `n_split`, as the prose says once."""
    split_lookup: Literal["refreshed", "kept"] = "refreshed"
    """R2. Whether a state is looked up among the codewords added earlier in the same pass, as Algorithm 2 line 4 reads
    where it stands in the loop, or among those the pass began with."""
    split_metric: Literal["manhattan", "euclidean"] = "manhattan"
    """R3. Norm of `min_pol_distance`. T3 has one pair of codewords nearer than 0.3 in Manhattan distance, the distance
    of the look-up, and 12 in Euclidean distance."""
    periodic_reset: Literal["buffers", "off"] = "buffers"
    """R5. What happens every `n_reset` iterations: all buffers are cleared, which also bounds their memory."""
    merge_reset: Literal["survivor_and_neighbours", "neighbours"] = "survivor_and_neighbours"
    """R6. Whose buffers a merge resets: the prose names the survivor and its neighbours, Algorithm 3 the neighbours."""
    merge_visits_removed: bool = False
    """R6. Whether a cell removed earlier in a pass still takes its turn in it. Algorithm 3 removes while it iterates;
    a cell that is gone has no claim on its neighbours, so the default is no. With yes, it may remove those whose turn
    comes later; without that limit two equal cells would remove each other."""
    batch_size: int = 64
    """R7. States per minibatch and cell, drawn with replacement; unstated in the paper."""
    n_minibatches: int = 1
    """R7. Minibatches per iteration and cell; unstated. With the rate below, a parameter can move by about 5 in 5000
    iterations and by 2 in 2000: the largest printed coefficients are 5.3 (T3) and 3.0 (T4)."""
    learning_rate: float = 1e-3
    """R7. Step size of Adam; unstated, so Adam's own default."""
    initial: Literal["uniform", "zeros"] = "uniform"
    """R7. First parameters of a sub-policy, "initialized randomly": uniform in +-1/sqrt(d), as torch.nn.Linear does."""
    adam_on_reset: Literal["keep", "restart"] = "keep"
    """R7. Whether Adam's moments survive a buffer reset: the paper resets buffers and nothing else."""
    scale: Literal["raw", "box"] = "raw"
    """R8. Distances between raw states, or between states divided by the widths of the state box; for look-up,
    `min_pol_distance` and neighbours alike. T4's codewords are in raw units."""
    neighbours: Literal["delaunay", "lookup", "visited"] = "delaunay"
    """R9. The Euclidean Delaunay graph that the prose names, or the cells that touch under the look-up's metric: in the
    state box or, beyond the paper, among the states that the teacher visited lately, which is what many dimensions
    ask for."""
    split_loss: Literal["raw", "clipped"] = "raw"
    """R10. Loss of the linear output, or of the output limited to the action box. Training uses the raw output, so
    the loss that splits does too."""
    merge_parameters: Literal["all", "weights"] = "all"
    """R12. Whether biases count in `min_param_distance`: "both sets of parameters" includes them."""
    split_reset: Literal["cell_and_neighbours", "neighbours"] = "cell_and_neighbours"
    """R13. Whether a split also resets the cell that was split, whose buffer holds states that it just lost; Algorithm
    2 resets the neighbours alone."""
    split_neighbours: Literal["old", "new"] = "old"
    """R13. Neighbours of the cell that was split (prose: "of the old region") or of the new one."""
    loss_after_split: Literal["reset", "kept"] = "reset"
    """R14. Whether the running loss starts afresh after a split. Not stated; after a split the loss that led to it has
    been acted upon."""
    inclusive: bool = False
    """R15. False: n = 0 ... n_epochs - 1, and n = 0, with one cell trained once, neither splits nor merges. True: n =
    n_epochs is played too ("n = 0 to n_epochs") and n = 0 splits and merges."""

    # Beyond the paper
    sub_policy: Literal["linear", "constant", "quadratic", "pid", "network"] = "linear"
    """Class of the sub-policies, an entry of `subpolicies.FORMS`; the paper's are linear."""
    fit: Literal["adam", "closed_form"] = "adam"
    """How a cell's map is fitted in each iteration: by `n_minibatches` steps of Adam, or by least squares over all
    states that the cell saw since its last reset, from running sums of their products, without a buffer; what is said
    of minibatches and of Adam has no say then."""

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(type(self)).items():
            _check(name, getattr(self, name), kind)
        if self.n_freeze > self.n_epochs:
            raise ValueError(
                f"n_freeze is {self.n_freeze}, expected at most n_epochs = {self.n_epochs}: "
                "lower n_freeze or raise n_epochs"
            )
        if self.sub_policy == "network" and self.fit == "closed_form":
            raise ValueError("fit is 'closed_form', expected 'adam' for networks: they are not linear in parameters")
        if self.sub_policy == "network" and self.initial == "zeros":
            raise ValueError("initial is 'zeros', expected 'uniform' for networks: equal units would stay equal")

    @property
    def n_iterations(self) -> int:
        """Iterations that are played: `n_epochs`, and one more if `inclusive`."""
        return self.n_epochs + self.inclusive

    def settings(self) -> dict:
        """All fields by name, less the extensions at rest: what was made without them keeps its id."""
        own = dataclasses.asdict(self)
        return {name: value for name, value in own.items() if name not in EXTENSIONS or value != EXTENSIONS[name]}

    def quick(self) -> Config:
        """The same method in a tenth of the iterations: for a first look, not for results."""
        tenth = {name: max(1, getattr(self, name) // 10) for name in ("n_epochs", "n_freeze")}
        return dataclasses.replace(self, **tenth)


@dataclass(frozen=True)
class Refinement:
    """How `refine` finds a few cells and their maps together. Raises ValueError for a value out of range."""

    n_cells: int
    """Cells of the policy."""
    n_episodes: int = 500
    """Episodes of the teacher that the first fit sees."""
    n_restarts: int = 3
    """Fits from other beginnings; the one with the best return from validation starts goes on."""
    n_steps: int = 1500
    """Steps of Adam of a first fit; later fits, from where the last one ended, take half as many."""
    batch_size: int = 256
    """States per step."""
    learning_rate: float = 0.02
    """Step size of Adam at the beginning, for inputs scaled to unit deviation and actions to [-1, 1]; falls to 0."""
    hottest: float = 1.0
    """Temperature at the beginning, in units of the variance of the states in a cell: how far beyond its cell a map
    still counts (deterministic annealing, Rose 1998)."""
    coldest: float = 0.04
    """Temperature at the end, where cells have all but plain borders."""
    leak: float = 0.01
    """Slope of the limited action beyond the limits, as the loss sees it: a little, so that maps find back."""
    stakes: bool = False
    """Whether states are drawn as often as a wrong action costs there, by the teacher's critics (VIPER, Bastani et al.
    2018)."""
    n_corrections: int = 2
    """Rounds of labelling the states that the policy itself visits by the teacher (DAgger, Ross et al. 2011)."""
    n_correction_episodes: int = 200
    """Episodes of the policy per round."""
    n_generations: int = 200
    """Generations of CMA-ES (Hansen 2016) on the return itself, at the end."""
    n_tuning_episodes: int = 200
    """Episodes, from fresh starts, that each candidate of a generation plays."""
    tuning_step: float = 0.1
    """First standard deviation of CMA-ES, in scaled units."""
    failure_price: float = 0.0
    """Return that a failed episode costs on top, wherever candidates are compared, for a mean hides what is rare. What
    fails is what does not end in a goal; where an end is the failure, as of a walker that falls, leave it at 0."""
    error_price: float = 0.0
    """Return that a mean squared action error of 1 costs on top, in units of half the action box and where the teacher
    goes: 0 asks for the return alone, however unlike the teacher the policy becomes."""
    n_validation: int = 5000
    """Episodes that decide between restarts, rounds and before and after tuning."""

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(type(self)).items():
            optional, value = name.endswith("_price") or name in ("n_corrections", "n_generations"), getattr(self, name)
            zero = value == 0 and isinstance(value, int | kind) and not isinstance(value, bool)
            if not (optional and zero):  # else without this part
                _check(name, value, kind)
        if self.coldest > self.hottest:
            raise ValueError(f"coldest is {self.coldest}, expected at most hottest = {self.hottest}")

    def quick(self) -> Refinement:
        """The same method in a tenth of the steps: for a first look, not for results."""
        shrunk = ("n_episodes", "n_steps", "n_correction_episodes", "n_generations", "n_validation")
        values = {name: getattr(self, name) for name in shrunk}
        return dataclasses.replace(self, **{name: value and max(1, value // 10) for name, value in values.items()})


def check_refinement(config: Refinement) -> None:
    """Raise ValueError for anything else, such as a `Config`."""
    if not isinstance(config, Refinement):
        raise ValueError(f"config is {config!r}, expected a Refinement, such as vsp.preset('SimpleGoal-v0', 'best')")


def _check(name: str, value: object, kind: object) -> None:
    if get_origin(kind) is Literal:
        good, expected = isinstance(value, str) and value in get_args(kind), f"one of {list(get_args(kind))}"
    elif kind is bool:
        good, expected = isinstance(value, bool), "True or False"
    elif kind is int:
        good, expected = isinstance(value, int) and not isinstance(value, bool) and value > 0, "a positive integer"
    else:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        good, expected = number and math.isfinite(value) and value > 0, "a positive number"
    if not good:
        raise ValueError(f"{name} is {value!r}, expected {expected}")


_PRESETS = {
    "SimpleGoal-v0": Config(
        n_epochs=5000,
        n_split=20,
        n_merge=100,
        n_freeze=1000,
        n_reset=500,
        min_param_distance=0.5,
        min_pol_distance=0.3,
        max_pol_loss=1e-4,
    ),
    "MountainCarContinuous-v0": Config(
        n_epochs=2000,
        n_split=50,
        n_merge=100,
        n_freeze=400,
        n_reset=500,
        min_param_distance=0.3,
        min_pol_distance=0.04,
        max_pol_loss=1e-5,
    ),
}


_BEST = {
    "SimpleGoal-v0": Refinement(n_cells=4, n_restarts=6, n_generations=150, failure_price=100.0),
    # One failure in ten thousand weighs ten points of return: a tuned force is so gentle that it may not suffice
    "MountainCarContinuous-v0": Refinement(
        n_cells=3, n_episodes=100, n_correction_episodes=50, n_generations=40, n_tuning_episodes=30,
        failure_price=100_000.0,
    ),
    "Pendulum-v1": Refinement(
        n_cells=3, n_episodes=60, n_correction_episodes=60, n_generations=60, n_tuning_episodes=60, n_validation=500
    ),
    "LunarLanderContinuous-v3": Refinement(
        n_cells=4, n_episodes=200, n_correction_episodes=100, n_generations=40, n_tuning_episodes=20, n_validation=200,
    ),
}  # fmt: skip


# Tasks that a physics engine plays: policies are judged by so many times fewer episodes
SLOW = {"LunarLanderContinuous-v3": 10}


def preset(task: str, kind: Literal["paper", "best"] = "paper") -> Config | Refinement:
    """The settings for `task`: the paper's (table T2, with the default readings) or the best we know.

    Raises ValueError for an unknown task or kind, and for one that the paper does not treat.
    """
    presets = {"paper": _PRESETS, "best": _BEST}
    check_choice("kind", kind, presets)
    name = get_task(task).name
    if name not in presets[kind]:
        own = "Config" if kind == "paper" else "Refinement"
        known = list(presets[kind])
        raise ValueError(f"no preset for task {name!r}, expected one of {known}: write a {own} of your own")
    return presets[kind][name]
