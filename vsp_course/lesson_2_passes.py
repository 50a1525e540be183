"""Checks of lesson 2: the splitting and the merging pass, on small partitions whose answer is known.

Where the paper leaves a question open (see vsp/config.py) every reading counts as right, unless the lesson decides it.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsp.config import Config, paper_preset
from vsp.paper.readings import Readings
from vsp.partition import Partition
from vsp.rollouts import Episode
from vsp.tasks import get_task

from .feedback import Exercise, NotYet

SPLIT = Exercise("2.3", "split_regions", ("vsp.algorithms.split_regions",))
MERGE = Exercise("2.4", "merge_regions", ("vsp.algorithms.merge_regions",))

TASK = "SimpleGoal-v0"
# The settings of the cases below; new cells start at 0, so that random numbers do not matter
SMALL = replace(paper_preset(TASK), max_pol_loss=0.25, min_pol_distance=0.2, min_param_distance=0.6, initial="zeros")
# Errors of students' code and the hint that helps: exercise, type, words of the message, hint
CURES = (
    (SPLIT, NameError, "", 1),
    (SPLIT, IndexError, "boolean", 5),
    (SPLIT, ValueError, "broadcast", 5),
    (MERGE, IndexError, "boolean", 5),
    (MERGE, ValueError, "broadcast", 5),
    (MERGE, IndexError, "out of bounds", 2),
    (MERGE, RuntimeError, "come to an end", 2),
)


def _call(exercise: Exercise, function: Callable, *given: object) -> object:
    """Call the student's pass and return its result. For an error, the feedback points to the hint that helps."""
    try:
        return exercise.call(function, *given, keep=True)
    except NotYet as refusal:
        error = refusal.__context__
        for owner, kind, words, hint in CURES:
            if owner is exercise and isinstance(error, kind) and words in str(error):
                raise NotYet(f"{refusal} → Hint {hint} of exercise {exercise.number}") from None
        raise


def on_a_line(places: list[float], biases: list[float], config: Config = SMALL) -> Partition:
    """A partition with codewords at x = `places`, y = 0.5, constant maps and one state in each buffer."""
    partition = Partition(get_task(TASK), config)
    for x in places:
        partition.add(np.array([x, 0.5]), np.random.default_rng(0))
    partition.models.parameters[:, -1] = np.asarray(biases, dtype=float)[:, None]
    return _with_states(partition)


def _random_partition(rng: np.random.Generator, k: int) -> Partition:
    partition = Partition(get_task(TASK), SMALL)
    for codeword in rng.uniform(size=(k, 2)):
        partition.add(codeword, rng)
    return _with_states(partition)


def _with_states(partition: Partition) -> Partition:
    """The same partition, with one state in each buffer: the codeword."""
    partition.observe(Episode(partition.codewords.copy(), np.zeros_like(partition.codewords)))
    return partition


def _patient(partition: Partition) -> Partition:
    """Return the same partition; it raises RuntimeError in a loop that never ends."""
    for name in ("neighbours", "comparable_parameters"):
        turns, asked = iter(range(500)), getattr(partition, name)

        def ask(*given, turns=turns, asked=asked):
            if next(turns, None) is None:
                raise RuntimeError("still not done after 500 turns: does your loop come to an end?")
            return asked(*given)

        setattr(partition, name, ask)
    return partition


def walk(places: list[float], actions: list[float]) -> Episode:
    """Return an episode along y = 0.5 whose two actions are equal: for a zero map, the loss is the action's square."""
    places, actions = np.array(places), np.array(actions)
    return Episode(np.column_stack([places, np.full(len(places), 0.5)]), np.column_stack([actions, actions]))


class SplitCase(NamedTuple):
    """A partition, an episode, the expected splits, and the feedback if they differ."""

    places: list[float]
    biases: list[float]
    way: list[float]
    actions: list[float]
    splits: list[float]
    what: str
    hint: int


