"""How much a policy acts like the agent that it imitates, and what both return."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsp import agent as as_agent
from vsp.evaluation import rollout_from_seed, start_states
from vsp.rollouts import Policy, collect_episodes
from vsp.tasks import GOAL, Task, get_task

N_EPISODES, SEED = 1000, 7  # episodes of each, fewer where an engine is slow; starts that no fit saw


@dataclass(frozen=True)
class Likeness:
    """How much a policy acts like an agent, and what both return."""

    r2: float  # share of the variance of the agent's actions that the policy reproduces, on the agent's own states
    states: np.ndarray  # (t, d) these states
    errors: np.ndarray  # (t,) distance of the actions there, in half ranges
    returns: dict[str, np.ndarray]  # by "policy" and "agent", (n,) from the same starts
    failures: dict[str, int | None]  # episodes that do not reach the goal; None where nobody reaches one


def likeness(policy: Policy, agent: Policy, task: str | Task, n: int = N_EPISODES, *, seed: int = SEED) -> Likeness:
    """Compare `policy` with `agent` over n episodes from the starts of `seed`, fewer where an engine is slow.

    Raises ValueError unless both fit the task.
    """
    agent, task = as_agent(agent), get_task(task)
    n = max(10, n // task.slowness)
    states = np.concatenate([one.states for one in collect_episodes(agent, task, start_states(task, n, seed))])
    half = (task.action_high - task.action_low) / 2
    theirs, ours = (np.asarray(one.predict(states)[0]) / half for one in (agent, policy))
    played = {name: rollout_from_seed(one, task, n, seed=seed) for name, one in (("policy", policy), ("agent", agent))}
    ended = {name: int((one.outcomes != GOAL).sum()) for name, one in played.items()}
    spread = np.square(theirs - theirs.mean(axis=0)).sum()
    r2 = 1 - np.square(ours - theirs).sum() / spread if spread else float(np.array_equal(ours, theirs))
    errors = np.linalg.norm(ours - theirs, axis=1)
    nobody = all(count == n for count in ended.values())  # as in a task that has no goal
    failures = dict.fromkeys(played) if nobody else ended
    return Likeness(float(r2), states, errors, {name: one.returns for name, one in played.items()}, failures)
