"""The readings that are passes of their own: by hand, and beside the passes of `vsp.algorithms`."""

import copy
import dataclasses

import numpy as np
import pytest
from support import partition_of, same_arrays, tiny, walk

from vsp.algorithms import merge_regions, split_regions
from vsp.paper.readings import Readings
from vsp.rollouts import Episode

ROW = [[0.125, 0.5], [0.5, 0.5], [0.875, 0.5]]  # three cells in a row: each touches the next


def split(readings, partition, episode):
    return [tuple(c) for c, _ in readings.split(partition, episode, partition.config, np.random.default_rng(5))]


@pytest.mark.parametrize(
    ("readings", "states", "actions", "splits"),
    [
        ({"split_lookup": "kept"}, [[0.5, 0.5], [0.55, 0.5]], [1, 1], 2),  # the second lies beside the first
        ({"split_lookup": "kept"}, [[0.5, 0.5]] * 3, [1, 1, 1], 1),  # no state becomes a codeword twice
        ({"loss_after_split": "kept"}, [[0.1, 0.5], [0.4, 0.5], [0.0, 0.75]], [0, 0.4, 0], 2),  # the old cell again
    ],
)
def test_readings_decide_how_often_a_cell_splits(readings, states, actions, splits):
    config = tiny(max_pol_loss=0.05, min_pol_distance=0.2, initial="zeros")
    assert len(split(Readings(**readings), partition_of([[0, 0.5]], config=config), walk(states, actions))) == splits


@pytest.mark.parametrize(
    ("reset", "neighbours", "expected"),
    [
        ("cell_and_neighbours", "old", [0, 0, 0, 0]),  # the middle cell, both its neighbours, the new cell
        ("neighbours", "old", [0, 1, 0, 0]),  # not the cell that was split
        ("cell_and_neighbours", "new", [1, 0, 0, 0]),  # the new cell touches the middle and the right one
        ("neighbours", "new", [1, 0, 0, 0]),
    ],
)
def test_split_reset_and_split_neighbours_choose_the_buffers(reset, neighbours, expected):
    partition = partition_of(ROW, config=tiny(max_pol_loss=0.01, min_pol_distance=0.1))
    partition.neighbours()[:] = False  # whoever asks may do so: it is a copy
    readings = Readings(split_reset=reset, split_neighbours=neighbours)
    assert split(readings, partition, walk([[0.625, 0.5]], [1])) == [(0.625, 0.5)]
    assert partition.buffers.counts.tolist() == expected


def test_a_merge_may_leave_the_buffer_of_the_survivor():
    partition = partition_of(ROW[:2], [0, 0.1])
    Readings(merge_reset="neighbours").merge(partition, partition.config)
    assert partition.buffers.counts.tolist() == [1]


def test_a_removed_cell_may_remove_those_that_come_later():
    partition = partition_of(ROW, [0, 0.2, 0.4], config=tiny(min_param_distance=0.3))
    assert len(Readings(merge_visits_removed=True).merge(partition, partition.config)) == 2
    assert partition.codewords.tolist() == ROW[:1]


def test_two_equal_cells_do_not_remove_each_other():
    partition = partition_of(np.random.default_rng(2).random((9, 2)))
    assert len(Readings(merge_visits_removed=True).merge(partition, partition.config)) == 8


@pytest.mark.parametrize("seed", range(30))
def test_by_default_they_are_the_passes_of_the_algorithms(seed):
    """Two routes to one result, on random partitions and walks."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(2, 12))
    config = tiny(max_pol_loss=0.4, min_pol_distance=0.1, min_param_distance=1.2, one_split=seed % 5 == 0)
    partition = partition_of(rng.random((k, 2)), config=config)
    partition.models.coefficients[:] = rng.normal(scale=0.6, size=partition.models.coefficients.shape)
    states = np.clip(np.cumsum(rng.normal(scale=0.08, size=(60, 2)), axis=0) + 0.5, 0, 1)
    episode, other = Episode(states, rng.uniform(-1, 1, (60, 2))), copy.deepcopy(partition)
    splits = split_regions(partition, episode, config, np.random.default_rng(1))
    assert repr(splits) == repr(Readings().split(other, episode, config, np.random.default_rng(1)))
    assert repr(merge_regions(partition, config)) == repr(Readings().merge(other, config))
    pairs = [(one.codewords, one.models.coefficients, one.buffers.counts) for one in (partition, other)]
    assert same_arrays(*zip(*pairs))


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Readings)])
def test_no_other_word_is_taken(name):
    with pytest.raises(ValueError, match=f"{name} is 'typo', expected"):
        Readings(**{name: "typo"})
