"""Checks of lesson 3: which cell is to blame, exact maps in fixed cells, a round of DAgger.

Each check calls a student's function on small random cases, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vsp.algorithms import teacher_episodes
from vsp.paper import baselines
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Episode, Policy, collect_episodes, rollout, visited_states
from vsp.tasks import GOAL, PIT, Task, get_task
from vsp.teachers import load_teacher

from .feedback import ActionsAlone, Exercise, Mistake, works

TASK = "SimpleGoal-v0"

BLAME = Exercise("3.4", "blame", (f"{__name__}.last_states", f"{__name__}.failures"))
REFIT = Exercise("3.5", "refit", ("vsp.paper.baselines.refit",))
DAGGER = Exercise("3.6", "dagger_round")


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
        teacher = _Sometimes(shipped) if seed % 2 else shipped
        _blames(function, _random_policy(rng), teacher, task, task.start(rng, 150))
    BLAME.passed("every failure is attributed to the cell that chose the last action.")


def _blames(function: Callable, policy: VoronoiPolicy, teacher: Policy, task: Task, starts: np.ndarray) -> None:
    k = len(policy)
    value = BLAME.array(BLAME.call(function, policy, teacher, task, starts), (k,), hint=1, meaning="a count per cell")
    ours, failed = rollout(policy, task, starts).outcomes, failures(policy, teacher, task, starts)
    ways = [policy.cells(episode.states) for episode in collect_episodes(policy, task, starts)]

    def count(cells: np.ndarray) -> np.ndarray:
        return np.bincount(cells.astype(int), minlength=k)

    first, last = policy.cells(starts), np.array([way[-1] for way in ways])
    right, too_many = count(last[failed]), "only those of starts from which the teacher reaches the goal"
    every_step = np.concatenate([np.zeros(0), *(way for way, f in zip(ways, failed) if f)])
    number = "as many failures, but in other cells" if value.sum() == right.sum() else f"{value.sum():g} failures"
    in_pit, pit_only = failed & (ours == PIT), "only the episodes that end in the pit"
    mistakes = [
        Mistake(count(last[ours != GOAL]), "failures counted where the teacher fails too", too_many, 2),
        Mistake(count(first[failed]), "failures counted in the cell of their start", "in the last one", 3),
        Mistake(count(last[in_pit]), pit_only, "also those that run out of steps", 2),
        Mistake(count(last[ours == GOAL]), "successes", "failures", 1),
        Mistake(count(every_step), "every step of a failure", "its last", 3),
        Mistake(count(last), "all episodes", "those that fail", 1),
        Mistake(right / max(1, failed.sum()), "shares", "counts", 1),
        Mistake(None, number, f"{failed.sum()}, each in the cell of the policy's last state", 3),
    ]
    BLAME.compare(value, right, mistakes)


@REFIT.checks
def refit(function: Callable) -> None:
    """3.5: `refit(policy, states, actions)` returns the same cells with maps by least squares."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        policy = _random_policy(rng, 6)
        states = rng.uniform(size=(300, 2))
        actions = np.clip(np.sin(5 * states) - states[:, ::-1], -1, 1)
        REFIT.call(function, policy, states, actions)  # an error here is not caused by a cell with few states
        cells = policy.cells(states)
        known, few = cells != 2, "where a cell has fewer states than parameters"
        _refits(function, policy, states[known], actions[known], "where no state is in a cell")
        for n in (1, 2):
            kept = known & ((cells != 3) | (np.cumsum(cells == 3) <= n))
            _refits(function, policy, states[kept], actions[kept], few)
    REFIT.passed("in these cells no maps are nearer to the teacher.")


def _refits(function: Callable, policy: VoronoiPolicy, states: np.ndarray, actions: np.ndarray, where: str) -> None:
    """Check a case with no state in cell 2 and perhaps few in cell 3, as `where` tells."""
    before = policy.coefficients.copy()
    try:
        new = function(policy, states.copy(), actions.copy())
    except Exception as error:
        found = f"{type(error).__name__} ({error})"
        raise REFIT.wrong(found, f"a result, also {where}", 3) from None
    REFIT.refuse_if(not isinstance(new, VoronoiPolicy), f"a {type(new).__name__}", "a vsp.VoronoiPolicy", 1)
    altered = not np.array_equal(policy.coefficients, before)
    REFIT.refuse_if(altered, "the old policy altered", "a new one: work on a copy of its coefficients", 1)
    REFIT.refuse_if(not np.array_equal(new.codewords, policy.codewords), "other codewords", "the same cells", 1)
    kept = np.allclose(new.coefficients[2], before[2])
    REFIT.refuse_if(not kept, "another map in a cell without states", "the one it had: nothing is known there", 3)
    whole = np.linalg.lstsq(np.column_stack([states, np.ones(len(states))]), actions, rcond=None)[0]
    one = np.allclose(new.coefficients[0], whole)
    REFIT.refuse_if(one, "the same map in every cell", "one per cell, from the states in it", 2)
    constants = np.allclose(np.delete(new.coefficients, 2, axis=0)[:, :2], 0)
    REFIT.refuse_if(constants, "constants", "weights and bias by least squares", 2)
    best, few = baselines.refit(policy, states, actions), policy.cells(states) == 3
    missed = few.sum() < 3 and not np.allclose(new.linear(states[few]), actions[few], atol=0.1)
    REFIT.refuse_if(missed, f"a map that misses the actions {where}", "one that meets them", 3)
    found, least = (np.square(p.linear(states) - actions).mean() for p in (new, best))
    REFIT.refuse_if(found > 1.01 * least, f"a squared error of {found:.3g}", f"the least there is, {least:.3g}", 2)


