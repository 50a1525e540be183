"""Checks of lesson 3: what a box plot hides, paired gaps, intervals over policies, repairs, and a better policy."""

import functools
from collections.abc import Callable

import numpy as np
from scipy.stats import sem

from vsp import Policy, Task, VoronoiPolicy, agent, get_task, load_teacher, preset, start_states, teacher_episodes
from vsp.algorithms import distill
from vsp.paper import baselines
from vsp.protocol import intervals
from vsp.rollouts import Episodes, collect_episodes, rollout, visited_states
from vsp.subpolicies import POLICY_CLASSES
from vsp.tasks import GOAL, PIT

from .feedback import SEED, Exercise, Mistake, generators

TASK = "SimpleGoal-v0"
FEWER_THAN = 13  # cells of a challenger: the paper's best policy has this many
FRESH = 2_000_003 + SEED  # seed of the start states that a challenger is judged on
SEEDS = range(8)  # of the lesson's policies
# Largest relative deviation of a bootstrap of a few thousand draws: of each result, and of the mean over all cases
BOOTSTRAP = 0.2, 0.03
INTERVALS = 0.15, 0.02
ASIDE = 0.013  # how far the middle of an interval is from where it belongs, in widths, in the mean over all cases
LOPSIDED = 1.2  # how much farther an interval reaches to the side of an outlier, at least


