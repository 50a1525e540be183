"""DAgger (Ross et al. 2011): fit, visit states, let the teacher label them, fit again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from vsp.checks import check_seed
from vsp.rollouts import Policy, rollout, score, visited_states
from vsp.tasks.registry import get_task


@runtime_checkable
class Rounds(Protocol):
    """The settings that `dagger` reads; a `Tuned` has them."""

    n_episodes: int  # episodes of the teacher for the first fit
    n_corrections: int  # rounds of correction
    n_correction_episodes: int  # episodes of the fitted policy per round
    n_validation: int  # episodes that decide between fits
    failure_penalty: float  # subtracted from the mean return per failed episode when fits are compared


Fit = Callable[[np.ndarray, np.ndarray], Policy]  # a policy from states (n, d) and actions (n, m)


def dagger(fits: Sequence[Fit], teacher: Policy, task: str, *, rounds: Rounds, seed: int) -> Policy:
    """Return the best of the policies fitted to the teacher's states, then also to states that fitted policies visit.

    `rounds` sets episodes, corrections and validation. All `fits` are tried in the first round, which helps if they
    differ in their random numbers; only the one with the best first policy is corrected. Raises ValueError for a bad
    seed or bad `rounds`.
    """
    check_seed(seed)
    if not isinstance(rounds, Rounds):
        raise ValueError(f"rounds is {rounds!r}, expected the fields of Rounds, such as a Tuned has")
    task, streams = get_task(task), np.random.SeedSequence(seed).spawn(2)
    rng, validation_rng = (np.random.default_rng(stream) for stream in streams)
    validation = task.start(validation_rng, rounds.n_validation)
    policy, states, best = teacher, np.zeros((0, len(task.low))), (-np.inf, None)
    for i in range(1 + rounds.n_corrections):
        n = rounds.n_correction_episodes if i else rounds.n_episodes
        states = np.concatenate([states, visited_states(policy, task, task.start(rng, n))])
        actions = np.asarray(teacher.predict(states)[0], dtype=np.float64)
        candidates = [(fit, fit(states, actions)) for fit in fits]
        scores = [score(rollout(policy, task, validation), rounds.failure_penalty) for _, policy in candidates]
        fit, policy = candidates[int(np.argmax(scores))]
        fits, best = [fit], max(best, (max(scores), policy), key=lambda pair: pair[0])
    return best[1]
