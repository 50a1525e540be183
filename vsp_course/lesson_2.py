"""Checks of lesson 2: a plot of a run, running means, Algorithm 1, hyperparameters; and the runs shown there.

The checks of the two passes and of a sub-policy class have modules of their own. Each check calls a student's function
on cases with a known answer, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

import vsp
from vsp import Config, History, Partition, Policy, Task, VoronoiPolicy, teacher_episodes
from vsp.algorithms import distill
from vsp.rollouts import Episode

from .feedback import Exercise, Mistake, NotYet, Question
from .lesson_2_passes import MERGE, SMALL, SPLIT, merge_regions, split_regions, walk  # noqa: F401  checks, re-exported
from .lesson_2_policy_class import OWN_CLASS, my_policy_class  # noqa: F401

READING = Exercise("2.1", "reading")
RUNNING_MEAN = Exercise("2.2", "running_mean")
ALGORITHM_1 = Exercise("2.5", "algorithm_1")
PREDICTION = Exercise("2.6", "prediction")

MOMENTS = ("before iteration 500", "between 500 and 2000", "after 2000")
CAUSES = ("a split", "a merge", "a reset of the buffers", "a change of the teacher")
FEWER = {
    "a split": "a split adds a codeword",
    "a reset of the buffers": "a reset empties buffers and leaves codewords where they are",
    "a change of the teacher": "the teacher is the same all the time",
}
JUMPS = {
    "a merge": "a merge keeps a map that is trained already",
    "a reset of the buffers": "an emptied buffer holds few states for a while, which moves the loss a little, also in "
    "the freeze; the large jumps are another matter",
    "a change of the teacher": "the teacher is the same all the time",
}
QUESTIONS = {
    "half of the cells": Question(MOMENTS, "97a828fa47052c2d", 1),
    "fewer cells by": Question(CAUSES, "fb8f27a3b939a5dc", 2, FEWER),
    "loss jumps by": Question(CAUSES, "71c02946198a22ee", 3, JUMPS),
}
CHANGES = {
    "a lower distance": {"min_pol_distance": 0.15},
    "a higher loss": {"max_pol_loss": 1e-3},
    "easier merges": {"min_param_distance": 1.0},
    "exact maps": {"fit": "closed_form"},
}
PREDICTIONS = dict.fromkeys(CHANGES, ("more cells", "as many", "fewer cells"))
SEEDS = range(3)  # of the runs for each change


@READING.checks
def reading(answers: dict, history: History, config: Config) -> None:
    """2.1: answers `last change` (an iteration), `half of the cells`, `fewer cells by`, `loss jumps by`."""
    READING.answers(answers, {"last change": ()})
    given, last = answers["last change"], max(event.iteration for event in history.events)
    READING.refuse_if(not isinstance(given, int | float | np.number), f"{given!r} for 'last change'", "a number")
    if abs(given - last) > 0.04 * config.n_epochs:
        side = "the number of cells still changes after it" if given < last else "nothing changes there any more"
        side = "that is where the freeze begins" if given == config.n_epochs - config.n_freeze else side
        raise READING.wrong(f"iteration {given:g}, but {side}", "the last step of the left curve", 1)
    READING.ask(answers, QUESTIONS, "the plot has told you what the algorithm does when.")


@RUNNING_MEAN.checks
def running_mean(function: Callable) -> None:
    """2.2: `running_mean(cells, losses)` returns, per step, the mean loss since its cell was entered. (T,)"""
    cases = [
        (np.array([4, 4, 4]), np.array([1.0, 0.0, 2.0])),
        (np.array([0, 0, 1, 1, 0, 0]), np.array([1.0, 3.0, 5.0, 1.0, 4.0, 0.0])),
    ]
    for rng in map(np.random.default_rng, range(4)):
        cells = np.repeat(rng.integers(3, size=8), rng.integers(1, 5, size=8))
        cases.append((cells, rng.uniform(size=len(cells))))
    remember = "the mean since the cell was entered (is the cell of the step before remembered in every step?)"
    for cells, losses in cases:
        value = RUNNING_MEAN.array(RUNNING_MEAN.call(function, cells, losses), losses.shape, hint=1)
        series, entered = pd.Series(losses), np.append(True, cells[1:] != cells[:-1])
        visits, outside = series.groupby(entered.cumsum()), series.groupby((cells != cells[0]).cumsum())
        right = visits.expanding().mean()
        earlier = [losses[: t + 1][cells[: t + 1] == cell].mean() for t, cell in enumerate(cells)]
        other = f"another number at step {np.argmin(np.isclose(value, right))} of cells {cells.tolist()}"
        begins = "a mean that begins anew at every step outside the first cell"
        mistakes = [
            Mistake(series.expanding().mean(), "the mean since the episode began", "it since the cell was entered", 2),
            Mistake(earlier, "losses of an earlier visit to the cell", "a new beginning at every entrance", 2),
            Mistake(visits.transform("mean"), "losses of later steps", "only those up to the step", 1),
            Mistake(visits.cumsum(), "sums", "means", 1),
            Mistake(losses, "the losses themselves, as if the mean began anew at every step", remember, 2),
            Mistake(outside.expanding().mean(), begins, remember, 2),
            Mistake(None, other, "the mean since its cell was entered", 1),
        ]
        RUNNING_MEAN.compare(value, right, mistakes)
    RUNNING_MEAN.passed("it restarts whenever the episode enters another cell.")


class _Log:
    """Stand-in for a partition and its passes that notes what is done with it, a list for each observed episode."""

    def __init__(self) -> None:
        self.codewords, self.episodes, self.rounds = np.zeros((0, 2)), [], [[]]
        self.strays = 0  # splitting passes over anything but the last episode

    def add(self, state: np.ndarray, rng: object = None) -> int:
        self.codewords = np.vstack([self.codewords, state])
        self.rounds[-1].append(f"add {state.tolist()}")
        return len(self.codewords) - 1

    def observe(self, episode: Episode) -> None:
        self.episodes.append(episode)
        self.rounds.append([])

    def train(self, rng: object = None) -> float:
        self.rounds[-1].append("train")
        return 0.0

    def clear(self) -> None:
        self.rounds[-1] += ["clear"] if len(self.rounds) > 2 else []  # does no harm after the first episode

    def split(self, partition: object, episode: Episode, config: Config, rng: object) -> list:
        self.strays += episode is not self.episodes[-1]
        self.rounds[-1].append("split")
        return []

    def merge(self, partition: object, config: Config) -> list:
        self.rounds[-1].append("merge")
        return []


@ALGORITHM_1.checks
def algorithm_1(function: Callable) -> None:
    """2.5: `algorithm_1(partition, episodes, config, rng, split, merge)` makes the right calls in the right order."""
    for schedule in ((40, 4, 10, 8, 15), (30, 3, 5, 6, 9), (50, 7, 7, 14, 50)):
        names = ("n_epochs", "n_split", "n_merge", "n_freeze", "n_reset")
        config, log = replace(SMALL, **dict(zip(names, schedule))), _Log()
        episodes = [walk([0.5 * n / config.n_epochs, 0.5], [0, 0]) for n in range(config.n_epochs)]
        rng = np.random.default_rng(0)
        ALGORITHM_1.call(function, log, list(episodes), config, rng, log.split, log.merge, keep=True, empty=True)
        _on_schedule(log, episodes, config, "the freeze begins at n_epochs - n_freeze")
        few, log = episodes[:-5], _Log()  # the run may stop with an error when there are no more
        with contextlib.suppress(Exception):
            function(log, list(few), config, rng, log.split, log.merge)
        words = f"the freeze begins at n_epochs - n_freeze, however many episodes there are ({len(few)})"
        _on_schedule(log, few, config, words)
    ALGORITHM_1.passed("every pass comes when it is due, and none in the freeze.")


def _on_schedule(log: _Log, episodes: list[Episode], config: Config, freeze: str) -> None:
    """Compare what was done with what is right, iteration by iteration."""
    right, observed = _Log(), log.episodes
    _algorithm_1(right, episodes, config, None, right.split, right.merge)
    expected = "the first state of the first episode, added before it is observed"
    ALGORITHM_1.refuse_if(not observed, "no episode observed", "one in every iteration", 1)
    ALGORITHM_1.refuse_if(log.rounds[0] != right.rounds[0], "another first codeword or none", expected, 1)
    in_order = len(observed) == len(episodes) and all(seen is e for seen, e in zip(observed, episodes))
    number = f"{len(observed)} episodes observed"
    ALGORITHM_1.refuse_if(not in_order, number, f"each of the {len(episodes)}, in order", 1)
    stray = "a splitting pass over something else"
    ALGORITHM_1.refuse_if(log.strays > 0, stray, "one over the episode just observed", 1)
    frozen = config.n_epochs - config.n_freeze
    for n, (done, due) in enumerate(zip(log.rounds[1:], right.rounds[1:])):
        steps = f"{', '.join(done) or 'nothing'} in iteration {n} after its episode was observed"
        ALGORITHM_1.refuse_if(done[:1] != ["train"], steps, "one training step first", 1)
        words, hint = (f"; {freeze} = {frozen}", 3) if n >= frozen - config.n_split else ("", 2)
        for what, period in (("split", "n_split"), ("merge", "n_merge"), ("clear", "n_reset")):
            every = f"one every {period} = {getattr(config, period)} iterations{words}"
            missing, extra = what in due and what not in done, what in done and what not in due
            ALGORITHM_1.refuse_if(missing, f"no `{what}` in iteration {n}", every, hint)
            why = "a map that was trained once tells nothing yet" if n == 0 else f"it is not due then{words}"
            ALGORITHM_1.refuse_if(extra, f"`{what}` in iteration {n}", f"none: {why}", hint)
        ALGORITHM_1.refuse_if(done != due, steps, "each once, splits first, as the paper prints it", 2)


def grown(
    split: Callable, merge: Callable, frame: Callable, teacher: Policy, task: Task, config: Config
) -> tuple[VoronoiPolicy, VoronoiPolicy]:
    """Run the student's three functions and vsp's with the same random numbers, and return both policies.

    vsp's function replaces one that is still a stub; a printed line says which.
    """
    ours, stubs = (vsp.split_regions, vsp.merge_regions, _algorithm_1), set()
    students = [_or_ours(function, our, stubs) for function, our in zip((split, merge, frame), ours)]
    made = []
    for passes in (students, ours):
        rng, partition = np.random.default_rng(0), Partition(task, config)
        episodes = list(teacher_episodes(teacher, task, config.n_epochs, rng))
        passes[2](partition, episodes, config, rng, *passes[:2])
        made.append(partition.policy())
    names = [name for name in ("split_regions", "merge_regions", "algorithm_1") if name not in stubs]
    stand_in = f" Not written yet, so vsp's: {', '.join(sorted(stubs))}." if stubs else ""
    print(f"Yours: {', '.join(names) or 'none'}.{stand_in}")
    same = np.array_equal(made[0].codewords, made[1].codewords)
    print(f"{len(made[0])} cells on the left, {len(made[1])} on the right: {'' if same else 'not '}the same codewords.")
    return made[0], made[1]


def _or_ours(function: Callable, ours: Callable, stubs: set[str]) -> Callable:
    """Return `function`, or `ours` if it is a stub; then its name goes to `stubs`."""

    def either(*given: object, **named: object) -> object:
        try:
            return function(*given, **named)
        except NotImplementedError:
            stubs.add(function.__name__)
            return ours(*given, **named)

    return either


def _algorithm_1(
    partition: Partition, episodes: list[Episode], config: Config, rng: object, split: Callable, merge: Callable
) -> None:
    """Algorithm 1 as in the lesson's text, for students who have not written theirs."""
    partition.add(episodes[0].states[0], rng)
    for n, episode in enumerate(episodes):
        partition.observe(episode)
        partition.train(rng)
        thawed = 0 < n < config.n_epochs - config.n_freeze
        if thawed and n % config.n_split == 0:
            split(partition, episode, config, rng)
        if thawed and n % config.n_merge == 0:
            merge(partition, config)
        if n and n % config.n_reset == 0:
            partition.clear()


