"""Tune every method in the same way: CMA-ES on all numbers of a tree, a partition or a network of fixed structure."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsp import Policy, Task, VoronoiPolicy
from vsp.paper.baselines import Tree
from vsp.rollouts import visited_states
from vsp.subpolicies import linear_outputs
from vsp_beyond import Tuned
from vsp_beyond.few_cells.tune import Candidates, tune
from vsp_beyond.few_cells.units import Scaling, joined, parted

from ..rivals.small_network import SmallNetwork
from ..rivals.trees import LinearTree, ObliqueLinearTree


@dataclass(frozen=True)
class TunableTree:
    """The splits and the maps of a tree, in the units of `frame`. A tree with one leaf is one linear map."""

    frame: Scaling
    sides: np.ndarray  # (leaves, nodes): 1 where the path to a leaf turns right, -1 where it turns left, else 0
    directions: np.ndarray  # (nodes, d)
    thresholds: np.ndarray  # (nodes,) a state beyond its threshold turns right
    maps: np.ndarray  # (leaves, d + 1, m): weights, then bias
    oblique: bool  # whether directions are tuned
    constant: bool  # whether leaves have only biases

    def __len__(self) -> int:
        return len(self.maps)

    @property
    def vector(self) -> np.ndarray:
        """All tuned numbers, as one vector."""
        return joined(self.parts)

    @property
    def parts(self) -> list[np.ndarray]:
        """What is tuned: directions (if oblique), thresholds, maps (biases only, if constant)."""
        directions = [self.directions] if self.oblique else []
        return [*directions, self.thresholds, self.maps[:, -1] if self.constant else self.maps]

    def like(self, vector: np.ndarray) -> "TunableTree":
        """Return the same structure with the numbers of `vector`."""
        *directions, thresholds, maps = parted(vector, self.parts)
        if self.constant:
            maps = np.concatenate([np.zeros_like(self.maps[:, :-1]), maps[:, None]], axis=1)
        new = {"directions": directions[0]} if directions else {}
        return replace(self, thresholds=thresholds, maps=maps, **new)

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), limited to the action box."""
        states = self.frame.inputs(obs)[:, :-1]
        turns = np.where(states @ self.directions.T > self.thresholds, 1.0, -1.0)
        wrong = np.abs(self.sides).sum(axis=1) - turns @ self.sides.T  # 0 at the leaf that the state reaches
        return self.frame.actions(linear_outputs(states, self.maps[wrong.argmin(axis=1)])), None


@dataclass(frozen=True)
class TunableNetwork:
    """The weights of a network with one hidden layer of tanh units, in the units of `frame`."""

    frame: Scaling
    hidden: np.ndarray  # (d + 1, units): weights, then biases
    output: np.ndarray  # (units + 1, m)

    @property
    def vector(self) -> np.ndarray:
        """All tuned numbers, as one vector."""
        return joined([self.hidden, self.output])

    def like(self, vector: np.ndarray) -> "TunableNetwork":
        """Return the same structure with the numbers of `vector`."""
        return TunableNetwork(self.frame, *parted(vector, [self.hidden, self.output]))

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Actions (n, m) for observations (n, d), limited to the action box."""
        outputs = np.tanh(self.frame.inputs(obs) @ self.hidden) @ self.output[:-1] + self.output[-1]
        return self.frame.actions(outputs), None


def tuned(start: Policy, teacher: Policy, task: Task, config: Tuned, seed: int) -> Policy:
    """Tune `start` on the return by the search of `distill_tuned`, with as many start states and snapshots and the same
    penalty. Returns the best snapshot on the validation starts, or `start` itself if none is better."""
    streams = np.random.SeedSequence(seed).spawn(5)  # as in `distill_tuned`
    starts, _, _, validation, search = map(np.random.default_rng, streams)
    states = visited_states(teacher, task, task.start(starts, config.n_episodes))
    frame = Scaling.of(task, states)
    if isinstance(start, VoronoiPolicy) and len(start) > 1:
        frame = replace(frame, scale=start.scale)  # the scale is part of its borders
        first, policy_of = frame.cells(start), frame.policy
    else:
        first, policy_of = tunable(start, frame), _itself
    candidates = Candidates(policy_of, task, task.start(validation, config.n_validation), config.failure_penalty)
    candidates.add("fit", 0, first)
    for snapshot in tune(policy_of, task, first, config, search):
        candidates.add("tune", 0, snapshot)
    return policy_of(candidates.best)


def _itself(cells: Any) -> Any:
    return cells


def tunable(policy: VoronoiPolicy | Tree | LinearTree | SmallNetwork, frame: Scaling) -> Any:
    """Return one linear map or a tree as a `TunableTree`, and a network as a `TunableNetwork`. It has the policy's own
    units, or those of `frame` if the policy has none."""
    if isinstance(policy, VoronoiPolicy):
        maps, none, d = frame.cells(policy).coefficients, np.zeros(0), len(frame.centre)
        return TunableTree(frame, none[None], np.zeros((0, d)), none, maps, oblique=False, constant=False)
    if isinstance(policy, Tree):
        return _of_cart(policy.model.tree_, frame)
    if isinstance(policy, LinearTree):
        return of_tree(policy)
    own = Scaling(policy.task, policy.centre, policy.scale)
    hidden, output = (np.vstack(layer) for layer in policy.layers)
    return TunableNetwork(own, hidden, own.coefficients(output))


def of_tree(tree: LinearTree) -> TunableTree:
    """Return a tree that can be tuned, in the units of `tree`."""
    frame = Scaling(tree.task, tree.centre, tree.scale)
    inner, ends, sides = _ways([node.children for node in tree.nodes])
    splits = [tree.nodes[i].split for i in inner]
    directions = np.array([split.direction for split in splits]).reshape(len(inner), len(frame.centre))
    thresholds = np.array([split.threshold for split in splits])
    oblique = isinstance(tree, ObliqueLinearTree)
    maps = frame.coefficients(tree.maps[ends])
    return TunableTree(frame, sides, directions, thresholds, maps, oblique, tree.constant)


def _of_cart(tree, frame: Scaling) -> TunableTree:
    """Return the numbers of a tree that is given by scikit-learn's arrays."""
    pairs = zip(tree.children_left.tolist(), tree.children_right.tolist())
    inner, ends, sides = _ways([pair if pair[0] >= 0 else () for pair in pairs])
    axes, m, d = tree.feature[inner], tree.value.shape[1], len(frame.centre)
    thresholds = (tree.threshold[inner] - frame.centre[axes]) / frame.scale[axes]
    maps = np.zeros((len(ends), d + 1, m))
    maps[:, -1] = frame.outputs(tree.value[ends, :, 0])
    return TunableTree(frame, sides, np.eye(d)[axes], thresholds, maps, oblique=False, constant=True)


def _ways(children: list[tuple[int, ...]]) -> tuple[list[int], list[int], np.ndarray]:
    """Return the inner nodes and leaves of a tree, and which way the path to each leaf turns: `sides` (leaves, nodes).

    `children` holds the left and the right child of every node (empty for a leaf). Parents come before their children.
    """
    inner = [i for i, pair in enumerate(children) if pair]
    ends = [i for i, pair in enumerate(children) if not pair]
    sides = np.zeros((len(children), len(inner)))
    for column, i in enumerate(inner):
        for child, side in zip(children[i], (-1, 1)):
            sides[child] = sides[i]
            sides[child, column] = side
    return inner, ends, sides[ends]
