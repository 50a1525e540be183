"""Checks of lesson 2: a plot of a run, running means, the three algorithms, hyperparameters, a class of sub-policy.

Each check takes what the student wrote, tries it on partitions whose answer is known, and raises `NotYet` or prints one
line. Where the paper is silent (vsp/readings.py) every reading counts as right.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .. import geometry
from ..config import Config, preset
from ..distill import distill, teacher_episodes
from ..distill import split_regions as vsp_split
from ..envs import Task, get_task
from ..history import History
from ..partition import Partition
from ..rollouts import Episode, Policy
from ..subpolicies import FORMS, Form, SubPolicies, form_of
from .feedback import Exercise, Mistake

READING = Exercise("2.1", "reading")
RUNNING_MEAN = Exercise("2.2", "running_mean")
SPLIT = Exercise("2.3", "split_regions")
MERGE = Exercise("2.4", "merge_regions")
ALGORITHM_1 = Exercise("2.5", "algorithm_1")
PREDICTION = Exercise("2.6", "prediction")
FORM = Exercise("2.7", "my_form")

TASK = "SimpleGoal-v0"
# Small numbers, by which the cases below are worked out; new cells begin at 0, so that no random number has a say
SMALL = replace(preset(TASK), max_pol_loss=0.25, min_pol_distance=0.2, min_param_distance=0.6, initial="zeros")

MOMENTS = ("before iteration 500", "between 500 and 2000", "after 2000")
CAUSES = ("a split", "a merge", "a reset of the buffers", "a change of the teacher")
TREND = ("more cells", "as many", "fewer cells")
SAME = 0.12  # a change of the mean number of cells by less than this share counts as none
CHANGES = {
    "a lower distance": {"min_pol_distance": 0.15},
    "a higher loss": {"max_pol_loss": 1e-3},
    "easier merges": {"min_param_distance": 1.0},
    "exact maps": {"fit": "closed_form"},
}


def reading(answers: dict, history: History, config: Config) -> None:
    """2.1: answers `frozen from` (an iteration), `half of the cells`, `fewer cells by`, `loss jumps by`."""
    options = {"frozen from": float, "half of the cells": MOMENTS, "fewer cells by": CAUSES, "loss jumps by": CAUSES}
    READING.answers(answers, options)
    begin, last = config.n_epochs - config.n_freeze, max((e.iteration for e in history.events), default=0)
    if not min(last, begin) - 0.04 * config.n_epochs <= answers["frozen from"] <= begin + 0.04 * config.n_epochs:
        side = (
            "the number of cells still changes after it"
            if answers["frozen from"] < last
            else "the partition stands still before it"
        )
        raise READING.wrong(f"iteration {answers['frozen from']:g}, but {side}", "where the shading begins", 1)
    cells = np.array(history.cells)
    early = int(np.argmax(cells >= cells[-1] / 2))
    READING.choice(answers, "half of the cells", MOMENTS[int(np.digitize(early, [500, 2000]))], {}, 1)
    teaching = {
        "a split": "a split adds a codeword",
        "a reset of the buffers": "a reset empties buffers and leaves codewords where they are",
        "a change of the teacher": "the teacher is the same all the time",
    }
    READING.sealed(answers, "fewer cells by", "fb8f27a3b939a5dc", teaching, 2)
    teaching |= {
        "a split": "look again",
        "a merge": "a merge keeps a map that is trained already",
        "a reset of the buffers": "an empty buffer alters no map, and it fills up again with the next episode",
    }
    READING.sealed(answers, "loss jumps by", "71c02946198a22ee", teaching, 3)
    READING.passed("the plot has told you what the algorithm does when.")


def running_mean(function: Callable) -> None:
    """2.2: `running_mean(cells, losses)` returns, per step, the mean loss since its cell was entered. (T,)"""
    cases = [
        (np.array([4, 4, 4]), np.array([1.0, 0.0, 2.0])),
        (np.array([0, 0, 1, 1, 0, 0]), np.array([1.0, 3, 5, 1, 4, 0])),
    ]
    for seed in range(4):
        rng = np.random.default_rng(seed)
        cases.append((np.repeat(rng.integers(3, size=8), rng.integers(1, 5, size=8)), np.zeros(0)))
        cases[-1] = (cases[-1][0], rng.uniform(size=len(cases[-1][0])))
    for cells, losses in cases:
        right = _since(cells, losses)
        value = RUNNING_MEAN.array(RUNNING_MEAN.call(function, cells, losses), losses.shape, hint=1)
        counts = np.arange(1, len(losses) + 1)
        by_cell = [losses[: t + 1][cells[: t + 1] == cells[t]].mean() for t in range(len(losses))]
        entered = np.concatenate([[True], cells[1:] != cells[:-1]]).cumsum()
        whole = [losses[entered == entered[t]].mean() for t in range(len(losses))]
        sums = right * (counts - np.array([np.argmax(entered == e) for e in entered]))
        mistakes = [
            Mistake(losses.cumsum() / counts, "the mean since the episode began", "it since the cell was entered", 2),
            Mistake(by_cell, "losses of an earlier visit to the cell", "a new beginning at every entrance", 2),
            Mistake(whole, "losses of later steps", "only those up to the step", 1),
            Mistake(sums, "sums", "means", 1),
            Mistake(losses, "the losses themselves", "their mean since the cell was entered", 1),
        ]
        step = int(np.argmin(np.isclose(value, right)))
        otherwise = Mistake(
            None,
            f"another number at step {step} of cells {cells.tolist()[:8]}...",
            "the mean since that cell was entered",
            1,
        )
        RUNNING_MEAN.compare(value, right, mistakes, otherwise)
    RUNNING_MEAN.passed("it forgets whenever the episode enters another cell.")


def _since(cells: np.ndarray, losses: np.ndarray) -> np.ndarray:
    means, begin = np.zeros(len(losses)), 0
    for t in range(len(losses)):
        begin = t if t and cells[t] != cells[t - 1] else begin
        means[t] = losses[begin : t + 1].mean()
    return means


def on_a_line(places: list[float], biases: list[float], config: Config = SMALL) -> Partition:
    """A partition with codewords at x = `places`, y = 0.5, constant maps and one state in each buffer."""
    partition = Partition(get_task(TASK), config)
    for x in places:
        partition.add(np.array([x, 0.5]), np.random.default_rng(0))
    partition.models.parameters[:, -1] = np.asarray(biases, dtype=float)[:, None]
    partition.observe(Episode(partition.codewords.copy(), np.zeros((len(places), 2))))
    return partition


def walk(places: list[float], actions: list[float]) -> Episode:
    """An episode along y = 0.5 with the same number for both actions: for a map that says 0, the loss is its square."""
    places, actions = np.array(places), np.array(actions)
    return Episode(np.column_stack([places, np.full(len(places), 0.5)]), np.column_stack([actions, actions]))


@dataclass(frozen=True)
class SplitCase:
    """A partition and an episode, where a pass has to split, and what it means if it does not."""

    places: list[float]
    biases: list[float]
    way: list[float]
    actions: list[float]
    splits: list[float]
    what: str
    hint: int


SPLITS = (
    SplitCase([0.1], [1], [0.15, 0.25, 0.4, 0.45], [0, 0, 0, 0], [0.4], "mean loss 1 and one state far enough away", 1),
    SplitCase([0.1], [0], [0.4, 0.5, 0.6], [0, 0, 0], [], "a copy without any error", 1),
    SplitCase(
        [0.1],
        [1],
        [0.12, 0.15, 0.2, 0.25],
        [0, 0, 0, 0],
        [],
        "a bad map but no state far from its codeword: both conditions must hold",
        1,
    ),
    SplitCase(
        [0.1],
        [0],
        [0.4, 0.45, 0.5],
        [0, 0, 0.6],
        [],
        "one bad state after good ones: the mean counts, not the last loss",
        2,
    ),
    SplitCase(
        [0.1],
        [0],
        [0.15, 0.2, 0.4],
        [1, 1, 0],
        [0.4],
        "good at the end but bad on the way: the mean counts, not the last loss",
        2,
    ),
    SplitCase(
        [0.1, 0.9],
        [0, 0],
        [0.15, 0.2, 0.6, 0.65],
        [1, 1, 0.1, 0.1],
        [],
        "bad in one cell, good in the next: the mean begins anew in another cell",
        3,
    ),
    SplitCase(
        [0.1, 0.9],
        [0, 0],
        [0.15, 0.2, 0.95, 0.4],
        [1, 1, 0, 0],
        [],
        "back in a cell that was left: the mean begins anew there too",
        3,
    ),
    SplitCase(
        [0.1],
        [1],
        [0.4, 0.45, 0.5],
        [0, 0, 0],
        [0.4],
        "states next to a codeword that came a moment ago: they are in its cell now",
        4,
    ),
    SplitCase(
        [0.1], [1], [0.35, 0.12, 0.95], [0, 0, 1], [0.35, 0.95], "two places in one episode: go on after a split", 4
    ),
)


def split_regions(function: Callable) -> None:
    """2.3: `split_regions(partition, episode, config, rng)` as Algorithm 2; returns the new codewords."""
    for case in SPLITS:
        partition = on_a_line(case.places, case.biases)
        before = len(partition.codewords)
        added = SPLIT.call(
            function, partition, walk(case.way, case.actions), SMALL, np.random.default_rng(0), keep=True
        )
        new = partition.codewords[before:, 0]
        if not _same(new, case.splits):
            raise SPLIT.wrong(
                _count(len(new), "split"), f"{_count(len(case.splits), 'split')}, in a case of {case.what}", case.hint
            )
        if len(added) != len(new):
            raise SPLIT.wrong(f"{len(added)} codewords returned", f"the {len(new)} new ones of the partition", 1)
    _emptied(function)
    for seed in range(4):
        _like_ours(function, seed)
    SPLIT.passed("codewords come where the mean loss is too high and no codeword is near.")


def _same(found: np.ndarray, right: list[float]) -> bool:
    return len(found) == len(right) and np.allclose(found, right)


def _count(n: int, what: str) -> str:
    return f"{n or 'no'} {what}{'' if n == 1 else 's'}"


def _emptied(function: Callable) -> None:
    """Whether the buffers of the split cell and of its neighbours are empty, and no others."""
    partition = on_a_line([0.05, 0.55, 0.75, 0.95], [1, 0, 0, 0])
    SPLIT.call(function, partition, walk([0.27], [0]), SMALL, np.random.default_rng(0), keep=True)
    left = partition.buffers.counts.tolist()
    if left != [0, 0, 1, 1, 0]:
        words = {
            (1, 1, 1, 1, 0): "full buffers beside a new cell",
            (0, 0, 0, 0, 0): "all buffers empty after a split",
            (1, 0, 1, 1, 0): "a full buffer in the cell that was split, which has just lost states",
            (0, 1, 1, 1, 0): "full buffers in the neighbours of the cell that was split",
        }
        found = words.get(tuple(left), f"buffers of {left} states in a case of four cells in a row")
        raise SPLIT.wrong(found, "those of the cell that was split and of its old neighbours emptied, no others", 5)


def _like_ours(function: Callable, seed: int) -> None:
    """A random partition and episode: the same codewords as ours, under one of the readings of R14."""
    rng = np.random.default_rng(seed)
    task = get_task(TASK)
    partition = Partition(task, SMALL)
    for codeword in rng.uniform(size=(4, 2)):
        partition.add(codeword, rng)
    partition.models.parameters[:] = rng.normal(size=partition.models.parameters.shape)
    states = np.clip(np.cumsum(rng.normal(scale=0.08, size=(60, 2)), axis=0) + 0.5, 0, 1)
    partition.observe(Episode(partition.codewords.copy(), np.zeros((4, 2))))
    episode = Episode(states, rng.uniform(-1, 1, (60, 2)))
    own = copy.deepcopy(partition)
    SPLIT.call(function, own, episode, SMALL, np.random.default_rng(0), keep=True)
    ways = []
    for after in ("reset", "kept"):
        other = copy.deepcopy(partition)
        vsp_split(other, episode, replace(SMALL, loss_after_split=after), np.random.default_rng(0))
        ways.append(other.codewords)
    if not any(own.codewords.shape == way.shape and np.allclose(own.codewords, way) for way in ways):
        raise SPLIT.wrong(
            _count(len(own.codewords) - 4, "split"),
            f"{_count(len(ways[0]) - 4, 'split')}, at certain states, on a random walk",
            1,
        )


@dataclass(frozen=True)
class MergeCase:
    """Biases of cells in a row, which places may be left after a pass, and what it means if others are."""

    biases: list[float]
    left: list[list[int]]
    what: str
    hint: int


MERGES = (
    MergeCase([0, 5, 10], [[0, 1, 2]], "cells that are all different", 1),
    MergeCase([0, 0.1, 5], [[0, 2]], "two alike beside a third: the one whose turn comes first stays", 1),
    MergeCase([0, 0], [[0]], "two equal cells: one of them must stay", 2),
    MergeCase([0, 5, 0, 5], [[0, 1, 2, 3]], "equal maps in cells that are not neighbours", 3),
    MergeCase([0, 0.5, 1.0], [[0, 2]], "a removed cell between two that are not alike: what is gone removes no one", 2),
    MergeCase([5, 0, 0.1, 0.2, 9], [[0, 1, 3, 4], [0, 3, 4], [0, 1, 4]], "three alike in the middle", 4),
)


def merge_regions(function: Callable) -> None:
    """2.4: `merge_regions(partition, config)` as Algorithm 3; returns the codewords that went."""
    for case in MERGES:
        places = np.linspace(0.05, 0.95, len(case.biases)).tolist()
        partition = on_a_line(places, case.biases)
        removed = MERGE.call(function, partition, SMALL, keep=True)
        kept = [round((x - 0.05) / 0.9 * (len(places) - 1)) for x in partition.codewords[:, 0]]
        if kept not in case.left:
            expected = f"{' or '.join(sorted({str(len(left)) for left in case.left}))} left, in a case of {case.what}"
            raise MERGE.wrong(f"{len(kept)} of {len(places)} cells left{_which(kept, case)}", expected, case.hint)
        if len(removed) != len(places) - len(kept):
            raise MERGE.wrong(f"{len(removed)} codewords returned", f"the {len(places) - len(kept)} that went", 1)
    _measured(function)
    _emptied_by_merge(function)
    for seed in range(4):
        _properties(function, seed)
    MERGE.passed("neighbours that agree have become one, and nobody else is gone.")


def _which(kept: list[int], case: MergeCase) -> str:
    return ", but not the right ones" if len(kept) in {len(left) for left in case.left} else ""


def _measured(function: Callable) -> None:
    """Whether parameters are compared by their largest difference."""
    cases = (
        (
            [0.0, 0.0, 0.7, 0.0, 0.0, 0.0],
            2,
            "one parameter that differs by more than the limit while the others are equal",
        ),
        ([0.5, -0.5, 0.5, 0.5, -0.5, 0.5], 1, "six parameters that each differ by less than the limit"),
        (
            [-0.9, 0.0, 0.0, 0.0, 0.0, 0.0],
            2,
            "a parameter that is lower by more than the limit: sizes count, not signs",
        ),
    )
    for difference, left, what in cases:
        partition = on_a_line([0.2, 0.8], [0, 0])
        partition.models.parameters[1] = np.reshape(difference, (3, 2))
        MERGE.call(function, partition, SMALL, keep=True)
        if len(partition.codewords) != left:
            raise MERGE.wrong(f"{_count(len(partition.codewords), 'cell')} left", f"{left}, in a case of {what}", 1)


def _emptied_by_merge(function: Callable) -> None:
    partition = on_a_line([0.05, 0.2, 0.5, 0.7, 0.95], [0, 0.1, 5, 10, 15])
    MERGE.call(function, partition, SMALL, keep=True)
    counts = partition.buffers.counts.tolist()
    if counts not in ([0, 1, 1, 1], [0, 0, 1, 1]):
        words = {(1, 1, 1, 1): "the survivor's buffer as it was", (0, 0, 0, 0): "all buffers emptied"}
        found = words.get(tuple(counts), f"buffers of {counts} states in a case of five cells in a row")
        raise MERGE.wrong(found, "those of the survivor and of its neighbours emptied, no others", 5)


def _properties(function: Callable, seed: int) -> None:
    """On a random partition: whoever went had a twin, and of neighbours that were alike one went at least."""
    rng = np.random.default_rng(seed)
    partition = Partition(get_task(TASK), SMALL)
    for codeword in rng.uniform(size=(12, 2)):
        partition.add(codeword, rng)
    partition.models.parameters[:] = rng.integers(3, size=(12, 1, 1)) + rng.uniform(0, 0.2, size=(12, 3, 2))
    partition.observe(Episode(partition.codewords.copy(), np.zeros((12, 2))))
    before, graph, own = partition.codewords.copy(), partition.neighbours(), copy.deepcopy(partition)
    parameters = partition.comparable_parameters()
    MERGE.call(function, own, SMALL, keep=True)
    alive = (before[:, None] == own.codewords).all(axis=2).any(axis=1)
    alike = np.abs(parameters[:, None] - parameters).max(axis=2) < SMALL.min_param_distance
    alike &= ~np.eye(len(before), dtype=bool)
    if not alike[~alive].any(axis=1).all() or alive.sum() != len(own.codewords):
        raise MERGE.wrong("a cell gone, or altered, that was like no other", "only cells removed that have a twin", 1)
    if (graph & alike)[np.ix_(alive, alive)].any():
        raise MERGE.wrong("two neighbours with like maps, both still there", "one of them removed, in every pair", 4)
    same = own.models.parameters.shape == (alive.sum(), 3, 2) and np.allclose(
        own.models.parameters, partition.models.parameters[alive]
    )
    if not same:
        raise MERGE.wrong("other maps in the cells that are left", "those that they had: nothing is averaged", 1)


class _Witness:
    """Stands in for a partition and writes down what is done with it."""

    def __init__(self) -> None:
        self.codewords, self.done = np.zeros((0, 2)), []

    def add(self, state: np.ndarray, rng: object = None) -> int:
        self.codewords = np.vstack([self.codewords, state])
        self.done.append("add")
        return len(self.codewords) - 1

    def observe(self, episode: Episode) -> None:
        self.done.append(episode)

    def train(self, rng: object = None) -> float:
        self.done.append("train")
        return 0.0

    def clear(self) -> None:
        self.done.append("clear")


def algorithm_1(function: Callable) -> None:
    """2.5: `algorithm_1(partition, episodes, config, rng, split, merge)`: who is called when."""
    schedules = ((40, 4, 10, 8, 15), (30, 3, 5, 6, 9), (50, 7, 7, 11, 50))
    for n_epochs, n_split, n_merge, n_freeze, n_reset in schedules:
        rule = replace(SMALL, n_epochs=n_epochs, n_split=n_split, n_merge=n_merge, n_freeze=n_freeze, n_reset=n_reset)
        _on_schedule(function, rule)
    ALGORITHM_1.passed("every pass comes when it is due, and none in the freeze.")


def _on_schedule(function: Callable, config: Config) -> None:
    episodes = [walk([0.5 * n / config.n_epochs, 0.5], [0, 0]) for n in range(config.n_epochs)]
    partition = _Witness()

    def note(what: str) -> Callable:
        return lambda *_: partition.done.append(what) or []

    ALGORITHM_1.call(
        lambda *given: function(*given) or True,
        partition,
        list(episodes),
        config,
        np.random.default_rng(0),
        note("split"),
        note("merge"),
        keep=True,
    )
    if not any(isinstance(done, Episode) for done in partition.done):
        raise ALGORITHM_1.wrong("no episode observed", "one in every iteration", 1)
    if "add" not in partition.done or not np.array_equal(partition.codewords[0], episodes[0].states[0]):
        raise ALGORITHM_1.wrong(
            "another first codeword or none", "the first state of the first episode, added before it is observed", 1
        )
    rounds = _rounds(partition.done)
    if len(rounds) != config.n_epochs or any(r[0] is not e for r, e in zip(rounds, episodes)):
        raise ALGORITHM_1.wrong(f"{len(rounds)} episodes observed", f"each of the {config.n_epochs}, in their order", 1)
    if "add" in [done for r in rounds for done in r]:
        raise ALGORITHM_1.wrong("codewords added in the loop", "the first one only: the rest is up to `split`", 1)
    for n, done in enumerate(rounds):
        _one_round(n, done[1:], config)


def _rounds(done: list) -> list[list]:
    """What was done, cut where an episode was observed; what came before the first is left out."""
    cuts = [i for i, what in enumerate(done) if isinstance(what, Episode)]
    return [done[a:b] for a, b in zip(cuts, [*cuts[1:], len(done)])]


def _one_round(n: int, done: list[str], config: Config) -> None:
    frozen = config.n_epochs - config.n_freeze
    if done[:1] != ["train"] or done.count("train") != 1:
        raise ALGORITHM_1.wrong(
            f"{done or 'nothing'} in iteration {n} after its episode was observed", "one training step first", 1
        )
    for what, every in (("split", config.n_split), ("merge", config.n_merge), ("clear", config.n_reset)):
        due = n > 0 and n % every == 0 and (what == "clear" or n < frozen)
        if (what in done) != due and not (n == 0 and what == "clear"):
            period = {"split": "n_split", "merge": "n_merge", "clear": "n_reset"}[what]
            if due:
                raise ALGORITHM_1.wrong(f"no `{what}` in iteration {n}", f"one every {period} = {every} iterations", 2)
            why = f"the freeze begins at {frozen}" if n >= frozen and n % every == 0 else "it is not due then"
            why = "a map that was trained once tells nothing yet" if n == 0 else why
            raise ALGORITHM_1.wrong(f"`{what}` in iteration {n}", f"none: {why}", 3 if n >= frozen else 2)
    passes = [what for what in done if what in ("split", "merge")]
    if passes == ["merge", "split"]:
        raise ALGORITHM_1.wrong("a merge before a split in one iteration", "splits first, as the paper prints it", 2)


def prediction(answers: dict, teacher: Policy, task: Task, config: Config, seeds: range = range(3)) -> None:
    """2.6: for each of `CHANGES`, whether there will be more cells, as many, or fewer."""
    PREDICTION.answers(answers, dict.fromkeys(CHANGES, TREND))
    usual = _cells(teacher, task, config, seeds)
    wrong = []
    for name, change in CHANGES.items():
        ratio = _cells(teacher, task, replace(config, **change), seeds) / usual
        near = [TREND[i] for i in {int(np.digitize(-ratio, [-1 - s, -1 + s])) for s in (SAME / 2, 2 * SAME)}]
        wrong += [name] if answers[name] not in near else []
    if wrong:
        raise PREDICTION.wrong(
            f"that the runs disagree with you on {wrong}",
            "a prediction that the cell below bears out: run it, and find out why",
            1,
        )
    PREDICTION.passed("the runs did what you said.")


def _cells(teacher: Policy, task: Task, config: Config, seeds: range) -> float:
    """Mean number of cells over `seeds`."""
    return float(np.mean([len(distill(teacher, task, config, seed=seed)[0]) for seed in seeds]))


def my_form(function: Callable, teacher: Policy, task: Task) -> None:
    """2.7: `my_form(task)` returns a `Form` that is new, consistent, has a right gradient, and beats a constant."""
    form = FORM.call(function, task)
    if not isinstance(form, Form):
        raise FORM.wrong(f"a {type(form).__name__}", "a Form", 1)
    states = np.random.default_rng(0).uniform(task.low, task.high, size=(50, len(task.low)))
    features = _features(form, states)
    known = [name for name in FORMS if name != "pid" or task.signals]
    for name in known:
        if _alike(features, form_of(name, task).features(states)) and type(form) in (Form, type(form_of(name, task))):
            raise FORM.wrong(f"the features of {name!r}", "a class that is not there yet", 1)
    _code(form, states, features)
    _gradient(form, features, len(task.outputs))
    constant, own = _errors(form_of("constant", task), teacher, task), _errors(form, teacher, task)
    if own > 0.97 * constant:
        raise FORM.wrong(f"{own / constant:.0%} of the error that constants have in the same cells", "clearly less", 4)
    FORM.passed(
        f"{len(form.rows)} parameters per action, {own / constant:.0%} of the error of constants in the same cells."
    )


def _features(form: Form, states: np.ndarray) -> np.ndarray:
    (n, _), q = states.shape, len(form.terms)
    features = FORM.array(FORM.call(form.features, states), (n, q), "features of 50 states", 2)
    if not np.allclose(
        FORM.array(FORM.call(form.features, states[0]), (q,), "features of a single state", 2), features[0]
    ):
        raise FORM.wrong("other features for a single state than for the same one in a batch", "the same", 2)
    FORM.array(FORM.call(form.features, states.reshape(5, 10, -1)), (5, 10, q), "features of 5 x 10 states", 2)
    sizes = FORM.array(form.sizes, (q,), "sizes", 2)
    if (sizes <= 0).any() or len(form.code) != q:
        raise FORM.wrong(f"{len(form.code)} pieces of code and sizes {sizes}", f"{q} of both, sizes above 0", 2)
    return features


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two sets of features and a constant span the same functions."""
    ranks = [np.linalg.matrix_rank(np.column_stack([*parts, np.ones(len(a))])) for parts in ((a,), (b,), (a, b))]
    return ranks[0] == ranks[1] == ranks[2]


