"""`Tuned` and `Faithful`: the settings of `distill_tuned` and `distill_faithfully`, and presets for any task."""

import dataclasses
from dataclasses import dataclass

from vsp.checks import check_count, check_number
from vsp.config import check_field, kinds_of
from vsp.tasks import Task, get_task

MOST_CELLS, MOST = 1000, 10**8  # largest plausible number of cells, and of anything else: a larger value is a mistake


@dataclass(frozen=True)
class Tuned:
    """How `distill_tuned` finds a few cells, all their numbers together. Raises ValueError for a value out of range."""

    n_cells: int
    """Cells of the policy."""
    n_episodes: int = 500
    """Episodes of the teacher that the first fit sees."""
    n_restarts: int = 3
    """Fits from different random initial cells; the one with the best validation score is kept."""
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
    An episode fails if it does not end in a goal. For tasks without a goal, such as walking, leave it at 0."""
    n_validation: int = 5000
    """Episodes that decide between restarts, between rounds, and between the stages of tuning."""

    def __post_init__(self) -> None:
        for name, kind in kinds_of(type(self)).items():
            value = getattr(self, name)
            optional = name in ("n_corrections", "n_generations", "failure_penalty")
            off = optional and isinstance(value, int | kind) and not isinstance(value, bool) and value == 0
            if not off:
                check_field(name, value, kind)
        first, last = self.initial_temperature, self.final_temperature
        if last > first:
            raise ValueError(f"final_temperature is {last}, expected at most initial_temperature = {first}")

    def quick(self) -> "Tuned":
        """The same method in a tenth of the steps: for a first look, not for results."""
        return _tenth(self, "n_episodes", "n_steps", "n_correction_episodes", "n_generations", "n_validation")


@dataclass(frozen=True)
class Faithful:
    """How `distill_faithfully` finds few cells that act like the teacher. Raises ValueError for a value out of
    range."""

    n_cells: int
    """Cells of the policy, at most."""
    tolerance: float | None = None
    """Tolerance of the mean return, in units of return: a candidate is accepted if it misses its target by at most half
    of it. None: 2 % of the teacher's mean return."""
    margin: float = 0.0
    """Target for the mean return minus the teacher's, from the same starts."""
    failure_penalty: float = 0.0
    """Subtracted from the mean return per failed episode, as in `Tuned`."""
    min_r2: float | None = None
    """None: find the policy most like the teacher among those that return enough. Otherwise, find the highest return
    among policies whose R² is at least this: a point on the trade-off between the teacher's actions and the best
    return."""
    n_episodes: int = 30_000
    """Episodes of the teacher that the fit sees."""
    n_states: int = 60_000
    """States of these episodes that are kept, as dense as all of them (`units.spread`)."""
    n_restarts: int = 32
    """Descents from different random initial cells; the closest imitation is kept."""
    n_generations: int = 250
    """Generations of CMA-ES that raise the return where it is below the teacher's."""
    n_tuning_episodes: int = 500
    """Episodes that each candidate of a generation plays; the starts are drawn anew from twenty times as many."""
    n_validation: int = 5000
    """Episodes that decide which candidate is kept."""

    def __post_init__(self) -> None:
        check_count("n_cells", self.n_cells, most=MOST_CELLS)
        for name in ("n_episodes", "n_states", "n_restarts", "n_tuning_episodes", "n_validation"):
            check_count(name, getattr(self, name), most=MOST)
        check_count("n_generations", self.n_generations, least=0, most=MOST)
        check_number("margin", self.margin)
        check_number("failure_penalty", self.failure_penalty, least=0.0)
        if self.tolerance is not None:
            check_field("tolerance", self.tolerance, float)
        if self.min_r2 is not None:
            check_number("min_r2", self.min_r2, least=0.0, most=1.0)

    def quick(self) -> "Faithful":
        """The same method in a tenth of the work: for a first look, not for results."""
        return _tenth(self, "n_episodes", "n_restarts", "n_generations", "n_validation")


