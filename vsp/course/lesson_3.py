"""Checks of lesson 3: what a box plot hides, paired gaps, intervals over policies, blame, exact maps, DAgger.

Each check calls a student's function on small random cases, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from scipy.stats import sem

from .. import baselines
from ..algorithms import distill, teacher_episodes
from ..config import paper_preset
from ..evaluation import start_states
from ..paper.statistics import spread
from ..policy import VoronoiPolicy
from ..rollouts import Episode, Policy, collect_episodes, rollout, visited_states
from ..tasks import GOAL, PIT, Task, get_task
from ..teachers import load_teacher
from .feedback import ActionsAlone, Exercise, Mistake, Question, works

TASK = "SimpleGoal-v0"
FEWER_THAN = 13  # cells of a challenger: the paper's best policy has this many
FRESH = 2_000_003  # seed of the start states that a challenger is judged on
SEEDS = range(8)  # of the lesson's policies
NEAR = 0.1  # largest relative deviation of an interval's width from its large-sample value

READING = Exercise("3.1", "reading")
PAIRED_GAP = Exercise("3.2", "paired_gap", (f"{__name__}.standard_errors",))
INTERVAL = Exercise("3.3", "interval", ("vsp.paper.statistics.interval",))
BLAME = Exercise("3.4", "blame", (f"{__name__}.last_states", f"{__name__}.failures"))
REFIT = Exercise("3.5", "refit", ("vsp.baselines.simple.refit",))
DAGGER = Exercise("3.6", "dagger_round")
CHALLENGE = Exercise("3.7", "challenger", seconds=180)

WHO = ("the teacher", "the policies")
INSIDE = ("a quarter", "half", "three quarters", "nearly all")
WHERE = ("inside the box", "in the lower whisker", "nowhere")
SEES = ("the median", "the height of the box", "the mean")


@READING.checks
def reading(answers: object, ours: np.ndarray, theirs: np.ndarray) -> None:
    """3.1: answers `higher median`, `inside the box`, `pit episodes`, `sees the pit`, about two arrays of returns."""
    facts, own = spread(ours), spread(theirs)
    inside = ((ours >= facts["q1"]) & (ours <= facts["q3"])).mean()
    share = INSIDE[int(np.abs(np.array([0.25, 0.5, 0.75, 1]) - inside).argmin())]
    shares = {"a quarter": "a quarter lies between one edge and the median", "nearly all": "that is box and whiskers"}
    pit = np.median(ours[ours < 0]) if (ours < 0).any() else -10.0
    place = WHERE[int(pit < facts["q1"]) + int(pit < facts["lower_fence"])]
    places = {
        "in the lower whisker": "read off how far down it reaches; what does a fall into the pit return",
        "inside the box": "a fall into the pit costs ten points",
    }
    without = spread(ours[ours >= facts["lower_fence"]])
    change = [abs(without[name] - facts[name]) for name in ("median", "iqr", "mean")]
    questions = {
        "higher median": Question(WHO, WHO[int(facts["median"] > own["median"])], 1),
        "inside the box": Question(INSIDE, share, 1, shares),
        "pit episodes": Question(WHERE, place, 2, places),
        "sees the pit": Question(SEES, SEES[int(np.argmax(change))], 3),
    }
    first = READING.ask(answers, questions)
    READING.passed(f"a plot may hide just what went wrong.{first}")


@PAIRED_GAP.checks
def paired_gap(function: Callable) -> None:
    """3.2: `paired_gap(ours, theirs)` returns the mean gap and its standard error, start by start."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        luck = rng.normal(scale=5, size=400)
        _gap(function, luck + rng.normal(size=400) - 0.4, luck + rng.normal(size=400))
    PAIRED_GAP.passed("shared starts make a small gap visible.")