def _code(form: Form, states: np.ndarray, features: np.ndarray) -> None:
    """Whether the code says what the features are."""
    names = {
        name: getattr(math, name)
        for name in ("sin", "cos", "tan", "atan2", "exp", "log", "sqrt", "tanh", "hypot", "pi")
    }
    names |= {"abs": abs, "fabs": abs, "min": min, "max": max, "fmin": min, "fmax": max}
    for j, text in enumerate(form.code):
        try:
            values = [float(eval(text, {"__builtins__": {}}, {**names, "state": state})) for state in states]
        except Exception as error:
            raise FORM.wrong(
                f"{type(error).__name__} ({error}) in the code {text!r}", "an expression of state[0], state[1], ...", 3
            ) from None
        if not np.allclose(values, features[:, j]):
            raise FORM.wrong(f"code {text!r} that gives other numbers than feature {form.terms[j]!r}", "the same", 3)


def _gradient(form: Form, features: np.ndarray, m: int) -> None:
    """Whether the gradient of the loss by the parameters agrees with finite differences."""
    rng = np.random.default_rng(1)
    inputs = np.column_stack([features, np.ones(len(features))])[None]
    theta, actions = rng.normal(size=(1, len(form.rows), m)), rng.normal(size=(1, len(features), m))

    def loss(parameters: np.ndarray) -> float:
        return float(np.square(form.batch(inputs, parameters)[0] - actions).sum())

    outputs, pull_back = form.batch(inputs, theta)
    if not np.allclose(outputs[0], form.outputs(features, theta[0])):
        raise FORM.wrong("other outputs in training (`batch`) than in use (`outputs`)", "the same", 3)
    own = pull_back(2 * (outputs - actions))
    for index in np.ndindex(theta.shape):
        step = np.zeros_like(theta)
        step[index] = 1e-6 * max(1.0, abs(theta[index]))
        slope = (loss(theta + step) - loss(theta - step)) / (2 * step[index])
        if not np.isclose(own[index], slope, rtol=1e-3, atol=1e-3):
            raise FORM.wrong(
                f"a gradient of {own[index]:.4g} by parameter {index[1]}", "the slope that finite differences have", 3
            )


