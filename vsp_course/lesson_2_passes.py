"""Checks of lesson 2: the splitting and the merging pass, on small partitions whose answer is known.

Where the paper leaves a question open (see vsp/config.py) every reading counts as right, unless the lesson decides it.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsp import Partition, get_task, preset
from vsp.buffers import Buffers
from vsp.paper.readings import Readings
from vsp.rollouts import Episode

from .feedback import Exercise

MASKS = ((IndexError, "boolean", 5), (ValueError, "broadcast", 5))  # errors of a mask whose length is wrong
SPLIT = Exercise("2.3", "split_regions", ("split_regions", "vsp_split"), cures=((NameError, "", 1), *MASKS))
MERGE = Exercise("2.4", "merge_regions", ("merge_regions",), cures=((IndexError, "out of bounds", 2), *MASKS))

TASK = "SimpleGoal-v0"
# The settings of the cases below; new cells start at 0, so that random numbers do not matter
SMALL = replace(preset(TASK), max_pol_loss=0.25, min_pol_distance=0.2, min_param_distance=0.6, initial="zeros")


def on_a_line(places: list[float], maps: list) -> Partition:
    """A partition with codewords at x = `places`, y = 0.5, and one state in each buffer. Each of `maps` is a constant,
    or six coefficients."""
    partition = _with_codewords(np.column_stack([places, np.full(len(places), 0.5)]))
    for coefficients, values in zip(partition.models.coefficients, maps):
        coefficients[:] = np.reshape(values, (3, 2)) if np.ndim(values) else [[0, 0], [0, 0], [values, values]]
    return partition


def _with_codewords(codewords: np.ndarray) -> Partition:
    """A partition with one state in each buffer: the codeword."""
    partition = Partition(get_task(TASK), SMALL)
    for codeword in codewords:
        partition.add(codeword, np.random.default_rng(0))
    partition.observe(Episode(codewords.copy(), np.zeros_like(codewords)))
    return partition


def walk(places: list[float], actions: list[float]) -> Episode:
    """Return an episode along y = 0.5 whose two actions are equal: for a zero map, the loss is the action's square."""
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
    full: tuple[tuple[int, ...], ...] = ()  # numbers of states in the buffers that are right; empty: any


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
    SplitCase([0.05, 0.55, 0.75, 0.95], [1, 0, 0, 0], [0.27], [0], [0.27], "one state between two cells of a row", 1,
              ((0, 0, 1, 1, 0),)),
)
# fmt: on


@SPLIT.checks
def split_regions(function: Callable) -> None:
    """2.3: `split_regions(partition, episode, config, rng)` as Algorithm 2; returns the new codewords."""
    for case in SPLITS:
        partition, before, episode = on_a_line(case.places, case.biases), len(case.places), walk(case.way, case.actions)
        added = SPLIT.call(function, partition, episode, SMALL, np.random.default_rng(0), keep=True)
        new = partition.codewords[before:, 0]
        if len(new) != len(case.splits) or not np.allclose(new, case.splits):
            elsewhere = "a split elsewhere" if len(new) == len(case.splits) else _count(len(new), "split")
            raise SPLIT.wrong(elsewhere, f"{_count(len(case.splits), 'split')}, in a case of {case.what}", case.hint)
        _returned(SPLIT, added, partition.codewords[before:], "one for every new cell")
        expected = "those of the cell that was split and of its old neighbours emptied, no others"
        _emptied(SPLIT, partition.buffers, case.full, expected)
    for rng in map(np.random.default_rng, range(4)):  # vsp's pass on random walks, under both readings of R14
        partition = _with_codewords(rng.uniform(size=(4, 2)))
        partition.models.coefficients[:] = rng.normal(size=partition.models.coefficients.shape)
        states = np.clip(np.cumsum(rng.normal(scale=0.08, size=(60, 2)), axis=0) + 0.5, 0, 1)
        episode = Episode(states, rng.uniform(-1, 1, (60, 2)))
        split, *readings = (copy.deepcopy(partition) for _ in range(3))
        SPLIT.call(function, split, episode, SMALL, np.random.default_rng(0), keep=True)
        for reading, after in zip(readings, ("reset", "kept")):
            Readings(loss_after_split=after).split(reading, episode, SMALL, np.random.default_rng(0))
        if not any(np.array_equal(split.codewords, reading.codewords) for reading in readings):
            splits, right = (_count(len(p.codewords) - 4, "split") for p in (split, readings[0]))
            where = "where both conditions hold, by `partition.loss` and `partition.far`"
            raise SPLIT.wrong(f"{splits} on a random walk", f"{right}, {where}", 1)
    SPLIT.passed("codewords come where the mean loss is too high and no codeword is near.")


def _returned(exercise: Exercise, returned: object, right: np.ndarray, what: str) -> None:
    """Check that the codewords (n, d) that a pass returned are the right ones, in any order."""
    exercise.refuse_if(not hasattr(returned, "__len__"), f"{returned!r} as the result", "a list")
    exercise.refuse_if(len(returned) != len(right), f"{len(returned)} codewords returned", f"{what}, {len(right)}", 1)
    if len(right):
        meaning = "the codewords themselves, not their indices"
        values = exercise.array(returned, right.shape, "a list of codewords", 1, meaning)
        exercise.refuse_if(sorted(values.tolist()) != sorted(right.tolist()), "other codewords returned", what, 1)


def _emptied(exercise: Exercise, buffers: Buffers, full: tuple[tuple[int, ...], ...], expected: str) -> None:
    """Check the numbers of states in the buffers: one of `full`, or any if there are none."""
    counts = tuple(buffers.counts.tolist())
    wrong = len(full) > 0 and counts not in full
    exercise.refuse_if(wrong, f"buffers of {counts} states in a row of cells that had one each", expected, 5)


