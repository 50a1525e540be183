"""Checks of lesson 2: a plot of a run, running means, Algorithm 1, hyperparameters; and the runs shown there.

The checks of the two passes and of a sub-policy class have modules of their own. Each check calls a student's function
on cases with a known answer, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from vsp.algorithms import distill, teacher_episodes
from vsp.algorithms import merge_regions as vsp_merge
from vsp.algorithms import split_regions as vsp_split
from vsp.config import Config
from vsp.history import History
from vsp.partition import Partition
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Episode, Policy
from vsp.tasks import Task

from .feedback import Exercise, Mistake, NotYet, Question, works
from .lesson_2_passes import MERGE, SMALL, SPLIT, merge_regions, split_regions, walk  # noqa: F401  checks, re-exported
from .lesson_2_policy_class import OWN_CLASS, my_policy_class  # noqa: F401

READING = Exercise("2.1", "reading")
RUNNING_MEAN = Exercise("2.2", "running_mean")
ALGORITHM_1 = Exercise("2.5", "algorithm_1")
PREDICTION = Exercise("2.6", "prediction", seconds=180)

MOMENTS = ("before iteration 500", "between 500 and 2000", "after 2000")
CAUSES = ("a split", "a merge", "a reset of the buffers", "a change of the teacher")
TREND = ("more cells", "as many", "fewer cells")
SAME = 0.12  # a smaller relative change of the mean number of cells counts as none
CHANGES = {
    "a lower distance": {"min_pol_distance": 0.15},
    "a higher loss": {"max_pol_loss": 1e-3},
    "easier merges": {"min_param_distance": 1.0},
    "exact maps": {"fit": "closed_form"},
}


@READING.checks
def reading(answers: object, history: History, config: Config) -> None:
    """2.1: answers `last change` (an iteration), `half of the cells`, `fewer cells by`, `loss jumps by`."""
    READING.answers(answers, {"last change": float})
    given, last = answers["last change"], max((event.iteration for event in history.events), default=0)
    if abs(given - last) > 0.04 * config.n_epochs:
        side = "the number of cells still changes after it" if given < last else "nothing changes there any more"
        side = "that is where the freeze begins" if given == config.n_epochs - config.n_freeze else side
        raise READING.wrong(f"iteration {given:g}, but {side}", "the last step of the left curve", 1)
    cells = np.array(history.cells)
    early = int(np.argmax(cells >= cells[-1] / 2))
    same_teacher = {"a change of the teacher": "the teacher is the same all the time"}
    fewer = {
        "a split": "a split adds a codeword",
        "a reset of the buffers": "a reset empties buffers and leaves codewords where they are",
    }
    jumps = {
        "a merge": "a merge keeps a map that is trained already",
        "a reset of the buffers": "an emptied buffer holds few states for a while, which moves the loss a little, also "
        "in the freeze; the large jumps are another matter",
    }
    questions = {
        "half of the cells": Question(MOMENTS, MOMENTS[int(np.digitize(early, [500, 2000]))], 1),
        "fewer cells by": Question(CAUSES, "fb8f27a3b939a5dc", 2, fewer | same_teacher),
        "loss jumps by": Question(CAUSES, "71c02946198a22ee", 3, jumps | same_teacher),
    }
    first = READING.ask(answers, questions)
    READING.passed(f"the plot has told you what the algorithm does when.{first}")


@RUNNING_MEAN.checks
def running_mean(function: Callable) -> None:
    """2.2: `running_mean(cells, losses)` returns, per step, the mean loss since its cell was entered. (T,)"""
    _forgets(function, np.array([4, 4, 4]), np.array([1.0, 0.0, 2.0]))
    _forgets(function, np.array([0, 0, 1, 1, 0, 0]), np.array([1.0, 3.0, 5.0, 1.0, 4.0, 0.0]))
    for seed in range(4):
        rng = np.random.default_rng(seed)
        cells = np.repeat(rng.integers(3, size=8), rng.integers(1, 5, size=8))
        _forgets(function, cells, rng.uniform(size=len(cells)))
    RUNNING_MEAN.passed("it restarts whenever the episode enters another cell.")


def _forgets(function: Callable, cells: np.ndarray, losses: np.ndarray) -> None:
    right, steps = _since(cells, losses), np.arange(1, len(losses) + 1)
    value = RUNNING_MEAN.array(RUNNING_MEAN.call(function, cells, losses), losses.shape, hint=1)
    by_cell = [losses[:t][cells[:t] == cells[t - 1]].mean() for t in steps]
    visit = np.concatenate([[True], cells[1:] != cells[:-1]]).cumsum()
    whole = [losses[visit == v].mean() for v in visit]
    sums = right * (steps - [np.argmax(visit == v) for v in visit])
    stuck = _since(cells, losses, lambda t: cells[t] != cells[0])
    remember = "the mean since the cell was entered (is the cell of the step before remembered in every step?)"
    step = np.argmin(np.isclose(value, right))
    mistakes = [
        Mistake(losses.cumsum() / steps, "the mean since the episode began", "it since the cell was entered", 2),
        Mistake(by_cell, "losses of an earlier visit to the cell", "a new beginning at every entrance", 2),
        Mistake(whole, "losses of later steps", "only those up to the step", 1),
        Mistake(sums, "sums", "means", 1),
        Mistake(losses, "the losses themselves, as if the mean began anew at every step", remember, 2),
        Mistake(stuck, "a mean that begins anew at every step outside the first cell", remember, 2),
        Mistake(
            None, f"another number at step {step} of cells {cells.tolist()}", "the mean since its cell was entered", 1
        ),
    ]
    RUNNING_MEAN.compare(value, right, mistakes)


def _since(cells: np.ndarray, losses: np.ndarray, entered: Callable[[int], bool] | None = None) -> np.ndarray:
    """Return the mean at every step since a cell was entered; `entered` tells where that happens."""
    entered = entered or (lambda t: cells[t] != cells[t - 1])
    means, begin = np.zeros(len(losses)), 0
    for t in range(len(losses)):
        begin = t if t and entered(t) else begin
        means[t] = losses[begin : t + 1].mean()
    return means


class _Witness:
    """Stand-in for a partition that records the calls after each observed episode."""

    def __init__(self) -> None:
        self.codewords, self.before, self.episodes, self.rounds = np.zeros((0, 2)), [], [], []
        self.strays = 0  # splitting passes over anything but the last episode

    def _do(self, what: str, result: object = None) -> object:
        (self.rounds[-1] if self.rounds else self.before).append(what)
        return result

    def add(self, state: np.ndarray, rng: object = None) -> object:
        self.codewords = np.vstack([self.codewords, state])
        return self._do("add", len(self.codewords) - 1)

    def observe(self, episode: Episode) -> None:
        self.episodes.append(episode)
        self.rounds.append([])

    def train(self, rng: object = None) -> object:
        return self._do("train", 0.0)

    def clear(self) -> object:
        return self._do("clear")

    def split(self, partition: object, episode: Episode, config: Config, rng: object) -> object:
        self.strays += episode is not self.episodes[-1]
        return self._do("split", [])

    def merge(self, partition: object, config: Config) -> object:
        return self._do("merge", [])


@ALGORITHM_1.checks
def algorithm_1(function: Callable) -> None:
    """2.5: `algorithm_1(partition, episodes, config, rng, split, merge)` makes the right calls in the right order."""
    schedules = ((40, 4, 10, 8, 15), (30, 3, 5, 6, 9), (50, 7, 7, 14, 50))
    for n_epochs, n_split, n_merge, n_freeze, n_reset in schedules:
        rule = replace(SMALL, n_epochs=n_epochs, n_split=n_split, n_merge=n_merge, n_freeze=n_freeze, n_reset=n_reset)
        _on_schedule(function, rule, n_epochs)
    rule = replace(SMALL, n_epochs=40, n_split=4, n_merge=10, n_freeze=8, n_reset=15)
    _on_schedule(function, rule, 35)
    ALGORITHM_1.passed("every pass comes when it is due, and none in the freeze.")


def _on_schedule(function: Callable, config: Config, n_episodes: int) -> None:
    """Check one schedule. With fewer episodes than iterations, the run may stop with an error at the last one."""
    episodes = [walk([0.5 * n / config.n_epochs, 0.5], [0, 0]) for n in range(n_episodes)]
    partition = _Witness()
    given = partition, list(episodes), config, np.random.default_rng(0), partition.split, partition.merge
    if n_episodes == config.n_epochs:
        ALGORITHM_1.call(function, *given, keep=True, empty=True)
    else:
        works(function, *given)
    observed, expected = partition.episodes, "the first state of the first episode, added before it is observed"
    ALGORITHM_1.refuse_if(not observed, "no episode observed", "one in every iteration", 1)
    first = "add" in partition.before and np.array_equal(partition.codewords[0], episodes[0].states[0])
    ALGORITHM_1.refuse_if(not first, "another first codeword or none", expected, 1)
    if len(observed) != n_episodes or any(own is not e for own, e in zip(observed, episodes)):
        raise ALGORITHM_1.wrong(f"{len(observed)} episodes observed", f"each of the {n_episodes}, in order", 1)
    if any("add" in done for done in partition.rounds):
        raise ALGORITHM_1.wrong("codewords added in the loop", "the first one only: the rest is up to `split`", 1)
    if n_episodes == config.n_epochs:
        freeze = f"the freeze begins at {config.n_epochs - config.n_freeze}"
    else:
        freeze = f"the freeze begins at n_epochs - n_freeze, however many episodes there are ({n_episodes})"
    for n, done in enumerate(partition.rounds):
        _one_round(n, done, config, freeze)
    stray = "a splitting pass over something else"
    ALGORITHM_1.refuse_if(partition.strays > 0, stray, "one over the episode just observed", 1)


def _one_round(n: int, done: list[str], config: Config, freeze: str) -> None:
    frozen = config.n_epochs - config.n_freeze
    found = f"{done or 'nothing'} in iteration {n} after its episode was observed"
    ALGORITHM_1.refuse_if(done[:1] != ["train"] or done.count("train") != 1, found, "one training step first", 1)
    for what, every in (("split", config.n_split), ("merge", config.n_merge), ("clear", config.n_reset)):
        due = n > 0 and n % every == 0 and (what == "clear" or n < frozen)
        if (what in done) != due and not (n == 0 and what == "clear"):
            period = "n_reset" if what == "clear" else f"n_{what}"
            hint, last = 3 if n >= frozen - every else 2, what != "clear" and n >= frozen - every
            if due:
                expected = f"one every {period} = {every} iterations" + (f": {freeze}" if last else "")
                raise ALGORITHM_1.wrong(f"no `{what}` in iteration {n}", expected, hint)
            why = freeze if n >= frozen and n % every == 0 else "it is not due then"
            why = "a map that was trained once tells nothing yet" if n == 0 else why
            raise ALGORITHM_1.wrong(f"`{what}` in iteration {n}", f"none: {why}", hint)
    order = [what for what in done if what != "train"]
    right = [what for what in ("split", "merge", "clear") if what in order]
    ALGORITHM_1.refuse_if(
        order != right, f"{', '.join(order)} in iteration {n}", "each once, splits first, as the paper prints it", 2
    )


def grown(
    split: Callable, merge: Callable, frame: Callable, teacher: Policy, task: Task, config: Config, seed: int = 0
) -> tuple[VoronoiPolicy, VoronoiPolicy]:
    """Run the student's three functions and vsp's with the same random numbers, and return both policies.

    vsp's function replaces one that is still a stub; a printed line says which.
    """
    ours, stubs = (vsp_split, vsp_merge, _algorithm_1), set()
    own = [_or_ours(function, our, stubs) for function, our in zip((split, merge, frame), ours)]
    made = []
    for passes in (own, ours):
        rng, partition = np.random.default_rng(seed), Partition(task, config)
        episodes = list(teacher_episodes(teacher, task, config.n_epochs, rng))
        passes[2](partition, episodes, config, rng, *passes[:2])
        made.append(partition.policy())
    names = [name for name in ("split_regions", "merge_regions", "algorithm_1") if name not in stubs]
    stand_in = f" Not written yet, so vsp's: {', '.join(sorted(stubs))}." if stubs else ""
    print(f"Yours: {', '.join(names) or 'none'}.{stand_in}")
    same = np.array_equal(made[0].codewords, made[1].codewords)
    print(f"{len(made[0])} cells on the left, {len(made[1])} on the right: {'' if same else 'not '}the same codewords.")
    return made[0], made[1]


def _or_ours(own: Callable, ours: Callable, stubs: set[str]) -> Callable:
    """Return `own`, or `ours` if `own` is a stub; then its name goes to `stubs`."""

    @functools.wraps(own)
    def either(*given: object, **named: object) -> object:
        try:
            return own(*given, **named)
        except NotImplementedError:
            stubs.add(own.__name__)
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
def prediction(answers: dict, teacher: Policy, task: Task, config: Config, seeds: range = range(3)) -> None:
    """2.6: for each of `CHANGES`, whether there will be more cells, as many, or fewer. The first answers are kept."""
    first, means = _first(answers), runs(teacher, task, config, seeds)["mean"]
    wrong, wrong_first = (_disagree(means, given) for given in (answers, first))
    if wrong:
        words = f"the runs disagree with you on {wrong}. Look at them in the cell below, and find out why."
        raise NotYet(f"{PREDICTION.number} {PREDICTION.name}: {words} → Hint 1 of exercise {PREDICTION.number}")
    corrected = f"corrected. Your first prediction was wrong about {wrong_first}; the table keeps it."
    PREDICTION.passed(corrected if wrong_first else "the runs did what you said.")


def _disagree(means: pd.Series, given: dict) -> list[str]:
    """Return the predictions in `given` that the mean numbers of cells contradict."""
    wrong = []
    for name in CHANGES:
        ratio = means[name] / means.iloc[0]
        near = [TREND[i] for i in {int(np.digitize(-ratio, [-1 - s, -1 + s])) for s in (SAME / 2, 2 * SAME)}]
        wrong += [name] if given[name] not in near else []
    return wrong


def _first(given: object) -> dict[str, str]:
    """The first complete prediction since the kernel started. Raises NotYet if there is none."""
    PREDICTION.answers(given, dict.fromkeys(CHANGES, TREND))
    return PREDICTION.first(given)


def predicted(given: object, teacher: Policy, task: Task, config: Config) -> pd.DataFrame | None:
    """Return the table of `runs` with the first prediction. Without one, print so and return None."""
    try:
        first = pd.Series(_first(given))
    except NotYet as missing:
        print(missing)
        return None
    return runs(teacher, task, config).round(1).assign(**{"you said first": first}).fillna("")


def runs(teacher: Policy, task: Task, config: Config, seeds: range = range(3)) -> pd.DataFrame:
    """Return numbers of cells per seed, and their mean: one row for `config`, one for each of `CHANGES` alone."""
    changes = {"as it is": {}} | CHANGES
    cells = {
        name: [len(distill(teacher, task, replace(config, **change), seed=seed)[0]) for seed in seeds]
        for name, change in changes.items()
    }
    return pd.DataFrame(cells, index=[f"seed {seed}" for seed in seeds]).T.assign(mean=lambda t: t.mean(axis=1))