def _errors(form: Form, teacher: Policy, task: Task) -> float:
    """Mean squared error after training, in the cells of eight codewords, on fresh states of the teacher."""
    rng = np.random.default_rng(7)
    seen, fresh = (list(teacher_episodes(teacher, task, 300, rng)) for _ in range(2))
    states, actions = (np.concatenate([getattr(e, part) for e in seen]) for part in ("states", "actions"))
    partition = Partition(task, replace(SMALL, batch_size=128))
    partition.models = SubPolicies(form, len(task.outputs), initial="uniform")
    partition.buffers = type(partition.buffers)(len(form.terms), len(task.outputs))
    for codeword in states[rng.choice(len(states), 8, replace=False)]:
        partition.add(codeword, rng)
    partition.observe(Episode(states, actions))
    cells = np.flatnonzero(partition.buffers.counts)
    for rate in (0.05,) * 400 + (0.01,) * 400:
        inputs, goals = partition.buffers.sample(cells, 128, rng)
        partition.models.train(cells, inputs, goals, learning_rate=rate)
    states, actions = (np.concatenate([getattr(e, part) for e in fresh]) for part in ("states", "actions"))
    own = partition.models.parameters[geometry.nearest(partition.codewords, states)]
    return float(np.square(form.outputs(form.features(states), own) - actions).mean())
