"""SimpleGoal (paper, section "Navigation task"): its dynamics on arrays, and a Gymnasium class over them."""

import gymnasium
import numpy as np

from ..checks import check_array
from .base import GOAL, OUTCOMES, PIT, RUNNING, Task

GOAL_EDGE = 0.1  # the goal is the box x < 0.1, y < 0.1
PIT_LOW, PIT_HIGH = 0.4, 0.6  # the pit is the open square between them
STRIDE = 0.1  # length of a step at full action, per axis


def start(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw starts uniformly over the whole unit square, pit and goal included. (n, 2)"""
    return rng.uniform(0.0, 1.0, size=(n, 2))


def step(states: np.ndarray, actions: np.ndarray, *, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move by a tenth of the action; the reward is ten times the distance gained towards the origin. Entering the goal
    pays +10 and entering the pit -10 instead. The paper's text adds them to the progress, but its numbers do not: its
    teacher's minimum is exactly -10.0. `margin` makes the goal smaller, and the pit larger, on every side."""
    moved = np.clip(states + STRIDE * np.clip(actions, -1.0, 1.0), 0.0, 1.0)
    progress = 10.0 * (np.hypot(states[:, 0], states[:, 1]) - np.hypot(moved[:, 0], moved[:, 1]))
    in_goal = (moved < GOAL_EDGE - margin).all(axis=1)
    in_pit = ((moved > PIT_LOW - margin) & (moved < PIT_HIGH + margin)).all(axis=1)
    rewards = np.select([in_goal, in_pit], [10.0, -10.0], progress)
    outcomes = np.select([in_goal, in_pit], [GOAL, PIT], RUNNING)
    return moved, rewards, outcomes


class SimpleGoalEnv(gymnasium.Env):
    """SimpleGoal for Gymnasium: one episode at a time over `start` and `step`."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, render_mode: str | None = None):
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (2,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.render_mode = render_mode
        self.state = np.zeros(2)  # float64; the observation is its float32 copy

    def reset(self, *, seed: int | None = None, options: dict | None = None):  # noqa: D102
        super().reset(seed=seed)
        self.state = start(self.np_random, 1)[0]
        return self.state.astype(np.float32), {}

    def step(self, action: np.ndarray):  # noqa: D102
        action = check_array("action", action, (2,))
        (self.state,), (reward,), (outcome,) = step(self.state[None], action[None])
        info = {"outcome": OUTCOMES[outcome]}
        return self.state.astype(np.float32), float(reward), bool(outcome != RUNNING), False, info

    def render(self) -> np.ndarray:
        """A picture (400, 400, 3) in bytes: goal blue-green, pit grey, agent dark blue; y points up."""
        x, y = np.meshgrid((np.arange(400) + 0.5) / 400, (399.5 - np.arange(400)) / 400)
        image = np.full((400, 400, 3), 255, np.uint8)
        image[(x < GOAL_EDGE) & (y < GOAL_EDGE)] = (2, 158, 115)
        image[(x > PIT_LOW) & (x < PIT_HIGH) & (y > PIT_LOW) & (y < PIT_HIGH)] = (128, 128, 128)
        image[np.hypot(x - self.state[0], y - self.state[1]) < 0.02] = (1, 60, 130)
        return image


TASK = Task(
    name="SimpleGoal-v0",
    inputs=("x", "y"),
    outputs=("Δx", "Δy"),
    input_labels=("x", "y"),
    low=np.zeros(2),
    high=np.ones(2),
    action_low=-np.ones(2),
    action_high=np.ones(2),
    max_steps=50,
    start=start,
    step=step,
)