@DAGGER.checks
def dagger_round(function: Callable) -> None:
    """3.6: `dagger_round(policy, teacher, task, starts, states, actions)` returns more states and their actions."""
    task, teacher = get_task(TASK), load_teacher(TASK)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        policy, starts = _random_policy(rng), task.start(rng, 20)
        before = next(teacher_episodes(teacher, task, 1, rng))
        case = policy, teacher, task, starts, before
        pair = not works(_labels, function, *case) and works(_labels, function, *case, ActionsAlone(teacher))
        found = "the pair that `predict` returns, used as the actions"
        DAGGER.refuse_if(pair, found, "its first part, `predict(states)[0]`", 2)
        _labels(function, *case)
    DAGGER.passed("the policy's states, the teacher's actions, and the old data kept.")


def _labels(
    function: Callable, policy: VoronoiPolicy, teacher: Policy, task: Task, starts: np.ndarray, before: Episode,
    asked: Policy | None = None,
) -> None:  # fmt: skip
    """Check the labels. `asked` is the teacher that the student's function gets, if it is another one."""
    value = DAGGER.call(function, policy, asked or teacher, task, starts, before.states, before.actions)
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise DAGGER.wrong(f"a {type(value).__name__}", "two arrays, states and actions", 1)
    states, actions = (np.asarray(part, dtype=np.float64) for part in value)
    _gathered(states, before.states, *(visited_states(p, task, starts) for p in (policy, teacher)), len(starts))
    if actions.shape != states.shape:
        raise DAGGER.wrong(f"actions of shape {actions.shape}", f"one for each state, {states.shape}", 2)
    labels, own = (p.predict(states)[0] for p in (teacher, policy))
    right, copied = (np.isclose(actions, a, atol=1e-4).all(axis=1).mean() for a in (labels, own))
    if right < 1 and np.allclose(_sorted(actions), _sorted(labels), atol=1e-4):
        raise DAGGER.wrong("states and actions in different orders", "the same order for both", 3)
    if right < 1:
        number = round((1 - right) * len(states))
        found = "the policy's own actions" if copied > 0.5 else f"other actions in {number} of {len(states)} states"
        raise DAGGER.wrong(found, "the teacher's action for every state", 2)


def _gathered(states: np.ndarray, old: np.ndarray, ours: np.ndarray, theirs: np.ndarray, n_episodes: int) -> None:
    """Whether `states` are the `old` ones and `ours`, those on the policy's way; `theirs` are on the teacher's."""
    n, driver = len(old), ("the states that the teacher goes through", "those that the policy goes through", 1)
    sizes = {
        len(ours): ("the old states gone", "them kept, with the new ones behind or before them", 3),
        len(theirs): driver,
        n + len(theirs): driver,
        n: ("no new states", "those that the policy goes through", 1),
        n + n_episodes: ("one new state per episode", "every state on the way", 1),
    }
    if states.shape != (n + len(ours), 2):
        otherwise = f"states of shape {states.shape}", "old and new states, a row each", 1
        raise DAGGER.wrong(*sizes.get(len(states), otherwise))
    if not np.allclose(_sorted(states), _sorted(np.concatenate([old, ours])), atol=1e-6):
        raise DAGGER.wrong("other states", "the old ones and those that the policy goes through", 1)


def corrected(
    policy: VoronoiPolicy, teacher: Policy, task: Task, starts: np.ndarray, states: np.ndarray, actions: np.ndarray
) -> VoronoiPolicy:
    """The policy after a round of DAgger from `starts` (n, d), its maps fitted again to the enlarged data."""
    more = visited_states(policy, task, starts)
    labels = np.concatenate([actions, teacher.predict(more)[0]])
    return baselines.refit(policy, np.concatenate([states, more]), labels)


def _sorted(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(np.round(rows, 5).T)]
