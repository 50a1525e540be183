import numpy as np
import pytest
from support import nearest_brute, nearest_kdtree

from vsp import nearest
from vsp.geometry import METRICS, all_differ, delaunay_neighbours, distances, lookup_neighbours
from vsp.show import grid

each_metric = pytest.mark.parametrize("metric", METRICS)


def edges(graph):
    return {(int(i), int(j)) for i, j in np.argwhere(graph) if i < j}


def is_graph(graph):
    return graph.dtype == bool and np.array_equal(graph, graph.T) and not graph.diagonal().any()


# Look-up


def test_distances_by_hand():
    states, codewords = np.array([[0.0, 0.0]]), np.array([[3.0, -4.0], [1.0, 0.0]])
    by_metric = {metric: distances(states, codewords, metric).tolist() for metric in METRICS}
    assert by_metric == {"manhattan": [[7, 1]], "euclidean": [[5, 1]], "chebyshev": [[4, 1]]}


@each_metric
def test_kdtree_equals_brute_force_on_grids(metric):
    """Codewords on a shuffled grid and states on a finer one: most states are between two or more codewords."""
    rng = np.random.default_rng(0)
    codewords = rng.permutation(np.stack(np.meshgrid(np.arange(24), np.arange(24)), -1).reshape(-1, 2)) / 3
    states = np.stack(np.meshgrid(np.arange(80), np.arange(80)), -1).reshape(-1, 2) / 12
    expected = nearest_brute(codewords, states, metric)
    for lookup in (nearest, nearest_kdtree):  # with so many codewords both use the tree
        assert np.array_equal(lookup(codewords, states, metric), expected)
    codewords = rng.random((60, 8))
    states = codewords[rng.integers(60, size=(4000, 2))].mean(axis=1)  # of some, rounding decides
    assert np.array_equal(nearest_kdtree(codewords, states, metric), nearest_brute(codewords, states, metric))


# Delaunay


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([[0.3, 0.3]], set()),
        ([[0, 0], [1, 1]], {(0, 1)}),
        ([[0, 0], [1, 0], [0, 1]], {(0, 1), (0, 2), (1, 2)}),
        ([[0, 0], [3, 0], [1, 0]], {(0, 2), (1, 2)}),  # in a row, out of order
        ([[0, 0], [0.1, 0.3], [0.2, 0.6], [0.3, 0.9]], {(0, 1), (1, 2), (2, 3)}),  # in a row up to rounding
        ([[0, 0], [4, 0], [2, 1], [2, -1]], {(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}),  # the short diagonal
        ([[0, 0], [2, 0], [0, 2], [2, 2], [1, 1]], {(0, 1), (0, 2), (1, 3), (2, 3), (0, 4), (1, 4), (2, 4), (3, 4)}),
        ([[0, 0], [4, 0], [2, 1e-5], [2, -1e-5]], {(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}),  # not quite in a row
        # Qhull leaves out what is far from the origin, or next to another point: its only neighbour then
        ([[1e8, 1e8], [1e8 + 2, 1e8], [1e8, 1e8 + 2], [1e8 + 2, 1e8 + 2], [1e8 + 1, 1e8 + 1]],
         {(0, 1), (0, 2), (1, 3), (2, 3), (0, 4), (1, 4), (2, 4), (3, 4)}),
        ([[0, 0], [2, 0], [0, 2], [2, 2], [1, 1], [1, 1 + 3e-16]],
         {(0, 1), (0, 2), (1, 3), (2, 3), (0, 4), (1, 4), (2, 4), (3, 4), (4, 5)}),
        ([[5], [1], [3]], {(0, 2), (1, 2)}),
        ([[0, 0, 1], [2, 0, 1], [0, 2, 1], [2, 2, 1], [1, 1, 1]],
         {(0, 1), (0, 2), (1, 3), (2, 3), (0, 4), (1, 4), (2, 4), (3, 4)}),  # in a plane of three dimensions
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], {(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}),
    ],
)  # fmt: skip
def test_delaunay_by_hand(points, expected):
    graph = delaunay_neighbours(np.array(points, dtype=float))
    assert is_graph(graph) and edges(graph) == expected


def test_all_differ():
    points = np.array([[0.25, 0.5], [0.5, 0.25], [0.25, 0.75]])
    assert all_differ(points) and all_differ(points[:1]) and all_differ(points[:0])
    assert not all_differ(points[[0, 1, 0]]) and not all_differ(np.array([[0.0, 1.0], [-0.0, 1.0]]))


# Look-up neighbours


@each_metric
def test_lookup_neighbours_against_a_dense_grid(metric):
    codewords = np.random.default_rng(4).random((13, 2))
    _, _, points = grid(np.zeros(2), np.ones(2), 201)
    pairs = np.sort(np.argsort(distances(points, codewords, metric), axis=1, kind="stable")[:, :2], axis=1)
    pairs, counts = np.unique(pairs, axis=0, return_counts=True)
    pairs = [tuple(map(int, pair)) for pair in pairs]
    graph = lookup_neighbours(codewords, np.zeros(2), np.ones(2), metric)
    assert is_graph(graph) and edges(graph) <= set(pairs)
    assert {pair for pair, count in zip(pairs, counts) if count > len(points) / 500} <= edges(graph)


def test_lookup_neighbours_by_hand():
    row = np.array([[0.1, 0.5], [0.5, 0.5], [0.9, 0.5]])
    assert edges(lookup_neighbours(row, np.zeros(2), np.ones(2))) == {(0, 1), (1, 2)}
    assert edges(lookup_neighbours(row[:2], np.zeros(2), np.ones(2))) == {(0, 1)}
    assert edges(lookup_neighbours(row[:1], np.zeros(2), np.ones(2))) == set()


def test_lookup_neighbours_repeat_and_follow_the_box():
    codewords = np.random.default_rng(5).random((20, 3))
    graph = lookup_neighbours(codewords, np.zeros(3), np.ones(3))
    assert np.array_equal(lookup_neighbours(codewords, np.zeros(3), np.ones(3)), graph)
    assert np.array_equal(lookup_neighbours(codewords * 4 - 2, np.full(3, -2.0), np.full(3, 2.0)), graph)
