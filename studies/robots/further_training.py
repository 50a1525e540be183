"""Continue the teacher's training with a few cells as its actor, and its critics: TD3 (Fujimoto et al. 2018) learns
from every single step, CMA-ES only from whole episodes. That takes it to policies of a thousand numbers."""

import numpy as np

from vsp import Policy
from vsp.teachers.teacher import Teacher
from vsp_beyond.few_cells.units import ScaledCells, Scaling

from .imitation import most_rewarding
from .settings import Walking

N_CHOICES = 20  # actors kept as candidates, evenly spread over the training
NOISE = 0.1  # standard deviation of exploration, as in the teacher's own training
STEPS_PER_UPDATE = 2  # twice as many updates for the same steps do not raise the return


def train_further(frame: Scaling, numbers, teacher: Teacher, config: Walking, *, seed: int) -> Policy:
    """Return the most rewarding of the first policy and `N_CHOICES` policies during training. Same arguments, same
    policy. `numbers`: `ScaledCells`, or a tree in these units that a `SoftActor` takes. The teacher has critics."""
    import torch

    policy_of = frame.policy if isinstance(numbers, ScaledCells) else lambda tree: tree
    start, noise = np.random.SeedSequence(seed).spawn(2)
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)  # Adam's moments of unused weights decay into denormal numbers, which are slow
    try:
        model, tried = _model(frame, numbers, teacher, config, int(noise.generate_state(1)[0])), [policy_of(numbers)]
        for _ in range(N_CHOICES):
            model.learn(max(1, config.n_steps // N_CHOICES), reset_num_timesteps=False, log_interval=None)
            tried.append(policy_of(model.actor.mu.numbers))
    finally:
        torch.set_flush_denormal(False)  # other code in this process may need them
    return most_rewarding(tried, frame.task, config.n_validation, np.random.default_rng(start))


def _model(frame: Scaling, numbers, teacher: Teacher, config: Walking, seed: int):
    """Build the library's TD3 with the cells as its actor, and with the teacher's critics."""
    import gymnasium
    import torch
    from stable_baselines3 import TD3
    from stable_baselines3.common.noise import NormalActionNoise

    from .soft_actor import SoftActor

    class Patient(TD3):
        """TD3 that waits until the replay buffer is filled, and whose actor has its own, falling learning rate."""

        def train(self, gradient_steps: int, batch_size: int = 100) -> None:
            if self.num_timesteps > config.n_filling:
                super().train(gradient_steps, batch_size)

        def _update_learning_rate(self, optimizers: list) -> None:
            """The cells' rate falls to 0, so that they come to rest; the critics' to a tenth, so that they follow."""
            left = max(0.0, 1 - self.num_timesteps / config.n_steps)
            for optimizer, rate in (
                (self.actor.optimizer, config.learning_rate * left),
                (self.critic.optimizer, config.critic_rate * max(left, 0.1)),
            ):
                for group in optimizer.param_groups:
                    group["lr"] = rate

    critics = {name: torch.tensor(value) for name, value in teacher.critic.items()}
    biases = sorted(name for name in critics if name.startswith("qf0") and name.endswith("bias"))  # layer by layer
    hidden = [len(critics[name]) for name in biases[:-1]]
    m = len(frame.task.action_low)
    model = Patient(
        "MlpPolicy", gymnasium.make(frame.task.name), learning_rate=config.critic_rate, gamma=config.gamma,
        buffer_size=config.n_steps, learning_starts=0, batch_size=config.batch_size, train_freq=STEPS_PER_UPDATE,
        gradient_steps=1, seed=seed, device="cpu",
        action_noise=NormalActionNoise(np.zeros(m), NOISE * np.ones(m)),
        policy_kwargs={"net_arch": {"pi": [], "qf": hidden}, "optimizer_kwargs": {"fused": True}},
    )  # fmt: skip
    for actor in (model.actor, model.actor_target):  # the target stays soft, like the actor whose gradient is used
        actor.mu = SoftActor(frame, numbers, config.temperature)
    model.actor.optimizer = torch.optim.Adam(model.actor.parameters(), lr=config.learning_rate, fused=True)
    for critic in (model.critic, model.critic_target):
        critic.load_state_dict(critics)
    return model
