"""`PiecewisePolicy`: cells and their maps. It acts, explains its actions, and can be saved and loaded.

`VoronoiPolicy` is the one whose cells are drawn by codewords, as in the paper.
"""

import copy
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from .cells import CELLS, MOST, Cells, Nearest
from .checks import check_array, check_observations
from .export import Exportable
from .geometry import LOOKUP, METRICS, Metric
from .run import sealed
from .run.atomic import DamagedFile
from .subpolicies import POLICY_CLASSES, SubPolicy, policy_class
from .tasks.base import Task
from .tasks.registry import BOX, get_task, saved_task

if TYPE_CHECKING:
    import pandas as pd

_STEPS = 200  # points on an axis in one pass of the search for a border


@dataclass(frozen=True)
class Explanation:
    """Why a policy acts as it does in one state; `print` shows it as text.

    `cell` is its index. It has a `codeword` (d,), None if its cells have none, and `equations`, one per action, such as
    "F = 0.5 x - 1.2 v + 0.3". `contributions` has a row per action and a column per feature and the bias. A row adds up
    to `raw` (m,), the output of the sub-policy; `action` (m,) is `raw` limited to the action box. `next_cell` is the
    nearest other cell, that of the second nearest codeword, None if there is one cell. `margin` is the distance to its
    border; with codewords the distance to the second nearest minus that to the nearest, in the look-up metric.
    `borders` has a row per input: the least change of it alone that reaches another cell, and that cell; NaN and -1 if
    no value in the box does."""

    cell: int
    codeword: np.ndarray | None
    equations: tuple[str, ...]
    contributions: "pd.DataFrame"
    raw: np.ndarray
    action: np.ndarray
    next_cell: int | None
    margin: float
    borders: "pd.DataFrame"

    def __str__(self) -> str:
        action = ", ".join(f"{name} = {value:.4g}" for name, value in zip(self.contributions.index, self.action))
        there = [
            f"{name} {row.change:+.3g} (cell {row.cell:.0f})" for name, row in self.borders.iterrows() if row.cell >= 0
        ]
        parts = f"cell {self.cell}", *self.equations, "what each input adds:", self.contributions.round(4).to_string()
        others = f"another cell, by changing one input: {', '.join(there) or 'none in the box'}"
        return "\n".join([*parts, f"action within the limits: {action}", others])