# fmt: off
SPLITS = (
    SplitCase([0.1], [1], [0.12, 0.15, 0.2, 0.25], [0, 0, 0, 0], [],
              "a bad map but no state far from its codeword: both conditions must hold", 1),
    SplitCase([0.1], [0], [0.4, 0.5, 0.6], [0, 0, 0], [], "a policy without any error", 1),
    SplitCase([0.1], [1], [0.15, 0.25, 0.4], [0, 0, 0], [0.4], "mean loss 1 and one state that is far enough", 1),
    SplitCase([0.1], [0], [0.4, 0.45, 0.5], [0.4, 0.4, 0.4], [],
              "many small losses in one cell: their mean counts, not their sum", 2),
    SplitCase([0.1], [0], [0.15, 0.4, 0.45], [0.7, 0, 0], [],
              "a bad state first and good ones after it: the mean counts, not the largest loss", 2),
    SplitCase([0.1], [0], [0.4, 0.45, 0.5], [0, 0, 0.7], [],
              "one bad state after good ones in its cell: all losses since it was entered count, not the last one", 3),
    SplitCase([0.1], [0], [0.15, 0.2, 0.22, 0.25, 0.4], [1, 1, 0, 0, 0], [0.4],
              "good at the end but bad on the way: the mean of all losses in the cell counts, not the last ones", 2),
    SplitCase([0.1, 0.9], [1, 0], [0.6, 0.65], [0, 0], [],
              "a good map in the state's own cell, a bad one in another: ask for the loss of its own", 1),
    SplitCase([0.1, 0.9], [0, 1], [0.85, 0.95], [0, 0], [],
              "states near the codeword of their own cell, far from another: its own counts", 1),
    SplitCase([0.1, 0.9], [0, 0], [0.15, 0.2, 0.6, 0.65], [1, 1, 0.1, 0.1], [],
              "bad in one cell, good in the next: the mean begins anew in another cell", 3),
    SplitCase([0.1, 0.9], [0, 0], [0.15, 0.2, 0.95, 0.4], [1, 1, 0, 0], [],
              "back in a cell that was left: the mean begins anew there too", 3),
    SplitCase([0.1], [1], [0.4, 0.45, 0.5], [0, 0, 0], [0.4],
              "states next to a codeword that came a moment ago: they are in its cell now", 4),
    SplitCase([0.1], [1], [0.35, 0.12, 0.95], [0, 0, 1], [0.35, 0.95],
              "two places in one episode: go on after a split", 4),
    SplitCase([0.1], [0], [0.4], [0.5], [], "a mean loss exactly at the limit: only more than the limit counts", 1),
)
# fmt: on


@SPLIT.checks
def split_regions(function: Callable) -> None:
    """2.3: `split_regions(partition, episode, config, rng)` as Algorithm 2; returns the new codewords."""
    for case in SPLITS:
        partition = on_a_line(case.places, case.biases)
        before = len(partition.codewords)
        added = _call(SPLIT, function, partition, walk(case.way, case.actions), SMALL, np.random.default_rng(0))
        new = partition.codewords[before:, 0]
        if len(new) != len(case.splits) or not np.allclose(new, case.splits):
            found = "a split elsewhere" if len(new) == len(case.splits) else _count(len(new), "split")
            raise SPLIT.wrong(found, f"{_count(len(case.splits), 'split')}, in a case of {case.what}", case.hint)
        _told(SPLIT, added, partition.codewords[before:], "one for every new cell")
    _emptied(function)
    for seed in range(4):
        _like_ours(function, seed)
    SPLIT.passed("codewords come where the mean loss is too high and no codeword is near.")


def _told(exercise: Exercise, returned: object, right: np.ndarray, what: str) -> None:
    """Whether the codewords (n, d) that a pass returned are the right ones, in any order."""
    exercise.refuse_if(not hasattr(returned, "__len__"), f"{returned!r} as the result", "a list")
    exercise.refuse_if(len(returned) != len(right), f"{len(returned)} codewords returned", f"{what}, {len(right)}", 1)
    if len(right):
        meaning = "the codewords themselves, not their indices"
        values = exercise.array(returned, right.shape, "a list of codewords", 1, meaning)
        exercise.refuse_if(sorted(values.tolist()) != sorted(right.tolist()), "other codewords returned", what, 1)


def _count(n: int, what: str) -> str:
    return f"{n or 'no'} {what}{'' if n == 1 else 's'}"


def _emptied(function: Callable) -> None:
    """Whether the buffers of the split cell and of its neighbours are empty, and no others."""
    partition = on_a_line([0.05, 0.55, 0.75, 0.95], [1, 0, 0, 0])
    _call(SPLIT, function, partition, walk([0.27], [0]), SMALL, np.random.default_rng(0))
    words = {
        (0, 0, 1, 1, 0): "",
        (1, 1, 1, 1, 0): "full buffers beside a new cell",
        (0, 0, 0, 0, 0): "all buffers empty after a split",
        (1, 0, 1, 1, 0): "a full buffer in the cell that was split, which has just lost states",
        (0, 1, 1, 1, 0): "full buffers in the neighbours of the cell that was split",
    }
    _full(SPLIT, partition, words, "those of the cell that was split and of its old neighbours emptied, no others")


