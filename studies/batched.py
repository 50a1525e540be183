"""A `Task` as Stable-Baselines3 wants many environments: all of them advance together."""

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from vsp.tasks import RUNNING, Task


class Batched(VecEnv):
    """`n` environments of `task`. Each begins again where it ends; the first episodes end at different times."""

    def __init__(self, task: Task, n: int, rng: np.random.Generator):
        boxes = ((task.low, task.high), (task.action_low, task.action_high))
        super().__init__(n, *(gymnasium.spaces.Box(*map(np.float32, box)) for box in boxes))
        self._task, self._rng = task, rng

    def reset(self):
        """Begin everywhere. Returns observations (n, d)."""
        self._states = self._task.start(self._rng, self.num_envs)
        self._steps = self._rng.integers(self._task.max_steps, size=self.num_envs)
        self._returns = np.zeros(self.num_envs)
        return self._task.observe(self._states)

    def step_async(self, actions):
        """Take the actions (n, m) of the next step."""
        self._actions = actions.astype(np.float64)

    def step_wait(self):
        """Return observations, rewards, which ended, and what the library wants to know of those."""
        self._states, rewards, outcomes = self._task.step(self._states, self._actions)
        self._steps, self._returns = self._steps + 1, self._returns + rewards
        seen, infos = self._task.observe(self._states), [{} for _ in range(self.num_envs)]
        ended = (outcomes != RUNNING) | (self._steps >= self._task.max_steps)
        for i in np.flatnonzero(ended):
            episode = {"r": self._returns[i], "l": self._steps[i], "t": 0.0}
            cut = outcomes[i] == RUNNING
            infos[i] = {"terminal_observation": seen[i], "TimeLimit.truncated": cut, "episode": episode}
        self._states[ended] = self._task.start(self._rng, int(ended.sum()))
        self._steps[ended], self._returns[ended] = 0, 0.0
        return self._task.observe(self._states), rewards.astype(np.float32), ended, infos

    def close(self):
        """Nothing is open."""

    def env_is_wrapped(self, wrapper_class, indices=None):
        """No environment is wrapped."""
        return [False] * self.num_envs

    def get_attr(self, attr_name, indices=None):
        """No environment has attributes."""
        return [None] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        """No environment has attributes."""

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        """No environment has methods."""