class PiecewisePolicy(Exportable):
    """k sub-policies, each valid in one cell of `where`.

    `coefficients` are (k, p, m); `policy_class.rows` names the p rows: for linear sub-policies d weights, then the
    bias. `sub_policy` is one of `subpolicies.POLICY_CLASSES`, or a function of the task that makes a `PolicyClass`. All
    arrays are float64. Raises ValueError for wrong shapes and numbers that are not finite or beyond `cells.MOST`."""

    kind = "PiecewisePolicy"  # in files

    def __init__(self, where: Cells, coefficients: np.ndarray, *, task: str | Task, sub_policy: SubPolicy = "linear"):
        self.task, self.where = get_task(task), where
        self.policy_class = policy_class(sub_policy, self.task)
        d, p, m = len(self.task.low), len(self.policy_class.rows), len(self.task.action_low)
        if where.d != d:
            raise ValueError(f"the cells are of states of {where.d} numbers, {self.task.name} has {d}")
        self.coefficients = check_array("coefficients", coefficients, (len(where), p, m), most=MOST).copy()

    def __repr__(self) -> str:
        d, m = len(self.task.inputs), len(self.task.outputs)
        return f"<{self.kind} of {self.task.name}: {len(self)} cells, {d} inputs, {m} actions; to_text() shows it>"

    def with_maps(self, coefficients: np.ndarray, *, sub_policy: SubPolicy = "linear") -> Self:
        """Return a policy with the same cells and other maps. Raises ValueError as the constructor does."""
        other = copy.copy(self)
        PiecewisePolicy.__init__(other, self.where, coefficients, task=self.task, sub_policy=sub_policy)
        return other

    def check_linear(self) -> None:
        """Raise ValueError unless the sub-policies are linear, for callers that support no others."""
        if self.policy_class.name != "linear":
            raise ValueError(
                f"the policy has sub_policy {self.policy_class.name!r}, expected 'linear': distil a linear policy"
            )

    def cells(self, obs: np.ndarray) -> np.ndarray:
        """Index of the cell of each observation (n, d), or of one (d,)."""
        return self._cells(self._states(obs))

    def linear(self, obs: np.ndarray) -> np.ndarray:
        """Output of the sub-policies before it is clipped to the action box: (n, m), or (m,) for one observation."""
        states = self._states(obs)
        return self.policy_class.outputs(self.policy_class.features(states), self.coefficients[self._cells(states)])

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """Return actions within the task's limits, in Stable-Baselines3's convention.

        `obs` is one observation (d,) or a batch (n, d). Returns actions (m,) or (n, m) in float64, and None in place of
        a recurrent state. Raises ValueError for a wrong shape or numbers that are not finite."""
        return np.minimum(np.maximum(self.linear(obs), self.task.action_low), self.task.action_high), None

    def explain(self, obs: np.ndarray) -> Explanation:
        """Explain the action at one observation (d,): cell, equations, contributions of features, and nearest borders.
        Raises ValueError for a batch, and for bad numbers as `predict` does."""
        state = self._states(obs)
        if state.ndim != 1:
            raise ValueError(f"observation has shape {state.shape}, expected {(len(self.task.low),)}: one state")
        cell, raw = int(self._cells(state)), self.linear(state)
        next_cell, margin = self.where.border(state, cell)
        return Explanation(
            cell=cell,
            codeword=self.where.codewords[cell] if isinstance(self.where, Nearest) else None,
            equations=self.equations(cell),
            contributions=self.policy_class.contributions(state, self.coefficients[cell]).set_axis(self.task.outputs),
            raw=raw,
            action=self.predict(state)[0],
            next_cell=next_cell,
            margin=margin,
            borders=self._borders(state, cell),
        )

    def _borders(self, state: np.ndarray, cell: int) -> "pd.DataFrame":
        """Return the columns change (in units of the input; NaN where no change within the box leads to another cell)
        and cell (-1 there).

        Tries `_STEPS` points on each axis, then refines between two of them. A very thin cell may be missed. Where the
        box has no limit, it looks as far as twice the range of the codewords."""
        import pandas as pd  # here, because it takes long to import

        rows = []
        for axis in range(len(state)):
            low, high = min(self.task.low[axis], state[axis]), max(self.task.high[axis], state[axis])
            places = self.where.codewords[:, axis] if isinstance(self.where, Nearest) else [-1, 1]
            far = 2 * np.ptp(np.append(places, state[axis]))
            ends = (end if np.isfinite(end) else state[axis] + way * far for way, end in ((-1, low), (1, high)))
            ways = [self._border(state, cell, axis, end) for end in ends]
            rows.append(min(ways, key=lambda way: np.nan_to_num(abs(way[0]), nan=np.inf)))
        return pd.DataFrame(rows, index=list(self.task.inputs), columns=["change", "cell"])

    def _border(self, state: np.ndarray, cell: int, axis: int, end: float) -> tuple[float, int]:
        """Return the change along one axis towards `end` at which another cell begins, and that cell."""
        inside, outside = state[axis], end
        for _ in range(5):  # each time on a finer grid
            line = np.tile(state, (_STEPS, 1))
            line[:, axis] = np.linspace(inside, outside, _STEPS)
            left = np.flatnonzero(self.cells(line) != cell)
            if not len(left) or left[0] == 0:
                return np.nan, -1
            inside, outside, found = line[left[0] - 1, axis], line[left[0], axis], int(self.cells(line[left[0]]))
        return float(outside - state[axis]), found

    def to_frame(self) -> "pd.DataFrame":
        """Return one row per cell: its codeword if it has one, then the coefficients, named as in data/paper."""
        import pandas as pd  # here, because it takes long to import

        codewords = self.where.codewords.T if isinstance(self.where, Nearest) else ()
        columns = {f"codeword_{name}": column for name, column in zip(self.task.inputs, codewords)}
        for j, output in enumerate(self.task.outputs):
            for i, name in enumerate(self.policy_class.rows):
                columns[f"{output.replace('Δ', 'd')}_{name}"] = self.coefficients[:, i, j]
        return pd.DataFrame(columns).rename_axis("cell")

    def _content(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """What a file of the policy holds: arrays, and all else."""
        arrays = {**self.where.arrays, "coefficients": self.coefficients}
        arrays |= {limit: getattr(self.task, limit) for limit in BOX}
        about: dict[str, Any] = {"task": self.task.name, **self.where.options, "sub_policy": self.policy_class.name}
        about |= {"inputs": self.task.inputs, "outputs": self.task.outputs, "kind": self.kind}
        return arrays, about | ({"cells": type(self.where).__name__} if self.kind == PiecewisePolicy.kind else {})

    @property
    def digest(self) -> str:
        """SHA-256 of the cells, the maps and the action box: its identity as an agent. Raises ValueError if a part from
        outside cannot be identified."""
        from .run.identity import identity  # here: few policies are agents

        parts = [self.where, self.policy_class, self.coefficients, self.task.action_low, self.task.action_high]
        return hashlib.sha256(json.dumps(identity(parts), sort_keys=True).encode()).hexdigest()

    def save(self, path: str | os.PathLike) -> None:
        """Write the policy to one sealed file, atomically."""
        sealed.save_arrays(path, *self._content())

    @classmethod
    def load(cls, path: str | os.PathLike, *, known: Sequence = ()) -> Self:
        """Read a policy that `save` wrote, with the names and the box of its task.

        It can act even if the task is not registered. `known` are objects from outside vsp that the file names: a class
        of cells, a `Metric`, a function that makes a `PolicyClass`. Raises FileNotFoundError, and
        `run.atomic.DamagedFile` if a bit is missing or altered, or if the file holds no such policy."""
        arrays, about = sealed.load_arrays(path, kind=(cls.kind, VoronoiPolicy.kind))
        try:
            box = {limit: arrays.pop(limit) for limit in BOX}
            task = saved_task(about["task"], about["inputs"], about["outputs"], box)
            things: dict[str, Any] = {**CELLS, **METRICS, **POLICY_CLASSES}
            things |= {getattr(one, "name", getattr(one, "__name__", "")): one for one in known}
            things |= {one(task).name: one for one in known if not isinstance(one, type | Metric)}
            options = {"metric": things[about["metric"]]} if "metric" in about else {}
            coefficients, sub_policy = arrays.pop("coefficients"), things[about["sub_policy"]]
            where = things[about.get("cells", "Nearest")](**arrays, **options)
            policy: Any = object.__new__(VoronoiPolicy if about["kind"] == VoronoiPolicy.kind else PiecewisePolicy)
            PiecewisePolicy.__init__(policy, where, coefficients, task=task, sub_policy=sub_policy)
            return policy
        except KeyError as error:
            what = f"the checksum is right, but the file lacks or names {error}, which may be an object for `known`"
            raise DamagedFile(f"{path}: {what}") from error
        except (TypeError, ValueError, AttributeError, IndexError, RecursionError) as error:
            raise DamagedFile(
                f"{path}: the checksum is right, but the file holds no valid policy: {error!s:.300}"
            ) from error

    def _cells(self, states: np.ndarray) -> np.ndarray:
        found = self.where.locate(states.reshape(-1, states.shape[-1]))
        return found.reshape(states.shape[:-1])[()]  # a scalar for one state: faster to index with

    def _states(self, obs: np.ndarray) -> np.ndarray:
        return check_observations(obs, len(self.task.low), self.task.name)


class VoronoiPolicy(PiecewisePolicy):
    """k sub-policies, each valid in the Voronoi cell of its codeword (paper, section "Voronoi quantization").

    `codewords` are (k, d); `metric` and `scale` as in `cells.Nearest`, the rest as in `PiecewisePolicy`. Raises
    ValueError as both do."""

    kind = "VoronoiPolicy"
    where: Nearest

    def __init__(
        self, codewords: np.ndarray, coefficients: np.ndarray, *, task: str | Task, metric: str | Metric = LOOKUP,
        scale: np.ndarray | None = None, sub_policy: SubPolicy = "linear",
    ):  # fmt: skip
        task = get_task(task)
        codewords = check_array("codewords", codewords, (-1, len(task.low)))
        super().__init__(Nearest(codewords, metric, scale), coefficients, task=task, sub_policy=sub_policy)

    @property
    def codewords(self) -> np.ndarray:
        """The codewords, in the units of the states. (k, d)"""
        return self.where.codewords

    @property
    def scale(self) -> np.ndarray:
        """What states are divided by before distances are taken. (d,)"""
        return self.where.scale

    @property
    def metric(self) -> str:
        """The name of the distance."""
        return self.where.metric.name
