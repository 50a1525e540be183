"""Checks of lesson 3: what a box plot hides, paired gaps, intervals over policies, and a better policy.

The checks of how a policy is repaired have a module of their own. Each check calls a student's function on small random
cases, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from scipy.stats import sem

from vsp import VoronoiPolicy, get_task, load_teacher, preset, start_states
from vsp.algorithms import distill
from vsp.rollouts import rollout
from vsp.tasks import GOAL

from .feedback import Exercise, Mistake, Question
from .lesson_3_repairs import BLAME, DAGGER, REFIT, blame, corrected, dagger_round, last_states, refit  # noqa: F401

TASK = "SimpleGoal-v0"
FEWER_THAN = 13  # cells of a challenger: the paper's best policy has this many
FRESH = 2_000_003  # seed of the start states that a challenger is judged on
SEEDS = range(8)  # of the lesson's policies
NEAR = 0.075  # largest relative deviation of an interval's width from its large-sample value

READING = Exercise("3.1", "reading")
PAIRED_GAP = Exercise("3.2", "paired_gap", ("standard_errors",))
INTERVAL = Exercise("3.3", "interval", ("interval", "vsp_interval"))
CHALLENGE = Exercise("3.7", "challenger")

WHO = ("the teacher", "the policies")
INSIDE = ("a quarter", "half", "three quarters", "nearly all")
WHERE = ("inside the box", "in the lower whisker", "nowhere")
SEES = ("the median", "the height of the box", "the mean")
SHARES = {"a quarter": "a quarter lies between one edge and the median", "nearly all": "that is box and whiskers"}
FALLS = {
    "in the lower whisker": "read off how far down it reaches; what does a fall into the pit return",
    "inside the box": "a fall into the pit costs ten points",
}
QUESTIONS = {
    "higher median": Question(WHO, "3150b12694b174b1", 1),
    "inside the box": Question(INSIDE, "7d82e6f49a289abe", 1, SHARES),
    "pit episodes": Question(WHERE, "e6e6884a6daa78bc", 2, FALLS),
    "sees the pit": Question(SEES, "1da09412679d3d1b", 3),
}


@READING.checks
def reading(answers: object) -> None:
    """3.1: answers `higher median`, `inside the box`, `pit episodes`, `sees the pit`."""
    READING.ask(answers, QUESTIONS, "a plot may hide just what went wrong.")


@PAIRED_GAP.checks
def paired_gap(function: Callable) -> None:
    """3.2: `paired_gap(ours, theirs)` returns the mean gap and its standard error, start by start."""
    unrelated = "the standard error of two samples that have nothing to do with each other"
    shared = "that of the differences: both played from the same starts"
    for seed in range(3):
        rng, n = np.random.default_rng(seed), 400
        luck = rng.normal(scale=5, size=n)
        # A large gap tells the root of a mean square from the deviation; skewed noise, other measures of spread
        ours, theirs = luck + 2 * rng.exponential(size=n) - 8, luck + rng.normal(size=n)
        difference, deviation = ours - theirs, (ours - theirs).std()
        values = PAIRED_GAP.call(function, ours, theirs)
        gap, error = PAIRED_GAP.array(values, (2,), hint=1, meaning="the gap and its standard error")
        gaps = [
            Mistake(-difference.mean(), "a gap with the sign turned", "the mean of ours minus theirs", 1),
            Mistake(None, f"a gap of {gap:.3g}", "the mean of ours minus theirs", 1),
        ]
        PAIRED_GAP.compare(gap, difference.mean(), gaps)
        errors = [
            Mistake(np.sqrt((ours.var() + theirs.var()) / n), unrelated, shared, 2),
            Mistake(deviation, "the deviation of single differences", "that of their mean, which is smaller", 3),
            Mistake(difference.var() / n, "a variance", "its root", 3),
            Mistake(ours.std() / np.sqrt(n), "the deviation of our returns", shared, 2),
            Mistake(1.96 * deviation / np.sqrt(n), "half a 95 % interval", "the standard error itself", 3),
            Mistake(None, f"a standard error of {error:.3g}", "the deviation of the mean of the differences", 3),
        ]
        PAIRED_GAP.compare(error, deviation / np.sqrt(n), errors, rtol=0.05)  # n or n - 1, or a bootstrap
    PAIRED_GAP.passed("shared starts make a small gap visible.")


def standard_errors(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """Return two standard errors of the mean gap between returns (n,): paired by start, and as if starts were
    independent."""
    return sem(ours - theirs), np.hypot(sem(ours), sem(theirs))


@INTERVAL.checks
def interval(function: Callable) -> None:
    """3.3: `interval(returns, rng)` returns the ends of a 95 % interval of the mean, by resampling policies."""
    unrelated = "an interval as narrow as if every episode were an independent sample"
    of_draws = "the middle 95 % of the means of resampled policies, of a few thousand draws"
    for seed in range(1, 4):
        rng = np.random.default_rng(seed)
        luck = 6 * rng.exponential(size=(30, 400))  # skewed, so that mean and median differ
        returns = np.linspace(0, 8, 30)[:, None] + luck  # the last policy is far from the mean
        values = INTERVAL.call(function, returns, rng)
        low, high = INTERVAL.array(values, (2,), hint=1, meaning="the ends of the interval")
        means = returns.mean(axis=1)
        INTERVAL.refuse_if(low > high, "the upper end first", "the lower end first", 1)
        outside = f"an interval from {low:.2f} to {high:.2f} without the mean {means.mean():.2f}"
        INTERVAL.refuse_if(not low <= means.mean() <= high, outside, "one around it", 1)
        width = 2 * 1.96 * means.std() / np.sqrt(len(means))  # the bootstrap interval in large samples
        single = 2 * 1.96 * returns.std() / np.sqrt(returns.size)
        middle = np.ptp(np.percentile(means, [2.5, 97.5]))
        narrow_or_wide = f"an interval that is too {'narrow' if high - low < width else 'wide'}"
        mistakes = [
            Mistake(0.0, "an interval of no width", "draws *with* replacement, which differ from each other", 2),
            Mistake(single, unrelated, "one as wide as the policies differ", 3),
            Mistake(middle, "the range of single policies", "the range of *means*", 2),
            Mistake(1.645 / 1.96 * width, "an interval for 90 %", "one for 95 %: a tail of 2.5 % on either side", 1),
            Mistake(width / 1.96, "one standard error to either side", "the middle 95 % of the resampled means", 1),
            Mistake(None, narrow_or_wide, of_draws, 2),
        ]
        INTERVAL.compare(high - low, width, mistakes, rtol=NEAR)
        aside = f"an interval around {(low + high) / 2:.2f}, aside of the mean {means.mean():.2f}"
        off = abs((low + high) / 2 - means.mean()) > NEAR / 2 * width
        INTERVAL.refuse_if(off, aside, "a tail of 2.5 % on either side, of resampled policies", 1)
        again = INTERVAL.call(function, returns[::-1], np.random.default_rng(1))  # other draws, by whatever generator
        same = "the same interval whatever is drawn: no policies are resampled"
        INTERVAL.refuse_if(np.allclose(again, values, rtol=1e-9), same, "the means of policies drawn at random", 2)
    INTERVAL.passed("policies are resampled, with all their episodes.")


@functools.cache
def _best_policy() -> float:
    """The highest mean return of the lesson's policies, from fresh starts."""
    task, teacher = get_task(TASK), load_teacher(TASK)
    policies = [distill(teacher, task, preset(TASK), seed=seed)[0] for seed in SEEDS]
    return max(rollout(policy, task, start_states(task, 2000, FRESH)).returns.mean() for policy in policies)


