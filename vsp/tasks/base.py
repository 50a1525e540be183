"""The interface of a task: dynamics on arrays of states, so that a thousand episodes advance in one call.

Every function of states takes a batch of n and returns a batch. To add a task, write a module like
`mountaincar.py` and enter its `TASK` in `registry.py`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

RUNNING, GOAL, PIT, TRUNCATED, ENDED = range(5)
OUTCOMES = ("running", "goal", "pit", "truncated", "ended")  # "ended": the task defines no success

Step = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def _unchanged(states: np.ndarray) -> np.ndarray:
    """Return the same array: in most tasks starts, states and observations are the same."""
    return states


@dataclass(frozen=True)
class Task:
    """A continuous-control task whose observations and actions are boxes.

    `start(rng, n)` draws n starts (n, s) in float64. `begin` turns starts into states, a batch of n. `step(states,
    actions)` takes actions (n, m) and returns the next states, the rewards (n,) and the outcomes (n,), indices of
    `OUTCOMES`. The caller counts steps, truncates, and at last calls `end` with what `begin` returned. `see` turns
    states into observations (n, d). In most tasks start, state and observation are the same array (n, d)."""

    name: str
    inputs: tuple[str, ...]  # symbols of the d observed variables, as the paper prints them
    outputs: tuple[str, ...]  # symbols of the m actions
    input_labels: tuple[str, ...]  # axis labels, with units
    low: np.ndarray  # (d,) box of the observations
    high: np.ndarray  # (d,)
    action_low: np.ndarray  # (m,) box of the actions
    action_high: np.ndarray  # (m,)
    max_steps: int  # an episode is truncated after this many steps
    start: Callable[[np.random.Generator, int], np.ndarray]
    step: Step
    see: Callable[[np.ndarray], np.ndarray] = _unchanged
    begin: Callable[[np.ndarray], np.ndarray] = _unchanged
    start_size: int | None = None  # s; None: s is d
    slowness: int = 1  # evaluations divide their number of episodes by this, because an engine steps slowly
    at_once: int | None = None  # at most so many episodes run together, because each holds an engine; None: all
    end: Callable[[np.ndarray], object] = _unchanged  # closes what `begin` opened; arrays hold nothing open

    @property
    def one_by_one(self) -> bool:
        """Whether states are objects of a physics engine, which steps them one at a time."""
        return self.begin is not _unchanged

    def observe(self, states: np.ndarray) -> np.ndarray:
        """Return observations of `states` in float32, as Gymnasium returns them. (n, d)"""
        return self.see(states).astype(np.float32)
