"""`Partition`: the state of a distillation, which consists of codewords, the cells' models and their buffers."""

import numpy as np

from . import geometry
from .buffers import FITS
from .config import Config
from .policy import VoronoiPolicy
from .rollouts import Episode
from .subpolicies import SubPolicies, policy_class
from .tasks import Task


class Partition:
    """The state of a distillation: codewords, the cells' models, their buffers. `observe` checks its episode. The other
    methods do not check, because a run calls them thousands of times."""

    def __init__(self, task: Task, config: Config):
        d, m = len(task.low), len(task.action_low)
        self.task, self.config = task, config
        self.codewords = np.zeros((0, d))
        self._graph: np.ndarray | None = None  # of the neighbours, while the codewords stay
        self.models = SubPolicies(policy_class(config.sub_policy, task), m, initial=config.initial)  # R7
        q = len(self.models.policy_class.terms)
        self.buffers = FITS[config.fit](q, m)
        self.metric = geometry.metric_of(config.metric)
        self.scale = np.ones(d) if config.scale == "raw" else task.high - task.low  # R8

    def observe(self, episode: Episode) -> None:
        """Put each state and action into the buffer of its cell. Raises ValueError for an episode of another task."""
        sizes = episode.states.shape[1], episode.actions.shape[1]
        wanted = len(self.task.low), len(self.task.action_low)
        if sizes != wanted:
            raise ValueError(
                f"the episode has states and actions of {sizes} numbers, expected {wanted}: {self.task.name}"
            )
        features = self.models.policy_class.features(episode.states)
        self.buffers.append(self.cells(episode.states), features, episode.actions)

    def train(self, rng: np.random.Generator) -> float:
        """Train every cell that has data. Returns the mean loss over cells."""
        cells = np.flatnonzero(self.buffers.counts)
        return float(self.buffers.fit(self.models, cells, self.config, rng).mean())

    def add(self, state: np.ndarray, rng: np.random.Generator) -> int:
        """Make `state` (d,) the codeword of a new, untrained cell. Returns its index. Raises ValueError if `state` is a
        codeword already."""
        if (self.codewords == state).all(axis=1).any():
            raise ValueError(f"state {state.tolist()} is a codeword already, expected another")
        self.codewords, self._graph = np.concatenate([self.codewords, state[None]]), None
        self.models.add(rng)
        self.buffers.add()
        return len(self.codewords) - 1

    def keep(self, kept: np.ndarray) -> None:
        """Keep only the cells of the mask `kept` (k,)."""
        self.codewords, self._graph = self.codewords[kept], None
        self.models.keep(kept)
        self.buffers.keep(kept)

    def reset(self, cells: np.ndarray | slice) -> None:
        """Empty the buffers of `cells`, a mask (k,) or a slice."""
        self.buffers.reset(cells)
        if self.config.adam_on_reset == "restart":  # R7
            self.models.restart_adam(cells)

    def clear(self) -> None:
        """Empty all buffers and reuse their memory."""
        self.reset(slice(None))

    def cells(self, states: np.ndarray) -> np.ndarray:
        """Cell of each state (T, d). (T,)"""
        return geometry.look_up(self.scaled(self.codewords), self.scaled(states), self.metric)

    def scaled(self, states: np.ndarray) -> np.ndarray:
        """States (..., d) in the units of the distance."""
        return states if self.config.scale == "raw" else states / self.scale

    def locate(self, state: np.ndarray) -> int:
        """Cell of one state (d,). Raises ValueError for a state of another length."""
        return int(self.cells(state[None])[0])

    def far(self, i: int, state: np.ndarray) -> bool:
        """Whether `state` is far enough from codeword i to become one (R3), and is not a codeword already."""
        metric = geometry.METRICS[self.config.split_metric]
        gap = metric.distances(self.scaled(state)[None], self.scaled(self.codewords[i])[None])[0, 0]
        # A teacher that pushes against the border stands still: with kept look-ups (R2) a state could be added twice.
        return gap > self.config.min_pol_distance and not (self.codewords == state).all(axis=1).any()

    def loss(self, i: int, state: np.ndarray, action: np.ndarray) -> float:
        """Mean squared error of cell i's action at `state` against the teacher's."""
        output = self.models.predict(i, state)
        if self.config.split_loss == "clipped":  # R10
            output = np.clip(output, self.task.action_low, self.task.action_high)
        return float(np.square(output - action).mean())

    def neighbours(self) -> np.ndarray:
        """Which cells are neighbours (R9). (k, k) bool"""
        if self._graph is None:
            self._graph = self.neighbours_of(self.codewords)
        return self._graph.copy()

    def neighbours_of(self, codewords: np.ndarray) -> np.ndarray:
        """Which cells are neighbours if these are all `codewords` (k, d). (k, k) bool"""
        codewords = self.scaled(codewords)
        if self.config.neighbours == "lookup":
            low, high = self.scaled(self.task.low), self.scaled(self.task.high)
            return geometry.lookup_neighbours(codewords, low, high, self.metric)
        return geometry.delaunay_neighbours(codewords)

    def comparable_coefficients(self) -> np.ndarray:
        """Return the coefficients that a merge compares (R12), one row per cell. (k, p)"""
        coefficients = self.models.comparable()
        if self.config.merge_parameters == "weights":
            coefficients = coefficients[:, :-1]
        return coefficients.reshape(len(self.codewords), -1)

    def policy(self) -> VoronoiPolicy:
        """Return the partition as a policy that later changes do not affect."""
        return VoronoiPolicy(
            self.codewords, self.models.coefficients, task=self.task, metric=self.metric, scale=self.scale,
            sub_policy=self.config.sub_policy,
        )  # fmt: skip
