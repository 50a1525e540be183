"""Checks of lesson 3: which cell is to blame, exact maps in fixed cells, a round of DAgger.

Each check calls a student's function on small random cases, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from vsp import Policy, Task, VoronoiPolicy, get_task, load_teacher, teacher_episodes
from vsp.paper import baselines
from vsp.rollouts import collect_episodes, rollout, visited_states
from vsp.tasks import GOAL, PIT

from .feedback import Exercise, Mistake

TASK = "SimpleGoal-v0"

BLAME = Exercise("3.4", "blame", ("last_states", "failures"))
REFIT = Exercise("3.5", "refit", ("refit",), cures=((np.linalg.LinAlgError, "", 3),))
DAGGER = Exercise("3.6", "dagger_round", cures=((ValueError, "inhomogeneous", 2),))


def _random_policy(rng: np.random.Generator, k: int = 5) -> VoronoiPolicy:
    """A policy that mostly walks towards the goal, and often into the pit."""
    maps = np.concatenate([rng.normal(scale=0.3, size=(k, 2, 2)), rng.uniform(-1, -0.2, size=(k, 1, 2))], axis=1)
    return VoronoiPolicy(rng.uniform(0.1, 0.9, size=(k, 2)), maps, task=TASK)


class _Sometimes:
    """A teacher that stands still in the right third of the square, and so misses the goal from there."""

    def __init__(self, teacher: Policy):
        self.teacher = teacher

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        actions, _ = self.teacher.predict(obs)
        return np.where(np.asarray(obs)[..., :1] > 0.66, 0.0, actions), None


def failures(policy: Policy, teacher: Policy, task: Task, starts: np.ndarray) -> np.ndarray:
    """Return from which starts (n, d) the teacher reaches the goal and the policy does not. (n,) bool"""
    ours, theirs = (rollout(actor, task, starts).outcomes for actor in (policy, teacher))
    return (ours != GOAL) & (theirs == GOAL)


def last_states(
    policy: VoronoiPolicy, teacher: Policy, task: Task, starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the last states (f, d) of the policy's failures from `starts` (n, d), and their number in each cell (k,).
    There must be failures."""
    failed = starts[failures(policy, teacher, task, starts)]
    states = np.array([episode.states[-1] for episode in collect_episodes(policy, task, failed)])
    return states, np.bincount(policy.cells(states), minlength=len(policy))


@BLAME.checks
def blame(function: Callable) -> None:
    """3.4: `blame(policy, teacher, task, starts)` counts, per cell, the failures whose last action it chose. (k,)"""
    task, shipped = get_task(TASK), load_teacher(TASK)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        teacher, policy = _Sometimes(shipped) if seed % 2 else shipped, _random_policy(rng)
        starts, k = task.start(rng, 150), len(policy)
        answer = BLAME.call(function, policy, teacher, task, starts)
        value = BLAME.array(answer, (k,), hint=1, meaning="a count per cell")
        ours, failed = rollout(policy, task, starts).outcomes, failures(policy, teacher, task, starts)
        ways = [policy.cells(episode.states) for episode in collect_episodes(policy, task, starts)]
        last, of_failures = np.array([way[-1] for way in ways]), [way for way, f in zip(ways, failed) if f]
        count = functools.partial(np.bincount, minlength=k)
        right, too_many = count(last[failed]), "only those of starts from which the teacher reaches the goal"
        number = "as many failures, but in other cells" if value.sum() == right.sum() else f"{value.sum():g} failures"
        in_pit, pit_only = failed & (ours == PIT), "only the episodes that end in the pit"
        start = count(policy.cells(starts)[failed])
        mistakes = [
            Mistake(count(last[ours != GOAL]), "failures counted where the teacher fails too", too_many, 2),
            Mistake(start, "failures counted in the cell of their start", "in the last one", 3),
            Mistake(count(last[in_pit]), pit_only, "also those that run out of steps", 2),
            Mistake(count(np.concatenate(of_failures)), "every step of a failure", "its last", 3),
            Mistake(right / max(1, failed.sum()), "shares", "counts", 1),
            Mistake(None, number, f"{failed.sum()}, each in the cell of the policy's last state", 3),
        ]
        BLAME.compare(value, right, mistakes)
    BLAME.passed("every failure is attributed to the cell that chose the last action.")