def _full(exercise: Exercise, partition: Partition, words: dict[tuple, str], expected: str) -> None:
    """Check which buffers are full. `words` maps the numbers of states per buffer to the feedback, "" if right."""
    counts = tuple(partition.buffers.counts.tolist())
    found = words.get(counts, f"buffers of {counts} states in a case of cells in a row")
    exercise.refuse_if(found != "", found, expected, 5)


def _like_ours(function: Callable, seed: int) -> None:
    """Compare with vsp's pass on a random partition and episode, under both readings of R14."""
    rng = np.random.default_rng(seed)
    partition = _random_partition(rng, 4)
    partition.models.parameters[:] = rng.normal(size=partition.models.parameters.shape)
    states = np.clip(np.cumsum(rng.normal(scale=0.08, size=(60, 2)), axis=0) + 0.5, 0, 1)
    episode = Episode(states, rng.uniform(-1, 1, (60, 2)))
    own = copy.deepcopy(partition)
    _call(SPLIT, function, own, episode, SMALL, np.random.default_rng(0))
    ways = []
    for after in ("reset", "kept"):
        other = copy.deepcopy(partition)
        Readings(loss_after_split=after).split(other, episode, SMALL, np.random.default_rng(0))
        ways.append(other.codewords)
    if not any(own.codewords.shape == way.shape and np.allclose(own.codewords, way) for way in ways):
        found, right = (_count(len(codewords) - 4, "split") for codewords in (own.codewords, ways[0]))
        where = "where both conditions hold, by `partition.loss` and `partition.far`"
        raise SPLIT.wrong(f"{found} on a random walk", f"{right}, {where}", 1)


class MergeCase(NamedTuple):
    """Biases of cells in a row, the places that may remain after a pass, and the feedback if others do."""

    biases: list[float]
    left: list[list[int]]
    what: str
    hint: int
    order: tuple[int, ...] = ()  # place of each cell in the row, if it is not its index


# fmt: off
MERGES = (
    MergeCase([0, 0], [[0], [1]], "two equal cells: one goes, one stays", 2),
    MergeCase([0, 5, 10], [[0, 1, 2]], "cells that are all different", 1),
    MergeCase([0, 0.1, 5], [[0, 2]], "two alike beside a third: the one whose turn comes first stays", 1),
    MergeCase([0, 5, 0, 5], [[0, 1, 2, 3]], "equal maps in cells that are not neighbours", 3),
    MergeCase([0, 0.5, 1.0], [[0, 2]], "a removed cell between two that are not alike: it removes no others", 2),
    MergeCase([5, 0, 0.1, 0.2, 9, 9.1], [[0, 1, 3, 4], [0, 3, 4], [0, 1, 4]],
              "three alike in the middle and two at the end: every cell that is left has its turn", 4),
    MergeCase([0, 0.1, 0.2], [[0]], "two cells alike on either side of the one whose turn it is: both go at once", 4,
              (1, 0, 2)),
)
# fmt: on


@MERGE.checks
def merge_regions(function: Callable) -> None:
    """2.4: `merge_regions(partition, config)` as Algorithm 3; returns the removed codewords."""
    _in_a_row(function, MERGES[0])
    _measured(function)
    for case in MERGES[1:]:
        _in_a_row(function, case)
    _emptied_by_merge(function)
    for seed in range(9):
        _properties(function, seed)
    MERGE.passed("similar neighbours have become one, and no other cell was removed.")


def _in_a_row(function: Callable, case: MergeCase) -> None:
    row = np.linspace(0.05, 0.95, len(case.biases))
    places = row[list(case.order or range(len(row)))].tolist()
    partition = on_a_line(places, case.biases)
    before = partition.codewords.copy()
    removed = _call(MERGE, function, _patient(partition), SMALL)
    kept = [i for i, x in enumerate(places) if np.isclose(partition.codewords[:, 0], x).any()]
    if kept not in case.left:
        found = f"cells {kept} left of a row of {len(places)} with biases {case.biases}"
        raise MERGE.wrong(found, f"{' or '.join(map(str, case.left))}, in a case of {case.what}", case.hint)
    gone = [i for i in range(len(places)) if i not in kept]
    _told(MERGE, removed, before[gone], "one for every cell that went")