def _gap(function: Callable, ours: np.ndarray, theirs: np.ndarray) -> None:
    values = PAIRED_GAP.call(function, ours, theirs)
    gap, error = PAIRED_GAP.array(values, (2,), hint=1, meaning="the gap and its standard error")
    right = (ours - theirs).mean()
    mistakes = [
        Mistake(-right, "a gap with the sign turned", "the mean of ours less theirs", 1),
        Mistake(None, f"a gap of {gap:.3g}", "the mean of ours less theirs", 1),
    ]
    PAIRED_GAP.compare(gap, right, mistakes)
    right = (ours - theirs).std(ddof=1) / np.sqrt(len(ours))
    PAIRED_GAP.compare(error, right, _other_errors(error, ours, theirs), rtol=0.05)  # n or n - 1, or a bootstrap


def _other_errors(error: float, ours: np.ndarray, theirs: np.ndarray) -> list[Mistake]:
    n, difference, deviation = len(ours), ours - theirs, (ours - theirs).std()
    unrelated = "the standard error of two samples that have nothing to do with each other"
    shared = "that of the differences: both played from the same starts"
    return [
        Mistake(np.sqrt(ours.var() / n + theirs.var() / n), unrelated, shared, 2),
        Mistake(deviation, "the deviation of single differences", "that of their mean, which is smaller", 3),
        Mistake(difference.var() / n, "a variance", "its root", 3),
        Mistake(abs(ours.std() - theirs.std()) / np.sqrt(n), "a difference of two deviations", shared, 2),
        Mistake(ours.std() / np.sqrt(n), "the deviation of our returns", shared, 2),
        Mistake(1.96 * deviation / np.sqrt(n), "half a 95 % interval", "the standard error itself", 3),
        Mistake(None, f"a standard error of {error:.3g}", "the deviation of the mean of the differences", 3),
    ]


