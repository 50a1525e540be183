"""Imitate also on states that follow a mistake: from the teacher's episodes, from episodes in which it is pushed,
and from the policy's own."""

from collections.abc import Callable
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from vsp import Policy, Task, VoronoiPolicy, get_task
from vsp.rollouts import rollout, visited_states
from vsp_beyond.few_cells.search import N_STAGES, descend, least_error
from vsp_beyond.few_cells.units import LabelledStates, Scaling

from .settings import Walking

COOL = range(N_STAGES // 2, N_STAGES)  # stages of a fit from the cells of the last round
N_FINALISTS, LONGER = 4, 5  # the best N_FINALISTS policies play LONGER times as many episodes

# Makes a policy from labelled states; after the first round, it begins from the policy of the round before
Fit = Callable[[Scaling, LabelledStates, Policy | None, np.random.Generator], Policy]


class Pushed:
    """A teacher whose actions are disturbed by noise: `push` is its standard deviation, in half action ranges."""

    def __init__(self, teacher: Policy, task: Task, push: float, rng: np.random.Generator):
        self._teacher, self._task, self._rng = teacher, task, rng
        self._deviation = push * 0.5 * (task.action_high - task.action_low)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d)."""
        actions = np.asarray(self._teacher.predict(obs)[0], dtype=np.float64)
        noisy = actions + self._deviation * self._rng.normal(size=actions.shape)
        return np.clip(noisy, self._task.action_low, self._task.action_high), None


@threadpool_limits.wrap(limits=1)
def imitate_pushed(teacher: Policy, task: str | Task, config: Walking, *, seed: int, fit: Fit | None = None) -> Policy:
    """Fit a policy in each round, and return the most rewarding one. Same arguments, same policy. `fit`: by default the
    closest `config.n_cells` cells. Raises ValueError as `rollout` does, and for a bad seed."""
    task, fit = get_task(task), fit or partial(cells_fit, config=config)
    starts, pushes, fits, validation = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(4))
    own = visited_states(teacher, task, task.start(starts, config.n_episodes))
    pushed = visited_states(Pushed(teacher, task, config.push, pushes), task, task.start(starts, 2 * config.n_episodes))
    frame = Scaling.of(task, own)
    both = np.concatenate([own, pushed])
    seen, tried = frame.labelled(both, teacher.predict(both)[0]), []
    for i in range(1 + config.n_corrections):
        if i:
            visited = visited_states(tried[-1], task, task.start(starts, config.n_correction_episodes))
            seen = seen.with_more(frame.labelled(visited, teacher.predict(visited)[0]))
        some = seen.thinned(config.n_states, fits)
        tried.append(fit(frame, some, tried[-1] if tried else None, fits))
    return most_rewarding(tried, task, config.n_validation, validation)


def cells_fit(
    frame: Scaling, seen: LabelledStates, before: Policy | None, rng: np.random.Generator, *, config: Walking
) -> Policy:
    """Return the cells with the least error; in later rounds, descend from the cells of the round before."""
    if isinstance(before, VoronoiPolicy):
        cells = descend(seen, frame.cells(before), COOL)
    else:
        cells = least_error(seen, config.n_cells, config.n_restarts, rng)
    return frame.policy(cells.by_visits(seen.states))


def most_rewarding(policies: list[Policy], task: Task, n_episodes: int, rng: np.random.Generator) -> Policy:
    """Return the policy with the highest mean return. All play `n_episodes` episodes; the best then play more, and
    these decide."""
    few, many = (task.start(rng, n) for n in (n_episodes, LONGER * n_episodes))
    finalists = sorted(policies, key=lambda policy: -rollout(policy, task, few).returns.mean())[:N_FINALISTS]
    return max(finalists, key=lambda policy: rollout(policy, task, many).returns.mean())