def standard_errors(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """Return two standard errors of the mean gap between returns (n,): paired by start, and as if starts were
    independent."""
    return sem(ours - theirs), np.hypot(sem(ours), sem(theirs))


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


def corrected(
    policy: VoronoiPolicy, teacher: Policy, task: Task, starts: np.ndarray, states: np.ndarray, actions: np.ndarray
) -> VoronoiPolicy:
    """The policy after a round of DAgger from `starts` (n, d), its maps fitted again to the enlarged data."""
    more = visited_states(policy, task, starts)
    labels = np.concatenate([actions, teacher.predict(more)[0]])
    return baselines.refit(policy, np.concatenate([states, more]), labels)


READING = Exercise("3.1", "reading")
PAIRED_GAP = Exercise("3.2", "paired_gap", (standard_errors,))
INTERVAL = Exercise("3.3", "interval", (intervals.interval, intervals.bootstrap_draws, intervals.percentile_interval))
BLAME = Exercise("3.4", "blame", (last_states, failures), cures=((ValueError, "", 1),))
REFIT = Exercise("3.5", "refit", (baselines.refit,), cures=((np.linalg.LinAlgError, "", 3),))
DAGGER = Exercise("3.6", "dagger_round", (corrected,), cures=((ValueError, "inhomogeneous", 2),))
CHALLENGE = Exercise("3.7", "challenger")


@READING.checks
def reading(answers: object) -> None:
    """3.1: answers `higher median`, `inside the box`, `pit episodes`, `sees the pit`."""
    READING.ask(answers, "a plot may hide just what went wrong.")


@PAIRED_GAP.checks
def paired_gap(function: Callable) -> None:
    """3.2: `paired_gap(ours, theirs)` returns the mean gap and its standard error, start by start."""
    unrelated = "the standard error of two samples that have nothing to do with each other"
    shared = "that of the differences: both played from the same starts"
    ratios = []
    for i, rng in enumerate(generators(24)):
        n = int(rng.integers(250, 500))
        luck = rng.normal(scale=8, size=n)
        # A large gap tells the root of a mean square from the deviation; skewed noise, other measures of spread; and
        # large deviations in one part, a deviation without that part
        noise = rng.exponential(size=n) * np.where(np.arange(n) // 20 == (i % 3) * (n // 20) // 2, 9, 2)
        ours, theirs = luck + noise - 20, luck + rng.normal(size=n)
        difference, deviation = ours - theirs, (ours - theirs).std()
        values = PAIRED_GAP.call(function, ours, theirs)
        gap, error = PAIRED_GAP.array(values, (2,), hint=1, meaning="the gap and its standard error")
        turned = Mistake(-difference.mean(), "a gap with the sign turned", "the mean of ours minus theirs", 1)
        other = Mistake(None, f"a gap of {gap:.3g}", "the mean of ours minus theirs", 1)
        PAIRED_GAP.compare(gap, difference.mean(), [turned, other])
        errors = [
            Mistake(np.sqrt((ours.var() + theirs.var()) / n), unrelated, shared, 2),
            Mistake(deviation, "the deviation of single differences", "that of their mean, which is smaller", 3),
            Mistake(difference.var() / n, "a variance", "its root", 3),
            Mistake(ours.std() / np.sqrt(n), "the deviation of our returns", shared, 2),
            Mistake(1.96 * deviation / np.sqrt(n), "half a 95 % interval", "the standard error itself", 3),
            Mistake(None, f"a standard error of {error:.3g}", "the deviation of the mean of the differences", 3),
        ]
        PAIRED_GAP.compare(error, deviation / np.sqrt(n), errors, rtol=BOOTSTRAP[0])
        ratios.append(error / deviation * np.sqrt(n))
    off = abs(np.mean(ratios) - 1) > BOOTSTRAP[1]
    PAIRED_GAP.refuse_if(off, f"{np.mean(ratios):.1%} of the standard error", "it as it is, or by a bootstrap", 3)
    PAIRED_GAP.passed("shared starts make a small gap visible.")


@INTERVAL.checks
def interval(function: Callable) -> None:
    """3.3: `interval(returns, rng)` returns the ends of a 95 % interval of the mean, by resampling policies."""
    unrelated = "an interval as narrow as if every episode were an independent sample"
    of_draws = "the middle 95 % of the means of resampled policies, of a few thousand draws"
    by_chance = "the means of policies drawn at random"
    tails = "a tail of 2.5 % on either side, of resampled policies"
    ratios, sides, asides = [], [], []
    for i, rng in enumerate(generators(24)):
        p, skewed = (30, 6, 12, 8)[i % 4], i % 6 == 5
        luck = 6 * rng.exponential(size=(p, (40, 30)[i % 2]))  # skewed, so that mean and median differ
        returns = np.linspace(0, 8, p)[:, None] + luck + 60 * skewed * (np.arange(p) == p - 1)[:, None]
        values = INTERVAL.call(function, returns, rng)
        low, high = INTERVAL.array(values, (2,), hint=1, meaning="the ends of the interval")
        means = returns.mean(axis=1)
        INTERVAL.refuse_if(low > high, "the upper end first", "the lower end first", 1)
        outside = f"an interval from {low:.2f} to {high:.2f} without the mean {means.mean():.2f}"
        INTERVAL.refuse_if(
            not low - 1e-9 <= means.mean() <= high + 1e-9, outside, "one around it (`np.percentile` takes per cent)", 1
        )
        resampled = np.random.default_rng(i).multinomial(p, np.full(p, 1 / p), size=20_000) @ means / p
        ends, single = np.percentile(resampled, [2.5, 97.5]), 2 * 1.96 * returns.std() / np.sqrt(returns.size)
        middle, most = np.ptp(np.percentile(means, [2.5, 97.5])), np.ptp(np.percentile(resampled, [5, 95]))
        width = np.ptp(ends)
        mistakes = [
            Mistake(0.0, "an interval of no width", "draws *with* replacement, which differ from each other", 2),
            Mistake(single, unrelated, "one as wide as the policies differ", 3),
            Mistake(middle, "the range of single policies", "the range of *means*", 2),
            Mistake(most, "an interval for 90 %", tails, 1),
            Mistake(2 * resampled.std(), "one standard error to either side", "the middle 95 % of the means", 1),
            Mistake(None, f"an interval that is too {'narrow' if high - low < width else 'wide'}", of_draws, 3),
        ]
        if skewed:
            sides.append((high - means.mean()) / (means.mean() - low))
            continue
        INTERVAL.compare(high - low, width, mistakes, rtol=INTERVALS[0])
        asides.append((low + high - ends.sum()) / 2 / width)
        if i == 0:  # other draws, by whatever generator
            again = INTERVAL.call(function, returns[::-1], np.random.default_rng(1))
            same = "the same interval whatever is drawn: no policies are resampled"
            INTERVAL.refuse_if(np.allclose(again, values, rtol=1e-9), same, by_chance, 2)
        ratios.append((high - low) / width)
    INTERVAL.refuse_if(abs(np.mean(asides)) > ASIDE, "intervals aside of the mean", tails, 1)
    INTERVAL.refuse_if(np.mean(sides) < LOPSIDED, "intervals as wide to both sides beside an outlier", by_chance, 2)
    off = abs(np.mean(ratios) - 1) > INTERVALS[1]
    INTERVAL.refuse_if(off, f"intervals of {np.mean(ratios):.1%} of the width", of_draws, 3)
    INTERVAL.passed("policies are resampled, with all their episodes.")


def _random_policy(rng: np.random.Generator, k: int = 5) -> VoronoiPolicy:
    """A policy that mostly walks towards the goal, and often into the pit; in one cell it stands still."""
    maps = np.concatenate([rng.normal(scale=0.3, size=(k, 2, 2)), rng.uniform(-1, -0.2, size=(k, 1, 2))], axis=1)
    maps[0] = 0.0
    return VoronoiPolicy(rng.uniform(0.1, 0.9, size=(k, 2)), maps, task=TASK)


def _sometimes(teacher: Policy) -> Policy:
    """A teacher that stands still in the right third of the square, and so misses the goal from there."""
    return agent(lambda states: np.where(states[..., :1] > 0.66, 0.0, teacher.predict(states)[0]))


@BLAME.checks
def blame(function: Callable) -> None:
    """3.4: `blame(policy, teacher, task, starts)` counts, per cell, the failures whose last action it chose. (k,)"""
    task, shipped = get_task(TASK), load_teacher(TASK)
    for i, rng in enumerate(generators(9)):
        teacher, k = _sometimes(shipped) if i % 2 else shipped, int(rng.integers(3, 9))
        policy, starts = _random_policy(rng, k), task.start(rng, 150)
        if i == 8:  # a policy that never fails where the teacher does not
            policy = baselines.rule_of_thumb(TASK)[1]
            starts, k = starts[~failures(policy, teacher, task, starts)], len(policy)
        answer = BLAME.call(function, policy, teacher, task, starts)
        value = BLAME.array(answer, (k,), hint=1, meaning="a count per cell")
        ours, failed = rollout(policy, task, starts).outcomes, failures(policy, teacher, task, starts)
        ends = np.array([episode.states[-1] for episode in collect_episodes(policy, task, starts)])
        last, shown = policy.cells(ends), starts[failed] if failed.any() else starts[:1]
        of_failures = policy.cells(visited_states(policy, task, shown))
        count = functools.partial(np.bincount, minlength=k)
        right, too_many = count(last[failed]), "only those of starts from which the teacher reaches the goal"
        number = "as many failures, but in other cells" if value.sum() == right.sum() else f"{value.sum():g} failures"
        in_pit, pit_only = failed & (ours == PIT), "only the episodes that end in the pit"
        mistakes = [
            Mistake(count(last[ours != GOAL]), "failures counted where the teacher fails too", too_many, 2),
            Mistake(
                count(policy.cells(starts)[failed]), "failures counted in the cell of their start", "in the last one", 3
            ),
            Mistake(count(last[in_pit]), pit_only, "also those that run out of steps", 2),
            Mistake(count(of_failures), "every step of a failure", "its last", 3),
            Mistake(right / max(1, failed.sum()), "shares", "counts", 1),
            Mistake(None, number, f"{failed.sum()}, each in the cell of the policy's last state", 3),
        ]
        BLAME.compare(value, right, mistakes)
    BLAME.passed("every failure is attributed to the cell that chose the last action.")


@REFIT.checks
def refit(function: Callable) -> None:
    """3.5: `refit(policy, states, actions)` returns the same cells with maps by least squares."""
    for rng, k in zip(generators(4), (6, 4, 9, 6)):
        policy = _random_policy(rng, k)
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
    new = REFIT.call(function, policy, states, actions)
    REFIT.refuse_if(type(new) is not VoronoiPolicy, f"a {type(new).__name__}", "a vsp.VoronoiPolicy", 1)
    new = VoronoiPolicy(new.codewords, new.coefficients, task=TASK)  # no method of the student's class
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
    task, teacher = get_task(TASK), _sometimes(load_teacher(TASK))
    for rng, n in zip(generators(3), (20, 30, 7)):
        policy, starts = _random_policy(rng, int(rng.integers(3, 9))), task.start(rng, n)
        before = Episodes(teacher_episodes(teacher, task, 40 // n, rng))
        value = DAGGER.call(function, policy, teacher, task, starts, before.states, before.actions)
        if not isinstance(value, tuple | list | np.ndarray) or len(value) != 2:
            raise DAGGER.wrong(f"a {type(value).__name__}", "two arrays, states and actions", 1)
        ours, theirs = (visited_states(p, task, starts) for p in (policy, teacher))
        states = _gathered(value[0], before.states, ours, theirs, len(starts))
        actions = DAGGER.array(value[1], states.shape, "actions", 2, "one for each state")
        labels, copies = (p.predict(states)[0] for p in (teacher, policy))
        right, copied = (np.isclose(actions, a, atol=1e-4).all(axis=1).mean() for a in (labels, copies))
        order = right < 1 and np.allclose(np.sort(actions, axis=0), np.sort(labels, axis=0), atol=1e-4)
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


def _sorted(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(np.round(rows, 5).T)]


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
    name, maps = policy.policy_class.name, " or ".join(POLICY_CLASSES)
    CHALLENGE.refuse_if(name not in POLICY_CLASSES, f"a sub-policy class {name!r}", f"one of vsp's, {maps}", 1)
    form = {"metric": policy.metric, "scale": policy.scale, "sub_policy": name}
    made = VoronoiPolicy(policy.codewords, policy.coefficients, task=TASK, **form)
    CHALLENGE.refuse_if(len(made) >= FEWER_THAN, f"{len(made)} cells", f"fewer than {FEWER_THAN}", 1)
    starts = start_states(TASK, 2000, FRESH)
    ours, teacher = (rollout(p, TASK, starts) for p in (made, load_teacher(TASK)))
    best, mean = _best_policy(), ours.returns.mean()
    failing = f"{(ours.outcomes != GOAL).mean():.1%} of the episodes fail"
    returns = f"codewords and coefficients that return {mean:.3f} from fresh starts ({failing})"
    CHALLENGE.refuse_if(mean <= best, returns, f"more than the best policy's {best:.3f}", 2)
    others = f"the best of the eight {best:.2f}, the teacher {teacher.returns.mean():.2f}"
    CHALLENGE.passed(f"{len(made)} cells return {mean:.2f}, {others}; {failing}.")
