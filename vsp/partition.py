"""`Partition`: what a distillation changes as it goes, the codewords, the cells' models and their buffers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import geometry, readings
from .buffers import Buffers, Recent, Sums
from .checks import check_array
from .config import Config
from .envs import Task
from .policy import VoronoiPolicy
from .rollouts import Episode
from .subpolicies import SubPolicies, form_of


class Partition:
    """The state of a distillation: codewords, the cells' models, their buffers.

    What goes in is checked: `add`, `observe` and `locate` raise ValueError for states that do not fit the task or are
    not finite. The rest works on what is there, thousands of times a run.
    """

    def __init__(self, task: Task, config: Config):
        d, m = len(task.low), len(task.action_low)
        self.task, self.config = task, config
        self.codewords = np.zeros((0, d))
        self.models = SubPolicies(form_of(config.sub_policy, task), m, initial=config.initial)
        memory, self._fit = {"adam": (Buffers, self._step), "closed_form": (Sums, self._solve)}[config.fit]
        self.buffers = memory(len(self.models.form.terms), m)
        self._recent = Recent(geometry.WITNESSES)
        self.scale = readings.SCALE[config.scale](task.low, task.high)
        self._on_reset = readings.ADAM_ON_RESET[config.adam_on_reset]
        self._seen_by_loss = readings.SPLIT_LOSS[config.split_loss]
        self._graph = readings.NEIGHBOURS[config.neighbours]
        self._compared = readings.MERGE_PARAMETERS[config.merge_parameters]

    def observe(self, episode: Episode) -> None:
        """Put each state and action into the buffer of its cell. Raises ValueError for an episode of another task."""
        found, wanted = (
            (episode.states.shape[1], episode.actions.shape[1]),
            (len(self.task.low), len(self.task.action_low)),
        )
        if found != wanted:
            raise ValueError(
                f"the episode has states and actions of {found} numbers, expected {wanted}: {self.task.name}"
            )
        cells = geometry.look_up(self.codewords / self.scale, episode.states / self.scale)
        self.buffers.append(cells, self.models.form.features(episode.states), episode.actions)
        self._recent.append(episode.states)

    def train(self, rng: np.random.Generator) -> float:
        """Train every cell that has data; returns the mean loss over cells."""
        return float(self._fit(np.flatnonzero(self.buffers.counts), rng).mean())

    def _step(self, cells: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Steps of Adam, each on a minibatch of each cell (c,). Returns the losses before the last one. (c,)"""
        for _ in range(self.config.n_minibatches):
            inputs, actions = self.buffers.sample(cells, self.config.batch_size, rng)
            losses = self.models.train(cells, inputs, actions, learning_rate=self.config.learning_rate)
        return losses

    def _solve(self, cells: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Least squares over all that each cell (c,) saw since its last reset. Returns the losses before it. (c,)"""
        losses = self.buffers.losses(cells, self.models.parameters[cells])
        self.models.solve(cells, self.buffers.products[cells], self.buffers.targets[cells])
        return losses

    def add(self, state: np.ndarray, rng: np.random.Generator) -> int:
        """Make `state` (d,) the codeword of a new, untrained cell; returns its index.

        Raises ValueError for one that is a codeword already.
        """
        state = check_array("state", state, (len(self.task.low),))
        if (self.codewords == state).all(axis=1).any():
            raise ValueError(f"state {state.tolist()} is a codeword already, expected another")
        self.codewords = np.concatenate([self.codewords, state[None]])
        self.models.add(rng)
        self.buffers.add()
        return len(self.codewords) - 1

    def keep(self, kept: np.ndarray) -> None:
        """Drop all cells but those of the mask `kept` (k,)."""
        self.codewords = self.codewords[kept]
        self.models.keep(kept)
        self.buffers.keep(kept)

    def reset(self, cells: np.ndarray) -> None:
        """Empty the buffers of `cells`, a mask (k,)."""
        self.buffers.reset(cells)
        self._on_reset(self.models, cells)

    def clear(self) -> None:
        """Empty all buffers and use their memory again."""
        self.buffers.clear()
        self._on_reset(self.models, slice(None))

    def locate(self, state: np.ndarray) -> int:
        """Cell of one state (d,)."""
        return self.snapshot()(check_array("state", state, (len(self.task.low),)))

    def snapshot(self) -> Callable[[np.ndarray], int]:
        """The look-up among the codewords of this moment, as a function of one state."""
        codewords = self.codewords / self.scale
        return lambda state: int(geometry.look_up(codewords, (state / self.scale)[None])[0])

    def far(self, i: int, state: np.ndarray) -> bool:
        """Whether `state` is far enough from codeword i to become one, and is not a codeword already."""
        gap = geometry.distances(
            (state / self.scale)[None], (self.codewords[i] / self.scale)[None], self.config.split_metric
        )
        # A teacher pushing against the border stands still; with split_lookup="kept" it could offer one state twice.
        return gap[0, 0] > self.config.min_pol_distance and not (self.codewords == state).all(axis=1).any()

    def loss(self, i: int, state: np.ndarray, action: np.ndarray) -> float:
        """Mean squared error of cell i's action at `state` against the teacher's."""
        own = self._seen_by_loss(self.models.predict(i, state), self.task.action_low, self.task.action_high)
        return float(np.square(own - action).mean())

    def neighbours(self, members: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Which cells of `members` are neighbours. (k, k) bool"""
        return self._graph(self.codewords[members] / self.scale, self)

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """The corners (d,) of the state box, scaled."""
        return self.task.low / self.scale, self.task.high / self.scale

    def visited(self) -> np.ndarray:
        """The states of the last episodes, scaled. (n, d)"""
        return self._recent.states() / self.scale

    def comparable_parameters(self) -> np.ndarray:
        """What a merge compares, one row per cell. (k, p)"""
        return self._compared(self.models.comparable()).reshape(len(self.codewords), -1)

    def policy(self) -> VoronoiPolicy:
        """The partition as a policy of its own."""
        scale = None if self.config.scale == "raw" else self.scale
        parameters, name = self.models.parameters, self.config.sub_policy
        return VoronoiPolicy(self.codewords, parameters, task=self.task, scale=scale, sub_policy=name)
