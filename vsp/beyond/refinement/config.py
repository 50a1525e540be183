"""`Refinement`: the settings of `refine`, and its presets."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import get_type_hints

from ...config import check_field
from ...tasks import Task, get_task


@dataclass(frozen=True)
class Refinement:
    """How `refine` finds a few cells and their maps together. Raises ValueError for a value out of range."""

    n_cells: int
    """Cells of the policy."""
    n_episodes: int = 500
    """Episodes of the teacher that the first fit sees."""
    n_restarts: int = 3
    """Fits from other random initial cells; the one with the best validation score is kept."""
    n_steps: int = 1500
    """Steps of Adam in a first fit; later fits continue from the last one and take half as many."""
    batch_size: int = 256
    """States per step."""
    learning_rate: float = 0.02
    """Step size of Adam at the beginning, for inputs scaled to unit deviation and actions to [-1, 1]; falls to 0."""
    initial_temperature: float = 1.0
    """Temperature at the beginning (deterministic annealing, Rose 1998), in units of the variance of the states in a
    cell: how far beyond its cell a map still counts."""
    final_temperature: float = 0.04
    """Temperature at the end, where borders are almost hard."""
    clip_slope: float = 0.01
    """Slope of the limited action beyond the limits, in the loss: positive, so that the gradient does not vanish."""
    criticality: bool = False
    """Whether states are drawn in proportion to what a wrong action costs there, by the teacher's critics (VIPER,
    Bastani et al. 2018)."""
    n_corrections: int = 2
    """Rounds in which the teacher labels the states that the policy itself visits (DAgger, Ross et al. 2011)."""
    n_correction_episodes: int = 200
    """Episodes of the policy per round."""
    n_generations: int = 200
    """Generations of CMA-ES (Hansen 2016) on the return, at the end."""
    n_tuning_episodes: int = 200
    """Episodes, from fresh starts, that each candidate of a generation plays."""
    tuning_step: float = 0.1
    """First standard deviation of CMA-ES, in scaled units."""
    failure_penalty: float = 0.0
    """Subtracted from the mean return per failed episode, wherever candidates are compared: a mean hides rare failures.
    An episode fails if it does not end in a goal; for tasks without a goal, such as walking, leave it at 0."""
    error_penalty: float = 0.0
    """Subtracted from the mean return per unit of mean squared action error (in half action ranges, on the teacher's
    states). 0 maximises the return alone, however much the policy then differs from the teacher."""
    n_validation: int = 5000
    """Episodes that decide between restarts, between rounds, and between the stages of tuning."""

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(type(self)).items():
            value = getattr(self, name)
            optional = name.endswith("_penalty") or name in ("n_corrections", "n_generations")
            zero = value == 0 and isinstance(value, int | kind) and not isinstance(value, bool)
            if not (optional and zero):  # 0 switches the part off
                check_field(name, value, kind)
        first, last = self.initial_temperature, self.final_temperature
        if last > first:
            raise ValueError(f"final_temperature is {last}, expected at most initial_temperature = {first}")

    def quick(self) -> Refinement:
        """The same method in a tenth of the steps: for a first look, not for results."""
        shrunk = ("n_episodes", "n_steps", "n_correction_episodes", "n_generations", "n_validation")
        values = {name: getattr(self, name) for name in shrunk}
        return dataclasses.replace(self, **{name: value and max(1, value // 10) for name, value in values.items()})


def check_refinement(config: Refinement) -> None:
    """Raise ValueError for anything else, such as a `Config`."""
    if not isinstance(config, Refinement):
        raise ValueError(f"config is {config!r}, expected a Refinement, such as vsp.preset('SimpleGoal-v0', 'best')")


_BEST = {
    "SimpleGoal-v0": Refinement(n_cells=4, n_restarts=6, n_generations=150, failure_penalty=100.0),
    # One failure in ten thousand costs ten points of return: tuning makes the force so gentle that it may not suffice
    "MountainCarContinuous-v0": Refinement(
        n_cells=3, n_episodes=100, n_correction_episodes=50, n_generations=40, n_tuning_episodes=30,
        failure_penalty=100_000.0,
    ),
    "Pendulum-v1": Refinement(
        n_cells=3, n_episodes=60, n_correction_episodes=60, n_generations=60, n_tuning_episodes=60, n_validation=500
    ),
    "LunarLanderContinuous-v3": Refinement(
        n_cells=4, n_episodes=200, n_correction_episodes=100, n_generations=40, n_tuning_episodes=20, n_validation=200,
    ),
}  # fmt: skip


def best_preset(task: str | Task) -> Refinement:
    """The best settings known for `task`. Raises ValueError for a task without any."""
    name = get_task(task).name
    if name not in _BEST:
        raise ValueError(f"no preset for task {name!r}, expected one of {list(_BEST)}: write a Refinement of your own")
    return _BEST[name]
