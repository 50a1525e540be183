"""Evaluate policies from start states that are the same for all, and compare a policy with the agent it imitates."""

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from .checks import check_count, check_seed
from .rollouts import Outcomes, Policy, record, rollout
from .run import progress
from .tasks import GOAL, OUTCOMES, Task, get_task

if TYPE_CHECKING:
    import pandas as pd

CLOSE = 0.05  # of its range, up to which an action is close to the agent's
ALIKE = 0.9  # R² from which a policy acts much like its agent
FAILING = 0.02  # share of the episodes in which it may fail more often without a warning
LOST = 0.05  # share of the return that it may lose without one where failures are not defined


@dataclass(frozen=True)
class Likeness:
    """How much a policy acts like the agent that it imitates, and what both return."""

    r2: float  # share of the variance of the agent's actions that the policy reproduces, on the agent's own states
    states: np.ndarray  # (t, d) these states
    errors: np.ndarray  # (t, m) how far each action is from the agent's there, in ranges of the action
    returns: dict[str, np.ndarray]  # by "policy" and "agent", (n,) from the same starts
    failures: dict[str, int | None]  # episodes that do not reach the goal; None where nobody reaches one

    @property
    def within(self) -> np.ndarray:
        """Share of the states in which each action is within 5 % of its range of the agent's. (m,)"""
        return (self.errors <= CLOSE).mean(axis=0)

    @property
    def poor(self) -> bool:
        """Whether the actions differ much, or the policy fails more often; or, where failures are not defined, returns
        less by more than `LOST` and a standard error."""
        more = (self.failures["policy"] or 0) - (self.failures["agent"] or 0)
        gap = self.returns["policy"] - self.returns["agent"]
        allowed = max(gap.std() / len(gap) ** 0.5, LOST * abs(self.returns["agent"].mean()))
        lost = self.failures["policy"] is None and gap.mean() < -allowed
        return self.r2 < ALIKE or more > FAILING * len(gap) or bool(lost)

    def __str__(self) -> str:
        ours, theirs = (self.returns[name].mean() for name in ("policy", "agent"))
        failed, n = self.failures, len(self.returns["policy"])
        close = ", ".join(f"{share:.0%}" for share in self.within)
        text = f"R² {self.r2:.3f} on {len(self.states):,} new states, each action within {CLOSE:.0%} of its range in "
        text += f"{close} of them, return {ours:.5g} (agent: {theirs:.5g})"
        ended = (
            "" if failed["policy"] is None else f", {failed['policy']} of {n} episodes fail (agent: {failed['agent']})"
        )
        return "warning: " * self.poor + text + ended


def start_states(task: str | Task, n_episodes: int, seed: int) -> np.ndarray:
    """Return the start states of `seed`, the same for every policy. (n, s)"""
    check_seed(seed)
    check_count("n_episodes", n_episodes)
    return get_task(task).start(np.random.default_rng(np.random.SeedSequence(seed)), n_episodes)


def rollout_from_seed(policy: Policy, task: str | Task, n_episodes: int = 1000, *, seed: int) -> Outcomes:
    """Run `policy` from the start states of `seed`. Returns arrays with one entry per episode."""
    task = get_task(task)
    return rollout(policy, task, start_states(task, n_episodes, seed))


def evaluate(policy: Policy, task: str | Task, n_episodes: int = 1000, *, seed: int) -> "pd.DataFrame":
    """Run `policy` from the start states of `seed`. Returns a row per episode with return, length and outcome."""
    import pandas as pd  # here, because it takes long to import

    result = rollout_from_seed(policy, task, n_episodes, seed=seed)
    named = np.array(OUTCOMES)[result.outcomes]
    return pd.DataFrame({"return": result.returns, "length": result.lengths, "outcome": named}).rename_axis("episode")


def likeness(policy: Policy, agent: Policy, task: str | Task, n: int = 1000, *, seed: int = 7) -> Likeness:
    """Compare `policy` with `agent` over n episodes from the starts of `seed`, fewer where an engine is slow. Raises
    ValueError unless both fit the task."""
    task = get_task(task)
    starts = start_states(task, max(10, n // task.slowness), seed)
    played, episodes = record(agent, task, starts)
    states, half = episodes.states, (task.action_high - task.action_low) / 2
    theirs, ours = episodes.actions / half, np.asarray(policy.predict(states)[0]) / half
    both = {"policy": rollout(policy, task, starts), "agent": played}
    failures = {name: int((one.outcomes != GOAL).sum()) for name, one in both.items()}
    nobody = all(count == len(starts) for count in failures.values())  # as in a task that has no goal
    ended: dict[str, int | None] = dict.fromkeys(both) if nobody else {**failures}
    returns = {name: one.returns for name, one in both.items()}
    return Likeness(r_squared(ours, theirs), states, np.abs(ours - theirs) / 2, returns, ended)


def r_squared(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the share of the variance of `theirs` (t, m) that `ours` reproduce."""
    spread = np.square(theirs - theirs.mean(axis=0)).sum()
    return float(1 - np.square(ours - theirs).sum() / spread if spread else np.allclose(ours, theirs))


@threadpool_limits.wrap(limits=1)  # the same text on any machine, as the distillation before it
def remark(policy: Policy, agent: Policy, task: Task, n: int, advice: str) -> None:
    """Print on standard error how alike they are in n / 40 episodes, at most 100, and `advice`, unless all is silent. n
    is the number of episodes that the distillation played, so that this takes a small share of its time."""
    if progress.is_shown():
        alike = likeness(policy, agent, task, min(100, n // 40))
        print(f"{alike}; closer: {advice}", file=sys.stderr)


def fences(q1: Any, q3: Any) -> tuple[Any, Any]:
    """Return the bounds beyond which a box plot marks outliers: 1.5 interquartile ranges from the quartiles.

    Quartiles are numbers or arrays."""
    return q1 - 1.5 * (q3 - q1), q3 + 1.5 * (q3 - q1)
