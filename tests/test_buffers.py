import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsp.buffers import Buffers, SufficientStatistics


def rows_of(buffers, cell):
    """What a cell holds, in order: (state, action) pairs."""
    numbers = buffers._table[cell, : buffers.counts[cell]]
    return [(buffers._inputs[i, 0], buffers._actions[i, 0]) for i in numbers]


OPERATIONS = st.one_of(
    st.tuples(st.just("append"), st.lists(st.integers(0, 99), min_size=1, max_size=90)),
    st.tuples(st.just("add"), st.just(None)),
    st.tuples(st.just("reset"), st.lists(st.integers(0, 99), max_size=3)),
    st.tuples(st.just("keep"), st.lists(st.booleans(), min_size=12, max_size=12)),
    st.tuples(st.just("clear"), st.just(None)),
)


def sums_of(rows):
    """What `Sums` holds of a cell with these rows."""
    inputs = np.array([[state, 1.0] for state, _ in rows]).reshape(-1, 2)
    actions = np.array([[action] for _, action in rows]).reshape(-1, 1)
    return [(inputs.T @ inputs).tolist(), (inputs.T @ actions).tolist(), np.square(actions).sum()]


def held(memory, cell):
    """The same of a memory's own cell."""
    if isinstance(memory, Buffers):
        return sums_of(rows_of(memory, cell))
    return [memory.products[cell].tolist(), memory.targets[cell].tolist(), memory.squares[cell]]


@pytest.mark.parametrize("kind", [Buffers, SufficientStatistics])
@settings(max_examples=120)
@given(operations=st.lists(OPERATIONS, max_size=25))
def test_any_sequence_of_operations_against_lists(kind, operations):
    """The sums of whole numbers are exact, in any order."""
    buffers, model, number = kind(1, 1), [[]], 0.0
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
            buffers.reset(slice(None))
            model = [[] for _ in model]
        assert buffers.counts.tolist() == [len(rows) for rows in model]
    assert [held(buffers, i) for i in range(len(model))] == [sums_of(rows) for rows in model]
    if kind is Buffers:
        assert [rows_of(buffers, i) for i in range(len(model))] == model


def test_a_reset_of_all_cells_bounds_the_memory():
    buffers = Buffers(1, 1)
    buffers.add()
    for _ in range(200):
        buffers.append(np.zeros(100, int), np.zeros((100, 1)), np.zeros((100, 1)))
        buffers.reset(slice(None))
    assert len(buffers._inputs) == 1024 and buffers._table.shape[1] <= 128


# Sums


def test_the_loss_of_sums_is_the_loss_over_their_rows():
    rng, sums = np.random.default_rng(0), SufficientStatistics(3, 2)
    cells, features, actions = rng.integers(4, size=200), rng.normal(size=(200, 3)), rng.normal(size=(200, 2))
    for _ in range(4):
        sums.add()
    for part in np.split(np.arange(200), 7 * np.arange(1, 20)):
        sums.append(cells[part], features[part], actions[part])
    assert sum(part.size for part in vars(sums).values()) == 4 * (4 * 4 + 4 * 2 + 1 + 1)  # however many the rows
    maps = rng.normal(size=(2, 4, 2))
    inputs = np.column_stack([features, np.ones(200)])
    expected = [np.square(inputs[cells == c] @ own - actions[cells == c]).mean() for c, own in zip((3, 1), maps)]
    assert sums.losses(np.array([3, 1]), maps) == pytest.approx(expected, rel=1e-10)


def test_a_perfect_map_has_no_negative_loss():
    sums, features = SufficientStatistics(2, 1), np.random.default_rng(1).normal(size=(500, 2))
    sums.add()
    sums.append(np.zeros(500, int), features, features @ [[0.3], [-0.7]] + 0.1)
    assert 0 <= sums.losses(np.array([0]), np.array([[[0.3], [-0.7], [0.1]]]))[0] < 1e-14
