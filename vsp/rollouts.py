"""Batched episodes of any policy in any task: all episodes of a batch advance together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .checks import check_array, check_data, check_finite
from .envs import RUNNING, TRUNCATED, Task, get_task


class Policy(Protocol):
    """Anything with Stable-Baselines3's `predict`: observations (n, d) to clipped actions (n, m) and no state."""

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]: ...


@dataclass(frozen=True)
class Episode:
    """One recorded episode of T steps: the states acted in and the actions taken there.

    Raises ValueError unless both are finite and as many, at least one.
    """

    states: np.ndarray  # (T, d) float64, as the policy observed them
    actions: np.ndarray  # (T, m) float64

    def __post_init__(self) -> None:
        for name, values in zip(("states", "actions"), check_data(self.states, self.actions)):
            object.__setattr__(self, name, values)


@dataclass(frozen=True)
class Outcomes:
    """How n episodes ended."""

    returns: np.ndarray  # (n,) undiscounted sum of rewards
    lengths: np.ndarray  # (n,) steps
    codes: np.ndarray  # (n,) outcomes, codes of vsp.envs.OUTCOMES


def play(policy: Policy, task: str | Task, starts: np.ndarray) -> Outcomes:
    """Play one episode of `policy` from each start state (n, s).

    Raises ValueError for starts that are not finite or lie outside the box, and for a policy that does not fit.
    """
    result, _ = _advance(policy, task, starts, record=False)
    return result


def record(policy: Policy, task: str | Task, starts: np.ndarray) -> list[Episode]:
    """Play one episode from each start state (n, d) and keep every state and action, in the order of `starts`.

    Raises ValueError as `play` does.
    """
    _, steps = _advance(policy, task, starts, record=True)
    if not len(starts):
        return []
    index = np.concatenate([active for active, _, _ in steps])
    order = np.argsort(index, kind="stable")  # by episode; steps stay in time order
    states = np.concatenate([s for _, s, _ in steps])[order]
    actions = np.concatenate([a for _, _, a in steps])[order]
    cuts = np.cumsum(np.bincount(index, minlength=len(starts)))[:-1]
    return [Episode(s, a) for s, a in zip(np.split(states, cuts), np.split(actions, cuts))]


def visited(policy: Policy, task: str | Task, starts: np.ndarray) -> np.ndarray:
    """All states (t, d) on the way from the start states (n, s), episode by episode. Raises ValueError as `play` does,
    and for no starts."""
    episodes = record(policy, task, starts)
    if not episodes:
        raise ValueError("there are no start states, expected at least one")
    return np.concatenate([episode.states for episode in episodes])


def _advance(policy: Policy, task: str | Task, starts: np.ndarray, *, record: bool):
    """The loop behind `play` and `record`; finished episodes leave the batch."""
    task = get_task(task)
    if not callable(getattr(policy, "predict", None)):
        raise ValueError(
            f"the policy is {policy!r}, expected something with `predict`, which `vsp.agent` makes of others"
        )
    starts = check_array("start states", starts, (-1, task.start_size or len(task.low)))
    states = task.begin(starts)
    seen = task.see(states)
    outside = (seen < task.low) | (seen > task.high)
    if outside.any():
        row = np.flatnonzero(outside.any(axis=1))[0]
        low, high = task.low.tolist(), task.high.tolist()
        raise ValueError(f"start state {starts[row].tolist()} lies outside the box of {task.name}, {low} to {high}")
    n = len(states)
    returns, lengths = np.zeros(n), np.zeros(n, dtype=np.int64)
    outcomes = np.full(n, TRUNCATED)
    active = np.arange(n)
    steps = []
    for t in range(task.max_steps):
        observations = task.observe(states)
        actions = _act(policy, task, observations)
        if record:
            steps.append((active, observations.astype(np.float64), actions))
        states, rewards, ended = task.step(states, actions)
        returns[active] += rewards
        done = ended != RUNNING
        outcomes[active[done]] = ended[done]
        lengths[active] = t + 1
        active, states = active[~done], states[~done]
        if not len(active):
            break
    return Outcomes(returns, lengths, outcomes), steps


def _act(policy: Policy, task: Task, observations: np.ndarray) -> np.ndarray:
    """The policy's actions (n, m) in float64. Raises ValueError unless it fits the task and they are finite."""
    (n, d), m = observations.shape, len(task.action_low)
    try:
        actions = np.asarray(policy.predict(observations)[0])
    except (ValueError, TypeError, IndexError) as error:
        raise ValueError(f"the policy fails on the {d} inputs of {task.name}: {error}") from error
    if actions.shape != (n, m):
        raise ValueError(f"the policy's actions have shape {actions.shape}, expected {(n, m)} for {task.name}")
    return check_finite("the policy's actions", actions)
