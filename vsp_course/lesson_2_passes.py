"""Checks of lesson 2: the splitting and the merging pass, on small partitions whose answer is known.

Where the paper leaves a question open (see vsp/config.py) every reading counts as right, unless the lesson decides it.
"""

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import vsp
from vsp import Config, Partition, get_task, preset
from vsp.buffers import Buffers
from vsp.paper.readings import Readings
from vsp.rollouts import Episode

from .feedback import Exercise, generators, tables

MASKS = ((IndexError, "boolean", 5), (ValueError, "broadcast", 5))  # errors of a mask whose length is wrong
SPLIT = Exercise("2.3", "split_regions", (vsp.split_regions, Readings.split), cures=((NameError, "", 1), *MASKS))
INDICES = (IndexError, "out of bounds", 2)
MERGE = Exercise("2.4", "merge_regions", (vsp.merge_regions, Readings.merge), cures=(INDICES, *MASKS))

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


def _with_codewords(codewords: np.ndarray, config: Config = SMALL) -> Partition:
    """A partition with one state in each buffer: the codeword."""
    partition = Partition(get_task(TASK), config)
    for codeword in codewords:
        partition.add(codeword, np.random.default_rng(0))
    partition.observe(Episode(codewords.copy(), np.zeros_like(codewords)))
    return partition


def walk(places: list[float], actions: list[float]) -> Episode:
    """Return an episode along y = 0.5 whose two actions are equal: for a zero map, the loss is the action's square."""
    return Episode(np.column_stack([places, np.full(len(places), 0.5)]), np.column_stack([actions, actions]))


@SPLIT.checks
def split_regions(function: Callable) -> None:
    """2.3: `split_regions(partition, episode, config, rng)` as Algorithm 2; returns the new codewords."""
    for case in (SimpleNamespace(**about) for about in tables("cases.toml")["split"]):
        partition, before, episode = on_a_line(case.places, case.biases), len(case.places), walk(case.way, case.actions)
        added = SPLIT.call(function, partition, episode, SMALL, np.random.default_rng(0), keep=True)
        new = partition.codewords[before:, 0]
        if len(new) != len(case.splits) or not np.allclose(new, case.splits):
            elsewhere = "a split elsewhere" if len(new) == len(case.splits) else _count(len(new), "split")
            raise SPLIT.wrong(elsewhere, f"{_count(len(case.splits), 'split')}, in a case of {case.what}", case.hint)
        _returned(SPLIT, added, partition.codewords[before:], "one for every new cell")
        expected = "those of the cell that was split and of its old neighbours emptied, no others"
        _emptied(SPLIT, partition.buffers, case.full, expected)
    for rng in generators(8):  # vsp's pass on random walks, under both readings of R14
        loss, distance = rng.uniform([0.1, 0.05], [1.5, 0.3])
        config = replace(SMALL, max_pol_loss=loss, min_pol_distance=distance, initial="uniform")
        partition = _with_codewords(rng.uniform(size=(rng.integers(3, 9), 2)), config)
        partition.models.coefficients[:] = rng.normal(size=partition.models.coefficients.shape)
        states = np.clip(np.cumsum(rng.normal(scale=0.08, size=(60, 2)), axis=0) + 0.5, 0, 1)
        episode = Episode(states, rng.uniform(-1, 1, (60, 2)))
        split, *readings = (copy.deepcopy(partition) for _ in range(3))
        added = SPLIT.call(function, split, episode, config, np.random.default_rng(0), keep=True)
        for reading, after in zip(readings, ("reset", "kept")):
            Readings(loss_after_split=after).split(reading, episode, config, np.random.default_rng(0))
        same = [one for one in readings if np.array_equal(split.codewords, one.codewords)]
        if not same:
            splits, right = (_count(len(p.codewords) - len(partition.codewords), "split") for p in (split, readings[0]))
            where = "where both conditions hold, by `partition.loss` and `partition.far`"
            raise SPLIT.wrong(f"{splits} on a random walk", f"{right}, {where}", 1)
        _returned(SPLIT, added, split.codewords[len(partition.codewords) :], "one for every new cell")
        _emptied(SPLIT, split.buffers, [one.buffers.counts.tolist() for one in same], expected)
        maps = [one.models.coefficients.tolist() for one in same]
        as_drawn = split.models.coefficients.tolist() in maps
        SPLIT.refuse_if(not as_drawn, "other maps in the cells", "those of before, and new ones drawn by `rng`", 5)
    SPLIT.passed("codewords come where the mean loss is too high and no codeword is near.")