@PREDICTION.checks
def prediction(answers: dict, teacher: Policy, task: Task, config: Config) -> None:
    """2.6: for each of `CHANGES`, whether there will be more cells, as many, or fewer. The first answers are kept."""
    first, means = PREDICTION.first(answers, PREDICTIONS), runs(teacher, task, config)["mean"]
    wrong, wrong_first = (_disagree(means, given) for given in (answers, first))
    why = "what the runs do: look at them in the cell below, and find out why"
    PREDICTION.refuse_if(bool(wrong), f"wrong predictions for {wrong}", why, 1)
    corrected = f"corrected. Your first prediction was wrong about {wrong_first}; the table keeps it."
    PREDICTION.passed(corrected if wrong_first else "the runs did what you said.")


def _disagree(means: pd.Series, given: dict) -> list[str]:
    """Return the predictions in `given` that the mean numbers of cells contradict. Near a limit, two are right."""
    ratios = means / means.iloc[0]
    right = {"more cells": ratios > 1.06, "as many": abs(ratios - 1) < 0.24, "fewer cells": ratios < 0.94}
    return [name for name in CHANGES if not right[given[name]][name]]


def predicted(given: object, teacher: Policy, task: Task, config: Config) -> pd.DataFrame | None:
    """Return the table of `runs` with the first prediction. Without one, print so and return None."""
    try:
        first = pd.Series(PREDICTION.first(given, PREDICTIONS))
    except NotYet as missing:
        print(missing)
        return None
    return runs(teacher, task, config).round(1).assign(**{"you said first": first}).fillna("")


def runs(teacher: Policy, task: Task, config: Config) -> pd.DataFrame:
    """Return numbers of cells per seed, and their mean: one row for `config`, one for each of `CHANGES` alone."""
    changes = {"as it is": {}} | CHANGES
    cells = {
        name: [len(distill(teacher, task, replace(config, **change), seed=seed)[0]) for seed in SEEDS]
        for name, change in changes.items()
    }
    return pd.DataFrame(cells, index=[f"seed {seed}" for seed in SEEDS]).T.assign(mean=lambda t: t.mean(axis=1))
