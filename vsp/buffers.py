"""The buffers of all cells: one log of (state, action) rows, and per cell a list of row numbers into it."""

from __future__ import annotations

import numpy as np


class Buffers:
    """Growing per-cell buffers with uniform minibatches. Rows live until `clear`: its period bounds the memory."""

    def __init__(self, d: int, m: int):
        self._inputs = np.ones((1024, d + 1))  # states, then a column of ones for the bias
        self._actions = np.zeros((1024, m))
        self._size = 0
        self._table = np.zeros((0, 64), dtype=np.int32)  # (k, width) row numbers
        self.counts = np.zeros(0, dtype=np.int64)  # (k,) rows per cell

    def append(self, cells: np.ndarray, states: np.ndarray, actions: np.ndarray) -> None:
        """Add each state (T, d) and action (T, m) to the buffer of its cell (T,)."""
        rows = np.arange(self._size, self._size + len(cells))
        while rows[-1] >= len(self._inputs):
            self._inputs = np.concatenate([self._inputs, np.ones_like(self._inputs)])
            self._actions = np.concatenate([self._actions, np.zeros_like(self._actions)])
        self._inputs[rows, :-1], self._actions[rows] = states, actions
        self._size += len(cells)

        order = cells.argsort(kind="stable")
        cells = cells[order]
        slots = self.counts[cells] + np.arange(len(cells)) - np.searchsorted(cells, cells)
        while slots.max() >= self._table.shape[1]:
            self._table = np.concatenate([self._table, np.zeros_like(self._table)], axis=1)
        self._table[cells, slots] = rows[order]
        self.counts += np.bincount(cells, minlength=len(self.counts))

    def sample(self, cells: np.ndarray, size: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """A minibatch for each of `cells` (c,), with replacement: inputs (c, size, d + 1) and actions (c, size, m)."""
        slots = (rng.random((len(cells), size)) * self.counts[cells, None]).astype(np.intp)
        rows = self._table[cells[:, None], slots]
        return self._inputs[rows], self._actions[rows]

    def add(self) -> None:
        """Append the empty buffer of a new cell."""
        self._table = np.concatenate([self._table, np.zeros((1, self._table.shape[1]), dtype=np.int32)])
        self.counts = np.append(self.counts, 0)

    def keep(self, kept: np.ndarray) -> None:
        """Drop the buffers of all cells but those of the mask `kept` (k,)."""
        self._table, self.counts = self._table[kept], self.counts[kept]

    def reset(self, cells: np.ndarray) -> None:
        """Empty the buffers of `cells` (mask or indices)."""
        self.counts[cells] = 0

    def clear(self) -> None:
        """Empty all buffers and use the log from its start again."""
        self.counts[:] = 0
        self._size = 0