def _returned(exercise: Exercise, returned: object, right: np.ndarray, what: str) -> None:
    """Check that the codewords (n, d) that a pass returned are the right ones, in any order."""
    exercise.refuse_if(not hasattr(returned, "__len__"), f"{returned!r} as the result", "a list")
    exercise.refuse_if(len(returned) != len(right), f"{len(returned)} codewords returned", f"{what}, {len(right)}", 1)
    if len(right):
        meaning = "the codewords themselves, not their indices"
        values = exercise.array(returned, right.shape, "a list of codewords", 1, meaning)
        exercise.refuse_if(sorted(values.tolist()) != sorted(right.tolist()), "other codewords returned", what, 1)


def _emptied(exercise: Exercise, buffers: Buffers, full: Sequence[list[int]], expected: str) -> None:
    """Check the numbers of states in the buffers: one of `full`, or any if there are none."""
    counts = buffers.counts.tolist()
    wrong = len(full) > 0 and counts not in full
    exercise.refuse_if(wrong, f"buffers of {tuple(counts)} states in a row of cells that had one each", expected, 5)


def _count(n: int, what: str) -> str:
    return f"{n or 'no'} {what}{'' if n == 1 else 's'}"


@MERGE.checks
def merge_regions(function: Callable) -> None:
    """2.4: `merge_regions(partition, config)` as Algorithm 3; returns the removed codewords."""
    for case in (SimpleNamespace(**about) for about in tables("cases.toml")["merge"]):
        row = np.linspace(0.05, 0.95, len(case.maps))
        places = row[case.order or range(len(row))].tolist()
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
    for rng in generators(16):  # random maps, under each of the readings
        config = replace(SMALL, min_param_distance=rng.choice([0.2, 0.6, 2.0]))
        partition = _with_codewords(rng.uniform(size=(12, 2)), config)
        apart = rng.integers(rng.choice([3, 99]), size=(12, 1, 1)) + rng.uniform(0, 0.2, size=(12, 3, 2))
        partition.models.coefficients[:] = apart * config.min_param_distance / 0.6
        merged = copy.deepcopy(partition)
        removed = MERGE.call(function, merged, config, keep=True)
        alive = (partition.codewords[:, None] == merged.codewords).all(axis=2).any(axis=1)
        readings = [_survivors(partition, anew, again) for anew, again in ((True, False), (False, False), (True, True))]
        pairs = [emptied for survivors, emptied in readings if np.array_equal(alive, survivors)]
        if not pairs:
            left = f"cells {np.flatnonzero(alive).tolist()} left of {len(alive)} with random maps"
            expected = f"{np.flatnonzero(readings[0][0]).tolist()}: a turn removes all neighbours alike, of any index"
            raise MERGE.wrong(left, expected, 4)
        _returned(MERGE, removed, partition.codewords[~alive], "one for every cell that went")
        full = [(~emptied[alive]).astype(int).tolist() for pair in pairs for emptied in pair]
        _emptied(MERGE, merged.buffers, full, "those of each survivor and of its neighbours emptied, no others")
        same = np.array_equal(merged.models.coefficients, partition.models.coefficients[alive])
        MERGE.refuse_if(not same, "other maps in the cells left", "those that they had: nothing is averaged", 1)
    MERGE.passed("similar neighbours have become one, and no other cell was removed.")


def _survivors(partition: Partition, anew: bool, again: bool) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return which cells a merging pass keeps (k,), and which it empties if a survivor's neighbours are those before
    the merge, and those after it. Neighbours are computed once or, with `anew`, among the remaining cells. A turn
    removes the cell's similar neighbours once or, with `again`, also new neighbours."""
    coefficients, k = partition.comparable_coefficients(), len(partition.codewords)
    alive, graph, (before, after) = np.ones(k, dtype=bool), partition.neighbours(), np.zeros((2, k), dtype=bool)
    for i in range(k):
        alike = np.abs(coefficients - coefficients[i]).max(axis=1) < partition.config.min_param_distance
        for _ in range(k if again else 1):
            gone = alive[i] & graph[i] & alike & alive
            before |= gone.any() & (graph[i] | (np.arange(k) == i))
            alive &= ~gone
            if anew:
                graph = np.zeros((k, k), dtype=bool)
                graph[np.ix_(alive, alive)] = partition.neighbours_of(partition.codewords[alive])
            after |= gone.any() & (graph[i] | (np.arange(k) == i))
    return alive, (before, after)
