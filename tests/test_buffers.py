import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsp.buffers import Buffers


def rows_of(buffers, cell):
    """What a cell holds, in order: (state, action) pairs."""
    numbers = buffers._table[cell, : buffers.counts[cell]]
    return [(buffers._inputs[i, 0], buffers._actions[i, 0]) for i in numbers]


def filled(*cells):
    buffers, numbers = Buffers(1, 1), np.arange(len(cells), dtype=float)[:, None]
    for _ in range(max(cells) + 1):
        buffers.add()
    buffers.append(np.array(cells), numbers, -numbers)
    return buffers


def test_rows_land_in_the_buffer_of_their_cell_in_order():
    buffers = filled(1, 0, 1, 2, 1)
    assert buffers.counts.tolist() == [1, 3, 1]
    assert [rows_of(buffers, i) for i in range(3)] == [[(1, -1)], [(0, 0), (2, -2), (4, -4)], [(3, -3)]]
    buffers.append(np.array([0, 1]), np.array([[8.0], [9.0]]), np.zeros((2, 1)))
    assert rows_of(buffers, 0) == [(1, -1), (8, 0)] and rows_of(buffers, 1)[-1] == (9, 0)


OPERATIONS = st.one_of(
    st.tuples(st.just("append"), st.lists(st.integers(0, 99), min_size=1, max_size=90)),
    st.tuples(st.just("add"), st.just(None)),
    st.tuples(st.just("reset"), st.lists(st.integers(0, 99), max_size=3)),
    st.tuples(st.just("keep"), st.lists(st.booleans(), min_size=12, max_size=12)),
    st.tuples(st.just("clear"), st.just(None)),
)


@settings(max_examples=120)
@given(st.lists(OPERATIONS, max_size=25))
def test_any_sequence_of_operations_against_lists(operations):
    buffers, model, number = Buffers(1, 1), [[]], 0.0
    buffers.add()
    for name, value in operations:
        k = len(model)
        if name == "append":
            cells = np.array(value) % k
            states = number + np.arange(len(cells), dtype=float)
            number += len(cells)
            buffers.append(cells, states[:, None], -states[:, None])
            for cell, state in zip(cells, states):
                model[cell].append((state, -state))
        elif name == "add" and k < 12:
            buffers.add()
            model.append([])
        elif name == "reset":
            chosen = np.isin(np.arange(k), [v % k for v in value])
            buffers.reset(chosen)
            model = [[] if c else rows for c, rows in zip(chosen, model)]
        elif name == "keep" and any(value[:k]):
            buffers.keep(np.array(value[:k]))
            model = [rows for kept, rows in zip(value, model) if kept]
        elif name == "clear":
            buffers.clear()
            model = [[] for _ in model]
        assert buffers.counts.tolist() == [len(rows) for rows in model]
    assert [rows_of(buffers, i) for i in range(len(model))] == model


def test_growth_far_beyond_the_first_size_loses_nothing():
    buffers, rng = Buffers(2, 1), np.random.default_rng(0)
    for _ in range(4):
        buffers.add()
    cells = rng.integers(4, size=20_000)
    states = rng.random((20_000, 2))
    for part in np.split(np.arange(20_000), [1, 70, 3000, 19_000]):
        buffers.append(cells[part], states[part], states[part, :1] * 2)
    inputs, actions = buffers.sample(np.arange(4), 500, rng)
    assert np.array_equal(actions[..., 0], inputs[..., 0] * 2) and (inputs[..., 2] == 1).all()
    for cell in range(4):
        own = buffers._inputs[buffers._table[cell, : buffers.counts[cell]], :2]
        assert np.array_equal(own, states[cells == cell])


def test_a_minibatch_holds_own_rows_alone():
    buffers = filled(*np.random.default_rng(0).permutation(np.repeat(np.arange(5), 30)))
    buffers.reset(np.array([2]))
    inputs, actions = buffers.sample(np.array([4, 0]), 400, np.random.default_rng(1))
    assert inputs.shape == (2, 400, 2) and actions.shape == (2, 400, 1)
    for cell, drawn in zip((4, 0), inputs):
        assert set(drawn[:, 0]) == {state for state, _ in rows_of(buffers, cell)}
    assert np.array_equal(inputs[..., 0], -actions[..., 0])


def test_sampling_is_uniform_and_with_replacement():
    buffers = filled(*[0] * 7)
    drawn, _ = buffers.sample(np.array([0]), 70_000, np.random.default_rng(2))
    counts = np.bincount(drawn[0, :, 0].astype(int), minlength=7)
    assert ((counts - 10_000) ** 2 / 10_000).sum() < 22.5  # chi square, 6 degrees of freedom, 0.1 %


def test_sampling_repeats_with_its_generator():
    draws = [filled(0, 1, 1).sample(np.array([1]), 9, np.random.default_rng(s))[0].tolist() for s in (0, 0, 1)]
    assert draws[0] == draws[1] != draws[2]


@pytest.mark.parametrize("cells", [np.array([True, False, True]), np.array([0, 2])])
def test_a_reset_by_mask_or_index_empties_these_cells_alone(cells):
    buffers = filled(0, 1, 1, 2)
    buffers.reset(cells)
    assert buffers.counts.tolist() == [0, 2, 0]


def test_clear_bounds_the_memory():
    buffers = filled(0)
    for _ in range(200):
        buffers.append(np.zeros(100, int), np.zeros((100, 1)), np.zeros((100, 1)))
        buffers.clear()
    assert len(buffers._inputs) == 1024 and buffers._table.shape[1] <= 128