def standard_errors(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """Return two standard errors of the mean gap between returns (n,): paired by start, and as if starts were
    independent."""
    return sem(ours - theirs), np.hypot(sem(ours), sem(theirs))


@INTERVAL.checks
def interval(function: Callable) -> None:
    """3.3: `interval(returns, rng)` returns the ends of a 95 % interval of the mean, by resampling policies."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        luck = 6 * rng.exponential(size=(30, 400))  # skewed, so that mean and median differ
        returns = 4 + rng.normal(scale=2, size=(30, 1)) + luck
        _interval(function, returns, rng)
    INTERVAL.passed("policies are resampled, with all their episodes.")


def _interval(function: Callable, returns: np.ndarray, rng: np.random.Generator) -> None:
    values = INTERVAL.call(function, returns, rng)
    low, high = INTERVAL.array(values, (2,), hint=1, meaning="the ends of the interval")
    means = returns.mean(axis=1)
    width = 2 * 1.96 * means.std() / np.sqrt(len(means))  # the bootstrap interval in large samples
    INTERVAL.refuse_if(low > high, "the upper end first", "the lower end first", 1)
    with_replacement = "draws *with* replacement, which differ from each other"
    INTERVAL.refuse_if(high - low < 1e-6 * width, "an interval of no width", with_replacement, 2)
    found = f"an interval from {low:.2f} to {high:.2f} without the mean {means.mean():.2f}"
    INTERVAL.refuse_if(not low <= means.mean() <= high, found, "one around it", 1)
    unsteady = not np.isclose(high - low, width, rtol=NEAR) and _unsteady(function, returns, width)
    found = "ends that come out differently every time: too few resamples"
    INTERVAL.refuse_if(unsteady, found, "a few thousand", 2)
    middle = "the middle 95 % of the means of resampled policies"
    size = f"an interval that is too {'narrow' if high - low < width else 'wide'}"
    mistakes = [*_other_widths(returns, width), Mistake(None, size, middle, 2)]
    INTERVAL.compare(high - low, width, mistakes, rtol=NEAR)
    again = INTERVAL.call(function, returns[::-1], np.random.default_rng(1))  # other draws, by whatever generator
    found = "the same interval whatever is drawn: no policies are resampled"
    INTERVAL.refuse_if(np.allclose(again, values, rtol=1e-9), found, "the means of policies drawn at random", 2)


def _unsteady(function: Callable, returns: np.ndarray, width: float) -> bool:
    """Whether other draws change the interval too much: with 100 resamples its ends move by 7 % of its width, with
    1000 by 2 %.

    Rows are reversed, so that draws differ even if the student's generator is seeded in each call.
    """
    rngs = [np.random.default_rng(seed) for seed in range(10)]
    ends = np.array([INTERVAL.call(function, rng.permutation(returns), rng) for rng in rngs], dtype=np.float64)
    mean_width = np.ptp(ends, axis=1).mean()
    return bool(np.isclose(mean_width, width, rtol=NEAR) or ends.std(axis=0).max() > 0.05 * mean_width)


def _other_widths(returns: np.ndarray, width: float) -> list[Mistake]:
    means = returns.mean(axis=1)
    single = 2 * 1.96 * returns.std() / np.sqrt(returns.size)
    alone = "an interval as narrow as if every episode were a witness of its own"
    return [
        Mistake(single, alone, "one as wide as the policies differ", 3),
        Mistake(np.ptp(np.percentile(means, [2.5, 97.5])), "the range of single policies", "the range of *means*", 2),
        Mistake(1.645 / 1.96 * width, "an interval for 90 %", "one for 95 %: a tail of 2.5 % on either side", 1),
        Mistake(width / 1.96, "one standard error to either side", "the middle 95 % of the resampled means", 1),
        Mistake(np.sqrt(len(means)) * width, "resamples of one policy", "as many draws as there are policies", 2),
    ]


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
    DAGGER.passed("the policy went there, the teacher said what is right there, and nothing was forgotten.")


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


@functools.cache
def _best_policy() -> float:
    """The highest mean return of the lesson's policies, from fresh starts."""
    task, teacher = get_task(TASK), load_teacher(TASK)
    policies = [distill(teacher, task, paper_preset(TASK), seed=seed)[0] for seed in SEEDS]
    return max(rollout(policy, task, start_states(task, 2000, FRESH)).returns.mean() for policy in policies)


@CHALLENGE.checks
def challenger(policy: VoronoiPolicy) -> None:
    """3.7: fewer than `FEWER_THAN` cells and a higher mean return than the best of the lesson's policies, from fresh
    starts. The policy is rebuilt from its numbers, so that no method of the student's class is called."""
    if policy is None:
        raise CHALLENGE.unsolved()
    if isinstance(policy, type):
        raise CHALLENGE.wrong(f"the class {policy.__name__} itself", "a policy that was made with it", 1)
    two = isinstance(policy, tuple) and any(isinstance(part, VoronoiPolicy) for part in policy)
    alone = "the policy alone: `vsp.distill` returns two values"
    CHALLENGE.refuse_if(two, "a policy and something else", alone, 1)
    CHALLENGE.refuse_if(not isinstance(policy, VoronoiPolicy), f"a {type(policy).__name__}", "a vsp.VoronoiPolicy", 1)
    CHALLENGE.refuse_if(policy.task.name != TASK, f"a policy for {policy.task.name}", f"one for {TASK}", 1)
    form = {"metric": policy.metric, "scale": policy.scale, "sub_policy": policy.policy_class.name}
    made = VoronoiPolicy(policy.codewords, policy.coefficients, task=TASK, **form)
    CHALLENGE.refuse_if(len(made) >= FEWER_THAN, f"{len(made)} cells", f"fewer than {FEWER_THAN}", 1)
    task = get_task(TASK)
    starts = start_states(task, 2000, FRESH)
    own, teacher = (rollout(p, task, starts) for p in (made, load_teacher(TASK)))
    best, mean = _best_policy(), own.returns.mean()
    failing = f"{(own.outcomes != GOAL).mean():.1%} of the episodes fail"
    found = f"codewords and coefficients that return {mean:.3f} from fresh starts ({failing})"
    CHALLENGE.refuse_if(mean <= best, found, f"more than the best policy's {best:.3f}", 2)
    others = f"the best of the eight {best:.2f}, the teacher {teacher.returns.mean():.2f}"
    CHALLENGE.passed(f"{len(made)} cells return {mean:.2f}, {others}; {failing}.")