def _measured(function: Callable) -> None:
    """Whether parameters are compared by their largest difference."""
    single = "one parameter that differs by more than the limit (its size counts, not its sign), the others equal"
    many = "six parameters that each differ by less than the limit"
    exact = "a difference of exactly the limit: only less than the limit counts"
    cases = (
        ([0, 0, 0.7, 0, 0, 0], 2, single),
        ([0.5, -0.5, 0.5, 0.5, -0.5, 0.5], 1, many),
        ([SMALL.min_param_distance, 0, 0, 0, 0, 0], 2, exact),
    )
    for difference, left, what in cases:
        partition = on_a_line([0.2, 0.8], [0, 0])
        partition.models.parameters[1] = np.reshape(difference, (3, 2))
        _call(MERGE, function, _patient(partition), SMALL)
        found = len(partition.codewords)
        MERGE.refuse_if(found != left, f"{_count(found, 'cell')} left", f"{left}, in a case of {what}", 1)


def _emptied_by_merge(function: Callable) -> None:
    partition = on_a_line([0.05, 0.2, 0.5, 0.7, 0.95], [5, 0, 0.1, 10, 15])
    _call(MERGE, function, _patient(partition), SMALL)
    words = {
        (0, 0, 1, 1): "",
        (0, 0, 0, 1): "",
        (1, 1, 1, 1): "all buffers as they were",
        (0, 0, 0, 0): "all buffers emptied",
        (1, 0, 1, 1): "a full buffer beside the cell that is gone",
        (0, 1, 1, 1): "the survivor's buffer as it was",
    }
    _full(MERGE, partition, words, "those of the survivor and of its neighbours emptied, no others")


def _properties(function: Callable, seed: int) -> None:
    """On a random partition: every removed cell had a similar neighbour, of two similar neighbours at least one is
    removed, and the remaining cells are those of one of the readings."""
    rng = np.random.default_rng(seed)
    partition = _random_partition(rng, 12)
    partition.models.parameters[:] = rng.integers(3, size=(12, 1, 1)) + rng.uniform(0, 0.2, size=(12, 3, 2))
    before, graph, own = partition.codewords.copy(), partition.neighbours(), copy.deepcopy(partition)
    parameters = partition.comparable_parameters()
    _call(MERGE, function, _patient(own), SMALL)
    alive = (before[:, None] == own.codewords).all(axis=2).any(axis=1)
    alike = np.abs(parameters[:, None] - parameters).max(axis=2) < SMALL.min_param_distance
    alike &= ~np.eye(len(before), dtype=bool)
    if not alike[~alive].any(axis=1).all() or alive.sum() != len(own.codewords):
        raise MERGE.wrong("a cell gone, or altered, that was like no other", "only cells removed that have a twin", 1)
    if (graph & alike)[np.ix_(alive, alive)].any():
        raise MERGE.wrong("two neighbours with like maps, both still there", "one of them removed, in every pair", 4)
    readings = [_survivors(partition, anew, again) for anew, again in ((True, False), (False, False), (True, True))]
    if not any(np.array_equal(alive, survivors) for survivors in readings):
        found = f"cells {np.flatnonzero(alive).tolist()} left of {len(alive)} with random maps"
        expected = f"{np.flatnonzero(readings[0]).tolist()}: a turn removes all neighbours alike, of any index"
        raise MERGE.wrong(found, expected, 4)
    found, right = own.models.parameters, partition.models.parameters[alive]
    same = found.shape == right.shape and np.allclose(found, right)
    MERGE.refuse_if(not same, "other maps in the cells that are left", "those that they had: nothing is averaged", 1)


def _survivors(partition: Partition, anew: bool, again: bool) -> np.ndarray:
    """Return which cells a merging pass keeps (k,). Neighbours are computed once or, with `anew`, among the remaining
    cells. A turn removes the cell's similar neighbours once or, with `again`, also new neighbours."""
    parameters, k = partition.comparable_parameters(), len(partition.codewords)
    alive, graph = np.ones(k, dtype=bool), partition.neighbours()
    for i in range(k):
        alike = np.abs(parameters - parameters[i]).max(axis=1) < SMALL.min_param_distance
        for _ in range(k if again else 1):
            alive &= ~(alive[i] & graph[i] & alike)
            if anew:
                graph = np.zeros((k, k), dtype=bool)
                graph[np.ix_(alive, alive)] = partition.neighbours_of(partition.codewords[alive])
    return alive
