"""DAgger (Ross et al. 2011): fit, visit states, let the teacher label them, fit again."""

from collections.abc import Callable, Sequence

import numpy as np

from vsp import Policy, Task
from vsp.rollouts import rollout, visited_states
from vsp_beyond import Tuned
from vsp_beyond.few_cells.tune import score

Fit = Callable[[np.ndarray, np.ndarray], Policy]  # a policy from states (n, d) and actions (n, m)


def dagger(fits: Sequence[Fit], teacher: Policy, task: Task, *, rounds: Tuned, seed: int) -> Policy:
    """Return the best of the policies fitted to the teacher's states, then also to states that fitted policies visit.

    `rounds` sets episodes, corrections and validation. All `fits` are tried in the first round, which helps if they
    differ in their random numbers; only the one with the best first policy is corrected.
    """
    rng, validation_rng = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(2))
    validation = task.start(validation_rng, rounds.n_validation)
    policy, states = teacher, np.zeros((0, len(task.low)))
    tried: list[tuple[float, Policy]] = []
    for i in range(1 + rounds.n_corrections):
        n = rounds.n_correction_episodes if i else rounds.n_episodes
        states = np.concatenate([states, visited_states(policy, task, task.start(rng, n))])
        actions = np.asarray(teacher.predict(states)[0], dtype=np.float64)
        candidates = [(fit, fit(states, actions)) for fit in fits]
        scores = [score(rollout(policy, task, validation), rounds.failure_penalty) for _, policy in candidates]
        fit, policy = candidates[int(np.argmax(scores))]
        fits = [fit]
        tried.append((max(scores), policy))
    return max(tried, key=lambda pair: pair[0])[1]
