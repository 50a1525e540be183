"""How each teacher is trained."""

import hashlib
from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """Arguments of Stable-Baselines3's TD3 for one teacher; the policy is MlpPolicy, [400, 300], ReLU."""

    steps: int  # environment steps
    batch_size: int = 256
    train_freq: tuple[int, str] = (1, "step")
    gradient_steps: int = 1  # per training phase; -1: as many as steps were taken
    learning_rate: float = 1e-3
    gamma: float = 0.99  # discount per step
    buffer_size: int = 1_000_000
    learning_starts: int = 100
    noise: str = "normal"  # exploration noise: "normal" or "ornstein-uhlenbeck"
    noise_std: float = 0.1  # its standard deviation, in units of the action

    @property
    def id(self) -> str:
        """Eight hexadecimal digits of a hash: a checkpoint is resumed only with the same recipe."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:8]


RECIPES = {
    # "500.000 steps using the standard parameters": the library's defaults, with the exploration noise of the
    # TD3 article (Fujimoto et al. 2018); without noise, training never discovers that a short last step pays
    "SimpleGoal-v0": Recipe(steps=500_000),
    # RL Zoo's recipe with the library defaults of that time (batch 100, one training phase per episode)
    "MountainCarContinuous-v0": Recipe(
        steps=300_000, batch_size=100, train_freq=(1, "episode"), gradient_steps=-1,
        noise="ornstein-uhlenbeck", noise_std=0.5,
    ),
    # RL Zoo's recipe
    "Pendulum-v1": Recipe(steps=20_000, gamma=0.98, buffer_size=200_000, learning_starts=10_000),
    # With RL Zoo's recipe the return rises and falls; a larger buffer, a higher gamma and smaller steps stabilise it
    "LunarLanderContinuous-v3": Recipe(steps=450_000, learning_rate=3e-4, learning_starts=10_000),
    # RL Zoo's recipe with fewer steps
    "BipedalWalker-v3": Recipe(steps=300_000, gamma=0.98, buffer_size=200_000, learning_starts=10_000),
    "HalfCheetah-v5": Recipe(steps=350_000, learning_starts=10_000),
}  # fmt: skip

# Tasks whose teacher is the best snapshot of the learning curve; for other tasks it is the last one
BEST_OF_CURVE = ("LunarLanderContinuous-v3", "BipedalWalker-v3", "HalfCheetah-v5")
