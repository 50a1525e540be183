"""A soft decision tree (Frosst and Hinton 2017), trained by gradient descent."""

from __future__ import annotations

import numpy as np

from vsp.rollouts import standard


class SoftTree:
    """A soft decision tree (Coppens et al. 2019, after Frosst & Hinton 2017), with constant actions in its leaves.

    An inner node sends a state to the right with a probability that is the sigmoid of a linear function. Training
    weights the squared error of every leaf by the probability of its path, and penalises nodes that use one branch.
    The trained tree acts as its most probable leaf. To keep this loss small, the temperature of the nodes falls during
    training, and each leaf finally gets the mean action of its states. `leaves` is rounded down to a power of two.
    """

    N_STEPS, BATCH, RATE = 1000, 256, 0.04
    HARDEST = 30.0  # inverse temperature at the end, which makes the most probable leaf nearly certain
    BALANCE = 0.03  # weight of the penalty on uneven nodes; halves with every level, falls to 0 during training

    def __init__(self, states: np.ndarray, actions: np.ndarray, *, leaves: int, seed: int):
        self.depth = int(np.log2(leaves))
        self.centre, self.scale = standard(states)
        rng = np.random.default_rng(seed)
        self.nodes = rng.normal(0, 0.5, size=(len(self) - 1, states.shape[1] + 1))  # (2^depth - 1, d + 1)
        self.values = actions[rng.integers(len(actions), size=len(self))].astype(np.float64)  # (2^depth, m)
        self._train(self._inputs(states), actions, rng)
        leaf = self._leaf(self._inputs(states))
        for i in np.unique(leaf):
            self.values[i] = actions[leaf == i].mean(axis=0)

    def __len__(self) -> int:
        return 2**self.depth

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d)."""
        return self.values[self._leaf(self._inputs(obs))], None

    def _leaf(self, inputs: np.ndarray) -> np.ndarray:
        """The most probable leaf. (n,)"""
        logits, turns = inputs @ self.nodes.T, _turns(self.depth)[-len(self) :]
        surprise = np.logaddexp(0.0, -logits) @ (turns > 0).T + np.logaddexp(0.0, logits) @ (turns < 0).T
        return surprise.argmin(axis=1)

    def _inputs(self, states: np.ndarray) -> np.ndarray:
        return np.column_stack([(states - self.centre) / self.scale, np.ones(len(states))])

    def _train(self, inputs: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> None:
        import torch
        from torch.nn.functional import logsigmoid

        turns = _turns(self.depth)
        parts = (inputs, actions, turns > 0, turns < 0, 0.5 ** np.abs(turns[: len(self.nodes)]).sum(axis=1))
        x, a, right, left, fades = (torch.from_numpy(np.asarray(part, dtype=np.float64)) for part in parts)
        nodes, values = (torch.tensor(part, requires_grad=True) for part in (self.nodes, self.values))
        optimizer = torch.optim.Adam([nodes, values], lr=self.RATE)
        for done in np.linspace(0, 1, self.N_STEPS, endpoint=False):
            rows = torch.from_numpy(rng.integers(len(inputs), size=self.BATCH))
            logits = self.HARDEST ** min(1.0, done / 0.9) * (x[rows] @ nodes.T)
            paths = torch.exp(logsigmoid(logits) @ right.T + logsigmoid(-logits) @ left.T)  # of every node and leaf
            errors = (a[rows][:, None] - values).square().mean(dim=2)
            loss = (paths[:, len(nodes) :] * errors).sum(dim=1).mean()
            reach = paths[:, : len(nodes)]
            share = (reach * torch.sigmoid(logits)).sum(dim=0) / reach.sum(dim=0).clamp(min=1e-9)
            share = share.clamp(1e-6, 1 - 1e-6)
            loss = loss - self.BALANCE * (1 - done) * (0.5 * fades * (share.log() + (1 - share).log())).sum()
            optimizer.param_groups[0]["lr"] = self.RATE * (1 - done)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        self.nodes = self.HARDEST * nodes.detach().numpy()
        self.values = np.clip(values.detach().numpy(), actions.min(axis=0), actions.max(axis=0))


def _turns(depth: int) -> np.ndarray:
    """Return the path to every node of a full binary tree, breadth first, inner nodes before leaves.

    An entry is -1 if the path turns left at an inner node, 1 if right, 0 if it does not pass the node.
    (2^(depth + 1) - 1, 2^depth - 1)
    """
    signs = np.zeros((2 ** (depth + 1) - 1, 2**depth - 1))
    for node in range(1, len(signs)):
        parent = (node - 1) // 2
        signs[node] = signs[parent]
        signs[node, parent] = 1.0 if node == 2 * parent + 2 else -1.0
    return signs
