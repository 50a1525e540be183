"""Training data of the cells: `Buffers` keeps rows, `SufficientStatistics` only the sums that least squares needs.

A row holds the features of a state, which are the inputs of a sub-policy (for linear ones, the state itself), and the
teacher's action there.
"""

import numpy as np

from .config import Config
from .subpolicies import SubPolicies


class Buffers:
    """Growing per-cell buffers with uniform minibatches: one log of rows, and a list of row numbers per cell.

    Rows live until all cells are empty, so the period of such a reset bounds the memory. With r rows between two of
    them, the log takes at most 16 (q + 1 + m) r bytes, since it doubles as it grows. The lists of k cells take at most
    8 k r bytes; the worst case is all rows in one cell."""

    def __init__(self, q: int, m: int):
        self._inputs = np.ones((1024, q + 1))  # features, then a column of ones for the bias
        self._actions = np.zeros((1024, m))
        self._size = 0
        self._table = np.zeros((0, 64), dtype=np.int32)  # (k, width) row numbers
        self.counts = np.zeros(0, dtype=np.int64)  # (k,) rows per cell

    def append(self, cells: np.ndarray, features: np.ndarray, actions: np.ndarray) -> None:
        """Add each row of features (T, q) and action (T, m) to the buffer of its cell (T,)."""
        rows = np.arange(self._size, self._size + len(cells))
        while rows[-1] >= len(self._inputs):
            self._inputs = np.concatenate([self._inputs, np.ones_like(self._inputs)])
            self._actions = np.concatenate([self._actions, np.zeros_like(self._actions)])
        self._inputs[rows, :-1], self._actions[rows] = features, actions
        self._size += len(cells)

        order = cells.argsort(kind="stable")
        cells = cells[order]
        slots = self.counts[cells] + np.arange(len(cells)) - np.searchsorted(cells, cells)
        while slots.max() >= self._table.shape[1]:
            self._table = np.concatenate([self._table, np.zeros_like(self._table)], axis=1)
        self._table[cells, slots] = rows[order]
        self.counts += np.bincount(cells, minlength=len(self.counts))

    def sample(self, cells: np.ndarray, size: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Draw a minibatch for each of `cells` (c,), with replacement. Returns inputs (c, size, q + 1) and actions (c,
        size, m)."""
        slots = (rng.random((len(cells), size)) * self.counts[cells, None]).astype(np.intp)
        rows = self._table[cells[:, None], slots]
        return self._inputs.take(rows, axis=0), self._actions.take(rows, axis=0)

    def fit(self, models: SubPolicies, cells: np.ndarray, config: Config, rng: np.random.Generator) -> np.ndarray:
        """Train the models of `cells` (c,) on minibatches. Returns each cell's loss before the last step. (c,)"""
        for _ in range(config.n_minibatches):
            inputs, actions = self.sample(cells, config.batch_size, rng)
            losses = models.train(cells, inputs, actions, learning_rate=config.learning_rate)
        return losses

    def add(self) -> None:
        """Append the empty buffer of a new cell."""
        self._table = np.concatenate([self._table, np.zeros((1, self._table.shape[1]), dtype=np.int32)])
        self.counts = np.append(self.counts, 0)

    def keep(self, kept: np.ndarray) -> None:
        """Keep only the buffers of the cells in the mask `kept` (k,)."""
        self._table, self.counts = self._table[kept], self.counts[kept]

    def reset(self, cells: np.ndarray | slice) -> None:
        """Empty the buffers of `cells` (mask, indices or slice). Once all are empty, the log starts again."""
        self.counts[cells] = 0
        if not self.counts.any():
            self._size = 0


class SufficientStatistics:
    """The sums over each cell's rows that least squares needs, without the rows: constant memory per cell."""

    def __init__(self, q: int, m: int):
        self.products = np.zeros((0, q + 1, q + 1))  # (k, q + 1, q + 1) X'X, where X is features and a column of ones
        self.targets = np.zeros((0, q + 1, m))  # (k, q + 1, m) X'y
        self.squares = np.zeros(0)  # (k,) y'y, over all actions
        self.counts = np.zeros(0, dtype=np.int64)  # (k,) rows per cell

    def append(self, cells: np.ndarray, features: np.ndarray, actions: np.ndarray) -> None:
        """Add each row of features (T, q) and action (T, m) to the sums of its cell (T,)."""
        inputs = np.column_stack([features, np.ones(len(features))])
        for cell in np.unique(cells):
            own, goal = inputs[cells == cell], actions[cells == cell]
            self.products[cell] += own.T @ own
            self.targets[cell] += own.T @ goal
            self.squares[cell] += np.square(goal).sum()
            self.counts[cell] += len(own)

    def losses(self, cells: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
        """Mean squared error of linear maps (c, q + 1, m), each over all rows of its cell in `cells` (c,). (c,)"""
        products, targets = self.products[cells], self.targets[cells]
        squares = self.squares[cells] + (coefficients * (products @ coefficients - 2 * targets)).sum(axis=(1, 2))
        return np.maximum(squares, 0.0) / (self.counts[cells] * targets.shape[2])  # rounding may go below 0

    def fit(self, models: SubPolicies, cells: np.ndarray, config: Config, rng: np.random.Generator) -> np.ndarray:
        """Solve least squares for the models of `cells` (c,). Returns each cell's loss before. (c,)"""
        losses = self.losses(cells, models.coefficients[cells])
        models.solve(cells, self.products[cells], self.targets[cells])
        return losses

    def add(self) -> None:
        """Append the empty sums of a new cell."""
        for name in ("products", "targets", "squares", "counts"):
            sums = getattr(self, name)
            setattr(self, name, np.concatenate([sums, np.zeros((1, *sums.shape[1:]), sums.dtype)]))

    def keep(self, kept: np.ndarray) -> None:
        """Keep only the sums of the cells in the mask `kept` (k,)."""
        self.products, self.targets = self.products[kept], self.targets[kept]
        self.squares, self.counts = self.squares[kept], self.counts[kept]

    def reset(self, cells: np.ndarray | slice) -> None:
        """Set the sums of `cells` (mask, indices or slice) to zero."""
        for sums in (self.products, self.targets, self.squares, self.counts):
            sums[cells] = 0


# `Config.fit` to the data that it needs
FITS: dict[str, type[Buffers | SufficientStatistics]] = {"adam": Buffers, "closed_form": SufficientStatistics}
