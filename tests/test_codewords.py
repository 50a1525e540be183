"""Codewords in every position, one, two, in a row, nearly equal, on a grid, in 1 to 8 dimensions; and in any order."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support import nearest_brute, nearest_kdtree

from vsp import Task, VoronoiPolicy
from vsp.geometry import METRICS, delaunay_neighbours, distances, lookup_neighbours


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


KINDS = {
    "one": lambda rng, d: rng.random((1, d)),
    "two": lambda rng, d: rng.random((2, d)),
    "scattered": lambda rng, d: rng.random((int(rng.integers(3, 16)), d)),
    "in a row": lambda rng, d: rng.random(d) + rng.permutation(7)[:, None] * rng.normal(size=d) / 7,
    "in a plane": lambda rng, d: rng.random((9, min(d, 2))) @ rng.normal(size=(min(d, 2), d)),
    "on a grid": lambda rng, d: rng.permutation([*itertools.islice(itertools.product((0, 0.5, 1), repeat=d), 27)]),
    "on a sphere": lambda rng, d: unit(rng.normal(size=(9, d))),
    "nearly equal": lambda rng, d: (
        np.repeat(rng.random((3, d)) + 0.5, 2, axis=0)
        + np.tile([[0.0], [1.0]], (3, 1)) * 10.0 ** -rng.integers(3, 16) * rng.uniform(0.5, 1, d)
    ),
    "far off": lambda rng, d: 1e6 + rng.random((6, d)),
    "tiny": lambda rng, d: 1e-9 * rng.random((6, d)),
}
NOT_ON_BORDERS = ["one", "two", "scattered", "in a row", "tiny"]
given_codewords = given(
    st.sampled_from(sorted(KINDS)), st.integers(1, 8), st.integers(0, 2**32), st.sampled_from(sorted(METRICS))
)


def codewords_of(kind, d, seed):
    """Such codewords (k, d), all different, and states (200, d) around them."""
    rng = np.random.default_rng(seed)
    codewords = np.unique(KINDS[kind](rng, d), axis=0)
    codewords = rng.permutation(codewords)
    low, high = codewords.min(axis=0), codewords.max(axis=0)
    room = np.maximum(0.2 * (high - low), 1e-3 * np.maximum(1e-6, np.abs(high).max()))
    return codewords, rng.uniform(low - room, high + room, (200, d))


def graphs(codewords, states, metric):
    """The graph of every kind of neighbours."""
    low, high = states.min(axis=0), states.max(axis=0)
    return {"delaunay": delaunay_neighbours(codewords), "lookup": lookup_neighbours(codewords, low, high, metric)}


def box(d):
    """A task of d inputs that nobody plays."""
    names = tuple(f"s{i}" for i in range(d))
    ends = {"low": np.full(d, -2e6), "high": np.full(d, 2e6), "action_low": -np.ones(1), "action_high": np.ones(1)}
    return Task("box", names, ("a",), names, **ends, max_steps=1, start=None, step=None)


def policy_of(codewords, metric="manhattan", *, seed=0):
    k, d = codewords.shape
    return VoronoiPolicy(codewords, np.random.default_rng(seed).normal(size=(k, d + 1, 1)), task=box(d), metric=metric)


# No position breaks anything


@given_codewords
def test_neighbours_are_symmetric_and_no_cell_is_its_own(kind, d, seed, metric):
    codewords, states = codewords_of(kind, d, seed)
    for name, graph in graphs(codewords, states, metric).items():
        assert graph.shape == (len(codewords),) * 2 and graph.dtype == bool
        assert np.array_equal(graph, graph.T) and not graph.diagonal().any()
        if name == "delaunay" and len(codewords) > 1:
            assert graph.any(axis=1).all(), "one without neighbours could never be merged"


@given_codewords
def test_both_look_ups_find_the_nearest_and_a_codeword_its_own_cell(kind, d, seed, metric):
    codewords, states = codewords_of(kind, d, seed)
    gaps = distances(states, codewords, metric)
    for lookup in (nearest_brute, nearest_kdtree):
        assert np.array_equal(lookup(codewords, states, metric), gaps.argmin(axis=1))
        assert np.array_equal(lookup(codewords, codewords, metric), np.arange(len(codewords)))


@given_codewords
def test_a_policy_acts_and_explains_itself_there(kind, d, seed, metric):
    codewords, states = codewords_of(kind, d, seed)
    policy = policy_of(codewords, metric)
    actions, _ = policy.predict(states)
    assert np.isfinite(actions).all() and np.array_equal(actions[0], policy.predict(states[0])[0])
    why = policy.explain(states[0])
    assert why.margin >= 0 and why.cell == policy.cells(states[0]) != why.next_cell
    assert len(policy.to_frame()) == len(codewords) and policy.to_c() and policy.to_python() and policy.to_text(None)


# The order of the codewords is a matter of labels


@given(st.sampled_from(NOT_ON_BORDERS), st.integers(1, 8), st.integers(0, 2**32), st.sampled_from(sorted(METRICS)))
def test_in_another_order_it_is_the_same_partition(kind, d, seed, metric):
    """But for what is on a border to the last bit: ties go to the lowest index, and Qhull cuts a square as it comes."""
    codewords, states = codewords_of(kind, d, seed)
    order = np.random.default_rng(seed).permutation(len(codewords))
    policy = policy_of(codewords, metric)
    reordered = VoronoiPolicy(codewords[order], policy.coefficients[order], task=policy.task, metric=metric)
    assert np.array_equal(order[reordered.cells(states)], policy.cells(states))
    assert np.array_equal(reordered.predict(states)[0], policy.predict(states)[0])
    expected = graphs(codewords, states, metric)
    for name, graph in graphs(codewords[order], states, metric).items():
        assert np.array_equal(graph, expected[name][np.ix_(order, order)]), name