def _tenth(config, *names: str):
    """Return `config` with a tenth of each of these numbers, at least 1 where the number is not 0."""
    values = {name: getattr(config, name) for name in names}
    return dataclasses.replace(config, **{name: value and max(1, value // 10) for name, value in values.items()})


def check_kind(config: object, kind: type) -> None:
    """Raise ValueError unless `config` is of `kind`, `Faithful` or `Tuned`."""
    if not isinstance(config, kind):
        preset = f"vsp_beyond.{kind.__name__.lower()}_preset('SimpleGoal-v0')"
        raise ValueError(f"config is a {type(config).__name__}, expected a {kind.__name__}, such as {preset}")


_FAITHFUL = {
    "SimpleGoal-v0": Faithful(
        n_cells=8, tolerance=0.03, failure_penalty=100.0, n_generations=200, n_validation=20_000
    ),
    "MountainCarContinuous-v0": Faithful(
        n_cells=2, tolerance=0.1, margin=0.1, failure_penalty=100_000.0, n_episodes=2000,
        n_generations=60, n_tuning_episodes=60, n_validation=2000,
    ),
    "Pendulum-v1": Faithful(
        n_cells=8, tolerance=1.0, n_episodes=1500, n_generations=60, n_tuning_episodes=100,
        n_validation=1000,
    ),
    # Many generations of few episodes: a third as many generations, of 40 episodes, did not reach the target. Without a
    # failure penalty, some seeds end with a crash in forty landings
    "LunarLanderContinuous-v3": Faithful(
        n_cells=8, tolerance=4.0, margin=3.0, failure_penalty=100.0, n_episodes=300, n_generations=130,
        n_tuning_episodes=12, n_validation=300,
    ),
}  # fmt: skip


def faithful_preset(task: str | Task, *, n_cells: int | None = None, min_r2: float | None = None) -> Faithful:
    """Return the settings of `distill_faithfully` for any task; `n_cells` and `min_r2` as in `Faithful`. For a task
    without tested settings, they follow from its dimensions, its length, and whether it has a physics engine, which
    steps one state at a time."""
    task = get_task(task)
    generations, tuning, validation = (40, 20, 200) if task.one_by_one else (100, 100, 1000)
    by_size = Faithful(
        n_cells=6, n_episodes=_episodes(task), n_restarts=32 if len(task.low) <= 8 else 16, n_generations=generations,
        n_tuning_episodes=tuning, n_validation=validation,
    )  # fmt: skip
    config = _FAITHFUL.get(task.name, by_size)
    return dataclasses.replace(config, n_cells=config.n_cells if n_cells is None else n_cells, min_r2=min_r2)


def _episodes(task: Task) -> int:
    """Return how many episodes of the teacher are enough for a task without tested settings."""
    steps = 60_000 if task.one_by_one else 300_000  # if all episodes have the maximum length
    return min(max(100, steps // task.max_steps), 30_000)


TUNED = {
    "SimpleGoal-v0": Tuned(n_cells=4, n_restarts=6, n_generations=150, failure_penalty=100.0),
    # One failure in ten thousand costs ten points of return: else tuning makes the force so gentle that it may fail
    "MountainCarContinuous-v0": Tuned(
        n_cells=3, n_episodes=100, n_correction_episodes=50, n_generations=40, n_tuning_episodes=30,
        failure_penalty=100_000.0,
    ),
    "Pendulum-v1": Tuned(
        n_cells=3, n_episodes=60, n_correction_episodes=60, n_generations=60, n_tuning_episodes=60, n_validation=500
    ),
    "LunarLanderContinuous-v3": Tuned(
        n_cells=4, n_episodes=200, n_correction_episodes=100, n_generations=40, n_tuning_episodes=20, n_validation=200,
    ),
}  # fmt: skip


def tuned_preset(task: str | Task) -> Tuned:
    """Return the settings of `distill_tuned` for any task, chosen for a high return. For a task without tested
    settings, they follow from its size, as those of `faithful_preset` do."""
    task = get_task(task)
    tuning, validation = (20, 200) if task.one_by_one else (60, 500)
    by_size = Tuned(
        n_cells=4, n_episodes=min(_episodes(task), 500), n_correction_episodes=100, n_generations=60,
        n_tuning_episodes=tuning, n_validation=validation,
    )  # fmt: skip
    return TUNED.get(task.name, by_size)