@CHALLENGE.checks
def challenger(policy: VoronoiPolicy) -> None:
    """3.7: fewer than `FEWER_THAN` cells and a higher mean return than the best of the lesson's policies, from fresh
    starts. The policy is rebuilt from its numbers, so that no method of the student's class is called."""
    if policy is None:
        raise CHALLENGE.unsolved()
    alone = "a vsp.VoronoiPolicy alone, not its class (`vsp.distill` returns two values)"
    CHALLENGE.refuse_if(not isinstance(policy, VoronoiPolicy), f"a {type(policy).__name__}", alone, 1)
    CHALLENGE.refuse_if(policy.task.name != TASK, f"a policy for {policy.task.name}", f"one for {TASK}", 1)
    form = {"metric": policy.metric, "scale": policy.scale, "sub_policy": policy.policy_class.name}
    made = VoronoiPolicy(policy.codewords, policy.coefficients, task=TASK, **form)
    CHALLENGE.refuse_if(len(made) >= FEWER_THAN, f"{len(made)} cells", f"fewer than {FEWER_THAN}", 1)
    task = get_task(TASK)
    starts = start_states(task, 2000, FRESH)
    ours, teacher = (rollout(p, task, starts) for p in (made, load_teacher(TASK)))
    best, mean = _best_policy(), ours.returns.mean()
    failing = f"{(ours.outcomes != GOAL).mean():.1%} of the episodes fail"
    returns = f"codewords and coefficients that return {mean:.3f} from fresh starts ({failing})"
    CHALLENGE.refuse_if(mean <= best, returns, f"more than the best policy's {best:.3f}", 2)
    others = f"the best of the eight {best:.2f}, the teacher {teacher.returns.mean():.2f}"
    CHALLENGE.passed(f"{len(made)} cells return {mean:.2f}, {others}; {failing}.")
