"""What tests of the studies share: little work."""

from vsp_beyond import Tuned

SMALL = Tuned(
    n_cells=2, n_episodes=20, n_restarts=2, n_steps=100, batch_size=64, n_corrections=2, n_correction_episodes=10,
    n_generations=1, n_tuning_episodes=10, n_validation=20,
)  # fmt: skip
