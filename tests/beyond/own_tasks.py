"""Two environments as a reader would write them, each with a scripted pilot."""

import gymnasium
import numpy as np


class Dock(gymnasium.Env):
    """A ship without friction docks at the origin; a rock lies in the way. (east, north, their speeds)"""

    observation_space = gymnasium.spaces.Box(-3.0, 3.0, (4,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float64)
    ROCK, RADIUS = np.array([0.8, 0.8]), 0.3

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = np.append(self.np_random.uniform([1.2, 1.2], [2.0, 2.0]), [0.0, 0.0])
        return self.state.copy(), {}

    def step(self, action):
        place, speed = self.state[:2], self.state[2:] + 0.1 * np.clip(action, -1, 1)
        self.state = np.clip(np.append(place + 0.1 * speed, speed), -3, 3)
        away, rock = np.linalg.norm(self.state[:2]), np.linalg.norm(self.state[:2] - self.ROCK) < self.RADIUS
        docked = away < 0.15
        reward = -0.1 * away + 10.0 * docked - 10.0 * rock
        return self.state.copy(), reward, bool(docked or rock), False, {"docked": bool(docked)}


def dock_pilot(states):
    """Brakes towards the origin, and passes south of the rock."""
    place, speed = states[:, :2], states[:, 2:]
    aim = np.where((place[:, 1] > 0.4)[:, None], [1.4, 0.0], [0.0, 0.0])
    return np.clip(1.5 * (aim - place) - 1.8 * speed, -1, 1)


class Tank(gymnasium.Env):
    """A valve fills a tank that drains, the faster the fuller, up to a mark. (level, mark)"""

    observation_space = gymnasium.spaces.Box(0.0, 2.0, (2,), np.float32)
    action_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = self.np_random.uniform([0.1, 0.5], [1.5, 1.2])
        return self.state.copy(), {}

    def step(self, action):
        level = self.state[0] + 0.2 * (float(action[0]) - 0.6 * np.sqrt(self.state[0]))
        self.state = np.array([np.clip(level, 0.0, 2.0), self.state[1]])
        return self.state.copy(), -abs(self.state[0] - self.state[1]), False, False, {}


def tank_pilot(states):
    """What drains at the mark, and more the further the level is below it."""
    level, mark = states.T
    return np.clip(0.6 * np.sqrt(mark) + 3.0 * (mark - level), 0, 1)[:, None]


for name, kind, steps in (("Dock-v0", Dock, 200), ("Tank-v0", Tank, 60)):
    gymnasium.register(name, entry_point=f"own_tasks:{kind.__name__}", max_episode_steps=steps)