@REFIT.checks
def refit(function: Callable) -> None:
    """3.5: `refit(policy, states, actions)` returns the same cells with maps by least squares."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        policy = _random_policy(rng, 6)
        states = rng.uniform(size=(300, 2))
        actions = np.clip(np.sin(5 * states) - states[:, ::-1], -1, 1)
        cells = policy.cells(states)
        _refits(function, policy, states, actions)
        for n in (300, 1, 2):  # states in cell 3, at most; none in cell 2
            kept = (cells != 2) & ((cells != 3) | (np.cumsum(cells == 3) <= n))
            _refits(function, policy, states[kept], actions[kept])
    REFIT.passed("in these cells no maps are nearer to the teacher.")


def _refits(function: Callable, policy: VoronoiPolicy, states: np.ndarray, actions: np.ndarray) -> None:
    """Check a case in which cell 2 may have no states, and cell 3 fewer than parameters."""
    before, cells = policy.coefficients.copy(), policy.cells(states)
    new = REFIT.call(function, policy, states, actions, keep=True)
    REFIT.refuse_if(not isinstance(new, VoronoiPolicy), f"a {type(new).__name__}", "a vsp.VoronoiPolicy", 1)
    altered = not np.array_equal(policy.coefficients, before)
    REFIT.refuse_if(altered, "the old policy altered", "a new one: work on a copy of its coefficients", 1)
    REFIT.refuse_if(not np.array_equal(new.codewords, policy.codewords), "other codewords", "the same cells", 1)
    empty = np.setdiff1d(np.arange(len(policy)), cells)
    kept = np.allclose(new.coefficients[empty], before[empty])
    REFIT.refuse_if(not kept, "another map in a cell without states", "the one it had: nothing is known there", 3)
    best, few = baselines.refit(policy, states, actions), cells == 3
    missed = few.sum() < 3 and not np.allclose(new.linear(states[few]), actions[few], atol=1e-4)
    whole = baselines.linear_map(states, actions, TASK)
    if np.allclose(new.coefficients[0], whole.coefficients[0]):
        raise REFIT.wrong("the same map in every cell", "one per cell, from the states in it", 2)
    where = "where a cell has fewer states than parameters"
    REFIT.refuse_if(missed, f"a map that misses the actions {where}", "one that meets them", 3)
    error, least = (np.square(p.linear(states) - actions).mean() for p in (new, best))
    REFIT.refuse_if(error > 1.0001 * least, f"a squared error of {error:.3g}", f"the least there is, {least:.3g}", 2)


@DAGGER.checks
def dagger_round(function: Callable) -> None:
    """3.6: `dagger_round(policy, teacher, task, starts, states, actions)` returns more states and their actions."""
    task, teacher = get_task(TASK), load_teacher(TASK)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        policy, starts = _random_policy(rng), task.start(rng, 20)
        before = next(teacher_episodes(teacher, task, 1, rng))
        value = DAGGER.call(function, policy, teacher, task, starts, before.states, before.actions)
        if not isinstance(value, tuple | list) or len(value) != 2:
            raise DAGGER.wrong(f"a {type(value).__name__}", "two arrays, states and actions", 1)
        ours, theirs = (visited_states(p, task, starts) for p in (policy, teacher))
        states = _gathered(value[0], before.states, ours, theirs, len(starts))
        actions = DAGGER.array(value[1], states.shape, "actions", 2, "one for each state")
        labels, copies = (p.predict(states)[0] for p in (teacher, policy))
        right, copied = (np.isclose(actions, a, atol=1e-4).all(axis=1).mean() for a in (labels, copies))
        order = right < 1 and np.allclose(_sorted(actions), _sorted(labels), atol=1e-4)
        DAGGER.refuse_if(order, "states and actions in different orders", "the same order for both", 3)
        other = f"other actions in {round((1 - right) * len(states))} of {len(states)} states"
        other = "the policy's own actions" if copied > 0.5 else other
        DAGGER.refuse_if(right < 1, other, "the teacher's action for every state", 2)
    DAGGER.passed("the policy's states, the teacher's actions, and the old data kept.")


def _gathered(value: object, old: np.ndarray, ours: np.ndarray, theirs: np.ndarray, n_episodes: int) -> np.ndarray:
    """Return the states in `value`, which must be the `old` ones and `ours`, those on the policy's way; `theirs` are on
    the teacher's."""
    n, driver = len(old), ("the states that the teacher goes through", "those that the policy goes through", 1)
    sizes = {
        len(ours): ("the old states gone", "them kept, with the new ones behind or before them", 3),
        len(theirs): driver,
        n + len(theirs): driver,
        n: ("no new states", "those that the policy goes through", 1),
        n + n_episodes: ("one new state per episode", "every state on the way", 1),
    }
    if len(value) != n + len(ours) and len(value) in sizes:
        raise DAGGER.wrong(*sizes[len(value)])
    states = DAGGER.array(value, (n + len(ours), 2), "states", 1, "old and new states, a row each")
    other = not np.allclose(_sorted(states), _sorted(np.concatenate([old, ours])), atol=1e-6)
    DAGGER.refuse_if(other, "other states", "the old ones and those that the policy goes through", 1)
    return states


def corrected(
    policy: VoronoiPolicy, teacher: Policy, task: Task, starts: np.ndarray, states: np.ndarray, actions: np.ndarray
) -> VoronoiPolicy:
    """The policy after a round of DAgger from `starts` (n, d), its maps fitted again to the enlarged data."""
    more = visited_states(policy, task, starts)
    labels = np.concatenate([actions, teacher.predict(more)[0]])
    return baselines.refit(policy, np.concatenate([states, more]), labels)


def _sorted(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(np.round(rows, 5).T)]
