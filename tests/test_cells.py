"""Cells of a tree, by hand and against brute force; cells of codewords are in test_codewords.py."""

import numpy as np
import pytest
from support import SIMPLEGOAL, nearest_brute, nearest_kdtree

from vsp import Halfspaces, Metric, Nearest, PiecewisePolicy

# x > 0.5 is cell 1; left of it, y > 0.3 is cell 2, else cell 0
HAND = Halfspaces([[1.0, 0.0], [0.0, 2.0]], [0.5, 0.6], [[1, -2], [-1, -3]])
ONE = Halfspaces(np.zeros((0, 2)), [], np.zeros((0, 2)))


def test_a_tree_by_hand():
    states = np.array([[0.9, 0.9], [0.5, 0.3], [0.2, 0.31], [0.51, 0.0]])
    assert HAND.locate(states).tolist() == [1, 0, 2, 1] and len(HAND) == 3
    assert HAND.place(2, ("x", "y"), 1) == "where 1.0 x + 0.0 y <= 0.5 and 0.0 x + 2.0 y > 0.6"
    assert HAND.latex(1, ("x", "y"), None) == "$1 x > 0.5$"
    near = {0: ([0.4, 0.1], 1, 0.1), 1: ([0.6, 0.2], 0, 0.1), 2: ([0.45, 0.4], 1, 0.05)}
    for cell, (state, other, far) in near.items():
        assert HAND.border(np.array(state), cell) == (other, pytest.approx(far))
    assert HAND.border(np.array([0.5, 0.1]), 0) == (1, 0)  # on the hyperplane
    module: dict = {}
    exec("\n".join(HAND.python()), module)
    assert [module["locate"](state) for state in states.tolist()] == [1, 0, 2, 1]


def test_one_cell_has_no_border():
    assert ONE.locate(np.zeros((4, 2))).tolist() == [0] * 4 and ONE.border(np.zeros(2), 0) == (None, np.inf)
    assert Nearest([[0.0, 0.0]]).border(np.zeros(2), 0) == (None, np.inf)


@pytest.mark.parametrize(
    ("normals", "children"),
    [
        ([[1, 0], [0, 1]], [[1, -2], [-1, -2]]), ([[1, 0], [0, 1]], [[-1, -2], [-3, 1]]), ([[0, 0]], [[-1, -2]]),
        ([[1, 0]], [[0, -1]]), ([[1, 0]], [[-1, -3]]),
    ],
    ids=["a cell twice", "a node of its own", "no hyperplane", "a circle", "a cell too many"],
)  # fmt: skip
def test_what_is_no_tree_is_refused(normals, children):
    with pytest.raises(ValueError, match="expected"):
        Halfspaces(normals, np.zeros(len(normals)), children)


def test_the_way_to_the_border_of_random_trees():
    """Half as far nothing changes in any direction, and a little farther the other cell is there."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        k = rng.integers(2, 7)
        normals, open_ends, children = rng.normal(size=(k - 1, 3)), [], np.zeros((k - 1, 2), dtype=int)
        for node in range(k - 1):
            if open_ends:
                children[open_ends.pop(rng.integers(len(open_ends)))] = node
            open_ends += [(node, 0), (node, 1)]
        for cell, end in enumerate(open_ends):
            children[end] = -1 - cell
        tree = Halfspaces(normals, rng.normal(size=k - 1), children)
        for state in rng.normal(size=(5, 3)):
            cell = tree.locate(state[None])[0]
            other, far = tree.border(state, cell)
            ways = rng.normal(size=(200, 3))
            ways /= np.linalg.norm(ways, axis=1, keepdims=True)
            assert (tree.locate(state + 0.999 * far * ways) == cell).all() and other != cell
            assert other in tree.locate(state + 1.5 * far * np.concatenate([ways, normals, -normals]))


def test_a_metric_is_an_order_or_a_function():
    rng = np.random.default_rng(0)
    codewords, states = rng.normal(size=(60, 2)), rng.normal(size=(500, 2))
    for order in (1.5, 3):
        gaps = (np.abs(states[:, None] - codewords) ** order).sum(axis=2) ** (1 / order)
        metric = Metric("mine", order)
        assert np.allclose(metric.distances(states, codewords), gaps)
        found = (search(codewords, states, metric) for search in (nearest_brute, nearest_kdtree))
        assert all(np.array_equal(one, gaps.argmin(axis=1)) for one in found)
    for wrong in ({}, {"order": 2, "between": max}, {"order": -1.0}, {"order": 0.5}):
        with pytest.raises(ValueError, match="metric 'mine'"):
            Metric("mine", **wrong)
    where = Nearest([[0, 0], [1, 1]], Metric("mine", between=max))
    policy = PiecewisePolicy(where, np.zeros((2, 3, 2)), task=SIMPLEGOAL)
    for export in (policy.to_c, policy.to_python):
        with pytest.raises(ValueError, match="metric 'mine' has no code"):
            export()


def test_cells_and_maps_must_fit():
    for where, maps in ((HAND, np.zeros((2, 3, 2))), (Nearest([[0.0]]), np.zeros((1, 3, 2)))):
        with pytest.raises(ValueError, match="expected|SimpleGoal-v0 has 2"):
            PiecewisePolicy(where, maps, task=SIMPLEGOAL)
    tree = PiecewisePolicy(HAND, np.ones((3, 3, 2)), task=SIMPLEGOAL)
    assert tree.with_maps(np.zeros((3, 3, 2))).predict([[0.1, 0.1]])[0].tolist() == [[0, 0]] and "cells" in repr(tree)
    assert tree.to_frame().columns.tolist()[0] == "dx_x" and tree.explain([0.4, 0.1]).codeword is None