def _count(n: int, what: str) -> str:
    return f"{n or 'no'} {what}{'' if n == 1 else 's'}"


class MergeCase(NamedTuple):
    """Maps of cells in a row, the places that may remain after a pass, and the feedback if others do."""

    maps: list
    left: list[list[int]]
    what: str
    hint: int
    order: tuple[int, ...] = ()  # place of each cell in the row, if it is not its index
    full: tuple[tuple[int, ...], ...] = ()  # as in `SplitCase`


# fmt: off
MERGES = (
    MergeCase([0, 0], [[0], [1]], "two equal cells: one goes, one stays", 2),
    MergeCase([0, [0, 0, 0, 0, 0, 0.7]], [[0, 1]],
              "one coefficient that differs by more than the limit (its size counts, not its sign), others equal", 1),
    MergeCase([0, [0.59, -0.59, 0.59, 0.59, -0.59, 0.59]], [[0], [1]],
              "six coefficients that each differ by less than the limit", 1),
    MergeCase([0, [SMALL.min_param_distance, 0, 0, 0, 0, 0]], [[0, 1]],
              "a difference of exactly the limit: only less than the limit counts", 1),
    MergeCase([0, 5, 10], [[0, 1, 2]], "cells that are all different", 1),
    MergeCase([0, 0.1, 5], [[0, 2]], "two alike beside a third: the one whose turn comes first stays", 1),
    MergeCase([0, 5, 0, 5], [[0, 1, 2, 3]], "equal maps in cells that are not neighbours", 3),
    MergeCase([0, 0.5, 1.0], [[0, 2]], "a removed cell between two that are not alike: it removes no others", 2),
    MergeCase([5, 0, 0.1, 0.2, 9, 9.1], [[0, 1, 3, 4], [0, 3, 4], [0, 1, 4]],
              "three alike in the middle and two at the end: every cell that is left has its turn", 4),
    MergeCase([0, 0.1, 0.2], [[0]], "two cells alike on either side of the one whose turn it is: both go at once", 4,
              (1, 0, 2)),
    MergeCase([5, 0, 0.1, 10, 15], [[0, 1, 3, 4]], "two alike in a row of five", 1, (),
              ((0, 0, 1, 1), (0, 0, 0, 1))),
)
# fmt: on


@MERGE.checks
def merge_regions(function: Callable) -> None:
    """2.4: `merge_regions(partition, config)` as Algorithm 3; returns the removed codewords."""
    for case in MERGES:
        row = np.linspace(0.05, 0.95, len(case.maps))
        places = row[list(case.order or range(len(row)))].tolist()
        partition = on_a_line(places, case.maps)
        before = partition.codewords.copy()
        removed = MERGE.call(function, partition, SMALL, keep=True)
        kept = [i for i, x in enumerate(places) if np.isclose(partition.codewords[:, 0], x).any()]
        if kept not in case.left:
            left = f"cells {kept} left of a row of {len(places)} with biases or coefficients {case.maps}"
            raise MERGE.wrong(left, f"{' or '.join(map(str, case.left))}, in a case of {case.what}", case.hint)
        gone = [i for i in range(len(places)) if i not in kept]
        _returned(MERGE, removed, before[gone], "one for every cell that went")
        _emptied(MERGE, partition.buffers, case.full, "those of the survivor and of its neighbours emptied, no others")
    for rng in map(np.random.default_rng, range(9)):  # random maps, under each of the readings
        partition = _with_codewords(rng.uniform(size=(12, 2)))
        partition.models.coefficients[:] = rng.integers(3, size=(12, 1, 1)) + rng.uniform(0, 0.2, size=(12, 3, 2))
        merged = copy.deepcopy(partition)
        MERGE.call(function, merged, SMALL, keep=True)
        alive = (partition.codewords[:, None] == merged.codewords).all(axis=2).any(axis=1)
        readings = [_survivors(partition, anew, again) for anew, again in ((True, False), (False, False), (True, True))]
        if not any(np.array_equal(alive, survivors) for survivors in readings):
            left = f"cells {np.flatnonzero(alive).tolist()} left of {len(alive)} with random maps"
            expected = f"{np.flatnonzero(readings[0]).tolist()}: a turn removes all neighbours alike, of any index"
            raise MERGE.wrong(left, expected, 4)
        same = np.array_equal(merged.models.coefficients, partition.models.coefficients[alive])
        expected = "those that they had: nothing is averaged"
        MERGE.refuse_if(not same, "other maps in the cells that are left", expected, 1)
    MERGE.passed("similar neighbours have become one, and no other cell was removed.")


def _survivors(partition: Partition, anew: bool, again: bool) -> np.ndarray:
    """Return which cells a merging pass keeps (k,). Neighbours are computed once or, with `anew`, among the remaining
    cells. A turn removes the cell's similar neighbours once or, with `again`, also new neighbours."""
    coefficients, k = partition.comparable_coefficients(), len(partition.codewords)
    alive, graph = np.ones(k, dtype=bool), partition.neighbours()
    for i in range(k):
        alike = np.abs(coefficients - coefficients[i]).max(axis=1) < SMALL.min_param_distance
        for _ in range(k if again else 1):
            alive &= ~(alive[i] & graph[i] & alike)
            if anew:
                graph = np.zeros((k, k), dtype=bool)
                graph[np.ix_(alive, alive)] = partition.neighbours_of(partition.codewords[alive])
    return alive
