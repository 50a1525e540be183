"""Batched episodes of any policy in any task: all episodes of a batch advance together."""

from dataclasses import InitVar, dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from .checks import check_array, check_data, check_finite
from .tasks import RUNNING, TRUNCATED, Task, get_task

Steps = list[tuple[np.ndarray, np.ndarray, np.ndarray]]  # running episodes (a,), observations (a, d), actions (a, m)


class Policy(Protocol):
    """Any object with Stable-Baselines3's `predict`: observations (n, d) to clipped actions (n, m), and no state."""

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]: ...  # noqa: D102


@dataclass(frozen=True)
class Episode:
    """One recorded episode of T steps: the states, and the actions taken in them. Raises ValueError unless all numbers
    are finite and T is the same for both and at least 1. `checked` skips this."""

    states: np.ndarray  # (T, d) float64, as the policy observed them
    actions: np.ndarray  # (T, m) float64
    checked: InitVar[bool] = False

    def __post_init__(self, checked: bool) -> None:
        if not checked:
            for name, values in zip(("states", "actions"), check_data(self.states, self.actions)):
                object.__setattr__(self, name, values)


class Episodes(list[Episode]):
    """Recorded episodes of one agent, and all their steps in two arrays."""

    @property
    def states(self) -> np.ndarray:
        """All states, episode by episode. (t, d)"""
        return np.concatenate([episode.states for episode in self])

    @property
    def actions(self) -> np.ndarray:
        """The actions taken there. (t, m)"""
        return np.concatenate([episode.actions for episode in self])


@dataclass(frozen=True)
class Outcomes:
    """How n episodes ended."""

    returns: np.ndarray  # (n,) undiscounted sum of rewards
    lengths: np.ndarray  # (n,) steps
    outcomes: np.ndarray  # (n,) how each ended, an index of `vsp.tasks.OUTCOMES`


def rollout(policy: Policy, task: str | Task, starts: np.ndarray) -> Outcomes:
    """Run one episode of `policy` from each start state (n, s). Raises ValueError for starts that are not finite or lie
    outside the box, and for a policy that does not fit the task or whose actions are not finite."""
    return _play(policy, get_task(task), starts)


def record(policy: Policy, task: str | Task, starts: np.ndarray) -> tuple[Outcomes, Episodes]:
    """Run one episode from each start state (n, s); return how they ended, and every state and action of each. Raises
    ValueError as `rollout` does."""
    steps: Steps = []
    outcomes = _play(policy, get_task(task), starts, steps)
    index, states, actions = (np.concatenate(parts) for parts in zip(*steps))
    order = np.argsort(index, kind="stable")  # by episode; steps stay in time order
    states, actions = check_finite("states", states[order]), actions[order]
    parts = pairwise([0, *np.cumsum(outcomes.lengths).tolist()])
    return outcomes, Episodes(Episode(states[i:j], actions[i:j], checked=True) for i, j in parts)


def collect_episodes(policy: Policy, task: str | Task, starts: np.ndarray) -> Episodes:
    """Return the episodes of `record`, in the order of `starts`. Raises ValueError as `rollout` does."""
    return record(policy, task, starts)[1]


def visited_states(policy: Policy, task: str | Task, starts: np.ndarray) -> np.ndarray:
    """Return all states (t, d) that are visited from the start states (n, s), episode by episode. Raises ValueError as
    `rollout` does, and if there are no start states."""
    episodes = collect_episodes(policy, task, starts)
    if not episodes:
        raise ValueError("there are no start states, expected at least one")
    return episodes.states


def standard(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean and standard deviation of `states` (n, d); a variable that never varies gets deviation 1."""
    states = check_array("states", states, (-1, -1))
    if not states.size:
        raise ValueError(f"states have shape {states.shape}, expected at least one state")
    varies = np.ptp(states, axis=0) > 0  # the deviation of a constant may be a rounding error above 0
    return states.mean(axis=0), np.where(varies, states.std(axis=0), 1.0)


def _play(policy: Policy, task: Task, starts: np.ndarray, steps: Steps | None = None) -> Outcomes:
    """Run episodes from `starts` (n, s) to their ends, at most `task.at_once` together. If `steps` is a list, the
    observations and actions of each step are appended to it."""
    if not callable(getattr(policy, "predict", None)):
        raise ValueError(f"the policy is {policy!r}, expected something with `predict`: `vsp.agent` wraps other agents")
    starts = check_array("start states", starts, (-1, task.start_size or len(task.low)))
    n = len(starts)
    result = Outcomes(np.zeros(n), np.zeros(n, dtype=np.int64), np.full(n, TRUNCATED))
    size = task.at_once or max(1, n)
    for first in range(0, max(1, n), size):
        states = task.begin(starts[first : first + size])
        try:
            _check_inside(task, task.see(states))
            _advance(policy, task, states, first, result, steps)
        finally:  # also after an interrupt
            task.end(states)
        del states  # before the next ones begin
    check_finite(f"the summed rewards of {task.name}", result.returns)
    return result


def _check_inside(task: Task, seen: np.ndarray) -> None:
    """Raise ValueError if first observations `seen` (n, d) leave the box by more than the rounding of float32."""
    inside = np.isclose(seen, np.clip(seen, task.low, task.high), rtol=np.finfo(np.float32).eps, atol=0.0).all(axis=1)
    if not inside.all():
        first, low, high = seen[inside.argmin()].tolist(), task.low.tolist(), task.high.tolist()
        raise ValueError(f"first observation {first} lies outside the box of {task.name}, {low} to {high}: widen it")


def _advance(policy: Policy, task: Task, states: np.ndarray, first: int, result: Outcomes, steps: Steps | None) -> None:
    """Run episodes from `states` to their ends, all together; finished ones leave the batch. They are entered in
    `result` from the number `first` on."""
    active = np.arange(first, first + len(states))  # numbers of the running episodes
    for t in range(task.max_steps):
        observations = task.observe(states)
        actions = _act(policy, task, observations)
        if steps is not None:
            steps.append((active, observations.astype(np.float64), actions))
        states, rewards, ended = task.step(states, actions)
        result.returns[active] += rewards
        done = ended != RUNNING
        result.outcomes[active[done]] = ended[done]
        result.lengths[active] = t + 1
        active, states = active[~done], states[~done]
        if not len(active):
            break


def _act(policy: Policy, task: Task, observations: np.ndarray) -> np.ndarray:
    """Return the policy's actions (n, m) in float64. Raises ValueError unless they fit the task and are finite."""
    (n, d), m = observations.shape, len(task.action_low)
    try:
        actions = np.asarray(policy.predict(observations)[0])
    except (ValueError, TypeError, IndexError) as error:
        raise ValueError(f"the policy fails on the {d} inputs of {task.name}: {error}") from error
    if actions.shape != (n, m):
        what = f"the policy's actions have shape {actions.shape}, expected {(n, m)} for {task.name}"
        raise ValueError(f"{what}: it must be made for this task, and gets a batch of observations {(n, d)}")
    return check_finite("the policy's actions", actions)
