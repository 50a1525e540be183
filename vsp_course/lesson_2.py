"""Checks of lesson 2: a plot of a run, running means, Algorithm 1, hyperparameters; and the runs shown there. The
checks of the two passes and of a sub-policy class have modules of their own."""

import contextlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

import vsp
from vsp import Config, History, Partition, Policy, Task, VoronoiPolicy, teacher_episodes
from vsp.algorithms import distill
from vsp.rollouts import Episode

from .feedback import Exercise, Mistake, NotYet, generators, tables
from .lesson_2_passes import MERGE, SMALL, SPLIT, merge_regions, split_regions, walk  # noqa: F401  checks, re-exported
from .lesson_2_policy_class import OWN_CLASS, my_policy_class  # noqa: F401

READING = Exercise("2.1", "reading")
RUNNING_MEAN = Exercise("2.2", "running_mean")
PREDICTION = Exercise("2.6", "prediction")
CHANGES = tables("cases.toml")["changes"]
PREDICTIONS = dict.fromkeys(CHANGES, ("more cells", "as many", "fewer cells"))
SEEDS = range(3)  # of the runs for each change


@READING.checks
def reading(answers: dict, history: History, config: Config) -> None:
    """2.1: answers `last change` (an iteration), `half of the cells`, `fewer cells by`, `loss jumps by`."""
    options = {key: question["options"] for key, question in tables("questions.toml")["2.1"].items()}
    READING.first(answers, {"last change": ()} | options)
    given, last = answers["last change"], max(event.iteration for event in history.events)
    number = isinstance(given, int | float | np.number) and np.isfinite(given)
    READING.refuse_if(not number, f"{given!r} for 'last change'", "a number")
    side = "the number of cells still changes after it" if given < last else "nothing changes there any more"
    side = "that is where the freeze begins" if given == config.n_epochs - config.n_freeze else side
    far = abs(given - last) > 0.04 * config.n_epochs
    READING.refuse_if(far, f"iteration {given:g}, but {side}", "the last step of the left curve", 1)
    READING.ask(answers, "the plot has told you what the algorithm does when.")


@RUNNING_MEAN.checks
def running_mean(function: Callable) -> None:
    """2.2: `running_mean(cells, losses)` returns, per step, the mean loss since its cell was entered. (T,)"""
    cases = [(np.array(visit["cells"]), np.array(visit["losses"])) for visit in tables("cases.toml")["visit"]]
    for rng, k in zip(generators(6), (3, 3, 3, 3, 9, 300)):  # of 300 cells, an episode enters few twice
        cells = np.repeat(rng.integers(k, size=3 + 2 * k), rng.integers(1, 20, size=3 + 2 * k))
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


ALGORITHM_1 = Exercise("2.5", "algorithm_1", (_algorithm_1,))


class _Log:
    """Stand-in for a partition and its passes that notes what is done with it, a list for each observed episode. It
    accepts only what a partition and vsp's passes would: itself, the episode, the settings and the generator given."""

    def __init__(self, config: Config, rng: np.random.Generator) -> None:
        self.config, self.state = config, rng.bit_generator.state
        self.codewords, self.episodes, self.rounds = np.zeros((0, 2)), [], [[]]
        self.rng: np.random.Generator | None = None
        self.strays: list[str] = []  # passes over, or with, something else

    def _did(self, what: str, right: bool) -> None:
        self.strays += [] if right else [what.split()[0]]
        self.rounds[-1].append(what)

    def _given(self, rng: np.random.Generator) -> bool:
        """Whether this is always the same generator, and not used by anybody else."""
        self.rng = self.rng or rng
        return rng is self.rng and rng.bit_generator.state == self.state

    def add(self, state: np.ndarray, rng: np.random.Generator) -> int:
        self.codewords = np.concatenate([self.codewords, state[None]])  # as a partition does
        self._did(f"add {state.tolist()}", self._given(rng))
        return len(self.codewords) - 1

    def observe(self, episode: Episode) -> None:
        self.episodes.append(episode)
        self.rounds.append([])

    def train(self, rng: np.random.Generator) -> float:
        self._did("train", self._given(rng))
        return 0.0

    def clear(self) -> None:
        self.rounds[-1] += ["clear"] if len(self.rounds) > 2 else []  # does no harm after the first episode

    def reset(self, _: object) -> None:
        self.clear()

    def policy(self) -> None:
        """To be returned at the end."""

    def split(self, partition: object, episode: Episode, config: Config, rng: np.random.Generator) -> list:
        last = partition is self and config == self.config and episode is self.episodes[-1]
        self._did("split", last and self._given(rng))
        return [episode.states[-1]]

    def merge(self, partition: object, config: Config) -> list:
        self._did("merge", partition is self and config == self.config)
        return []


@ALGORITHM_1.checks
def algorithm_1(function: Callable) -> None:
    """2.5: `algorithm_1(partition, episodes, config, rng, split, merge)` makes the right calls in the right order."""
    for rng, schedule in zip(generators(3), tables("cases.toml")["schedule"]):
        config = replace(SMALL, **schedule)
        log = _Log(config, rng)
        episodes = [walk([0.5 * n / config.n_epochs, 0.5], [n, 0]) for n in range(config.n_epochs)]
        ALGORITHM_1.call(function, log, list(episodes), config, rng, log.split, log.merge, keep=True, empty=True)
        _on_schedule(log, episodes, config, "the freeze begins at n_epochs - n_freeze")
        few, log = episodes[:-5], _Log(config, rng)  # the run may stop with an error when there are no more
        with contextlib.suppress(Exception):
            function(log, list(few), config, rng, log.split, log.merge)
        words = f"the freeze begins at n_epochs - n_freeze, however many episodes there are ({len(few)})"
        _on_schedule(log, few, config, words)
    ALGORITHM_1.passed("every pass comes when it is due, and none in the freeze.")


def _on_schedule(log: _Log, episodes: list[Episode], config: Config, freeze: str) -> None:
    """Compare what was done with what is right, iteration by iteration."""
    rng, observed = np.random.default_rng(0), log.episodes
    right = _Log(config, rng)
    _algorithm_1(right, episodes, config, rng, right.split, right.merge)
    expected = "the first state of the first episode, added before it is observed"
    ALGORITHM_1.refuse_if(not observed, "no episode observed", "one in every iteration", 1)
    ALGORITHM_1.refuse_if(log.rounds[0] != right.rounds[0], "another first codeword or none", expected, 1)
    seen, given = ([(one.states.tolist(), one.actions.tolist()) for one in each] for each in (observed, episodes))
    ALGORITHM_1.refuse_if(
        seen != given, f"{len(observed)} episodes observed", f"each of the {len(episodes)}, in order", 1
    )
    stray = f"`{log.strays[0]}` with something else" if log.strays else ""
    ALGORITHM_1.refuse_if(bool(stray), stray, "partition, settings and generator, and the episode just observed", 1)
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
    """Run the student's three functions and vsp's with the same random numbers, and return both policies. vsp's
    function replaces one that is still a stub; a printed line says which."""
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
