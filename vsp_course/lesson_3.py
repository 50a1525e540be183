"""Checks of lesson 3: what a box plot hides, paired gaps, intervals over policies, and a better policy.

The checks of how a policy is repaired have a module of their own. Each check calls a student's function on small random
cases, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from scipy.stats import sem

from vsp.algorithms import distill
from vsp.config import paper_preset
from vsp.evaluation import start_states
from vsp.paper.statistics import spread
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout
from vsp.tasks import GOAL, get_task
from vsp.teachers import load_teacher

from .feedback import Exercise, Mistake, Question
from .lesson_3_repairs import (  # noqa: F401  checks, and what the lesson shows, re-exported
    BLAME,
    DAGGER,
    REFIT,
    blame,
    corrected,
    dagger_round,
    last_states,
    refit,
)

TASK = "SimpleGoal-v0"
FEWER_THAN = 13  # cells of a challenger: the paper's best policy has this many
FRESH = 2_000_003  # seed of the start states that a challenger is judged on
SEEDS = range(8)  # of the lesson's policies
NEAR = 0.1  # largest relative deviation of an interval's width from its large-sample value

READING = Exercise("3.1", "reading")
PAIRED_GAP = Exercise("3.2", "paired_gap", (f"{__name__}.standard_errors",))
INTERVAL = Exercise("3.3", "interval", ("vsp.paper.statistics.interval",))
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
        Mistake(-right, "a gap with the sign turned", "the mean of ours minus theirs", 1),
        Mistake(None, f"a gap of {gap:.3g}", "the mean of ours minus theirs", 1),
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
    alone = "an interval as narrow as if every episode were an independent sample"
    return [
        Mistake(single, alone, "one as wide as the policies differ", 3),
        Mistake(np.ptp(np.percentile(means, [2.5, 97.5])), "the range of single policies", "the range of *means*", 2),
        Mistake(1.645 / 1.96 * width, "an interval for 90 %", "one for 95 %: a tail of 2.5 % on either side", 1),
        Mistake(width / 1.96, "one standard error to either side", "the middle 95 % of the resampled means", 1),
        Mistake(np.sqrt(len(means)) * width, "resamples of one policy", "as many draws as there are policies", 2),
    ]


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
