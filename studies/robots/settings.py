"""`Walking`: the settings of all methods that make policies for robots, and its presets."""

from dataclasses import dataclass

from vsp import Task, get_task


@dataclass(frozen=True)
class Walking:
    """How a robot's teacher is imitated and how the policy is tuned."""

    # Cells of the policy.
    n_cells: int
    # Standard deviation of the noise on the teacher's actions, in half action ranges: the teacher labels the
    # states that this noise leads to (DART, Laskey et al. 2017).
    push: float = 0.4
    # Episodes of the teacher. With the noise it plays twice as many.
    n_episodes: int = 20
    # Rounds in which the teacher labels the states that the policy itself visits (DAgger, Ross et al. 2011).
    n_corrections: int = 12
    # Episodes of the policy per round.
    n_correction_episodes: int = 10
    # States that a fit uses, as dense as all of them (`units.spread`).
    n_states: int = 30_000
    # Descents from different random initial cells in the first round; the closest imitation is kept.
    n_restarts: int = 8
    # Episodes over which policies are compared; the best are compared again over more (`most_rewarding`).
    n_validation: int = 20
    # Steps for which TD3 continues, with the cells as its actor.
    n_steps: int = 320_000
    # The first of these steps, in which the replay buffer fills and nothing learns.
    n_filling: int = 5000
    # Initial learning rate of Adam for the cells; it falls linearly to 0, and the cells come to rest.
    learning_rate: float = 2e-4
    # Initial learning rate of Adam for the critics, as in the teacher's own training; it falls to a tenth.
    critic_rate: float = 1e-3
    # Steps from the replay buffer that each update uses.
    batch_size: int = 100
    # Discount per step, as in the teacher's own training.
    gamma: float = 0.99
    # How soft the borders are while TD3 learns, in squared deviations of the states.
    temperature: float = 0.3
    # Steps of the random search for one linear map.
    n_random_steps: int = 20_000_000
    # Directions that a round of the random search tries, forwards and backwards.
    n_directions: int = 32
    # Number of the best directions, which the map follows.
    n_best: int = 4
    # Step size along these directions, for returns scaled to unit deviation.
    step_size: float = 0.02
    # Standard deviation of the changes that are tried.
    search_noise: float = 0.03


def walking_preset(task: str | Task) -> Walking:
    """Return the settings for a robot, eight cells; other tasks get those of HalfCheetah. Raises ValueError as
    `get_task` does."""
    # The walker's engine takes three times as long for a step. So TD3 takes half the steps, and the search for one map
    # has more rounds of fewer directions and follows all of them
    if get_task(task).name == "BipedalWalker-v3":
        return Walking(n_cells=8, gamma=0.98, n_steps=160_000, n_random_steps=6_000_000, n_directions=16, n_best=16)
    return Walking(n_cells=8)
