"""`VoronoiPolicy`: codewords and sub-policies. It acts, explains its actions, and can be saved and loaded."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import geometry
from .checks import check_array, check_choice, check_observations
from .export import Exportable
from .run import sealed
from .run.atomic import DamagedFile
from .subpolicies import policy_class
from .tasks.base import Task
from .tasks.registry import BOX, get_task, saved_task

if TYPE_CHECKING:
    import pandas as pd

_STEPS = 200  # points on an axis in one pass of the search for a border
MOST, LEAST_SCALE = 1e50, 1e-50  # limits of a policy's numbers, which keep squared distances and products below 1e308


@dataclass(frozen=True)
class Explanation:
    """Why a policy acts as it does in one state; `print` shows it as text.

    `cell` is its index. It has a `codeword` (d,) and `equations`, one per action, such as "F = 0.5 x - 1.2 v + 0.3".
    `contributions` has a row per action and a column per feature and the bias. A row adds up to `raw` (m,),
    the output of the sub-policy; `action` (m,) is `raw` limited to the action box. `next_cell` is the cell with the
    second nearest codeword, None if there is one cell. `margin` is the distance to that codeword minus the distance to
    the nearest, in the look-up metric. `borders` has a row per input: the least change of it alone that reaches another
    cell, and that cell; NaN and -1 if no value in the box does.
    """

    cell: int
    codeword: np.ndarray
    equations: tuple[str, ...]
    contributions: pd.DataFrame
    raw: np.ndarray
    action: np.ndarray
    next_cell: int | None
    margin: float
    borders: pd.DataFrame

    def __str__(self) -> str:
        action = ", ".join(f"{name} = {value:.4g}" for name, value in zip(self.contributions.index, self.action))
        there = [
            f"{name} {row.change:+.3g} (cell {row.cell:.0f})" for name, row in self.borders.iterrows() if row.cell >= 0
        ]
        parts = f"cell {self.cell}", *self.equations, "what each input adds:", self.contributions.round(4).to_string()
        others = f"another cell, by changing one input: {', '.join(there) or 'none in the box'}"
        return "\n".join([*parts, f"action within the limits: {action}", others])


class VoronoiPolicy(Exportable):
    """k sub-policies, each valid in the Voronoi cell of its codeword (paper, section "Voronoi quantization").

    `codewords` are (k, d). `coefficients` are (k, p, m); `policy_class.rows` names the p rows: for linear sub-policies
    d weights, then the bias. `sub_policy` is one of `subpolicies.POLICY_CLASSES`. Distances are taken between states
    divided by `scale` (d,); None: raw states. All arrays are float64. Raises ValueError for wrong shapes, equal
    codewords, and numbers that are not finite or beyond the limits `MOST` and `LEAST_SCALE`.
    """

    def __init__(
        self,
        codewords: np.ndarray,
        coefficients: np.ndarray,
        *,
        task: str | Task,
        metric: str = geometry.LOOKUP,
        scale: np.ndarray | None = None,
        sub_policy: str = "linear",
    ):
        self.task = get_task(task)
        self.policy_class = policy_class(sub_policy, self.task)
        d, p, m = len(self.task.low), len(self.policy_class.rows), len(self.task.action_low)
        self.codewords = check_array("codewords", codewords, (-1, d), most=MOST).copy()
        self.coefficients = check_array("coefficients", coefficients, (len(self.codewords), p, m), most=MOST).copy()
        self.scale = check_array("scale", np.ones(d) if scale is None else scale, (d,), most=MOST).copy()
        check_choice("metric", metric, geometry.METRICS)
        if not len(self.codewords) or not geometry.all_differ(self.codewords):
            raise ValueError(f"expected at least one codeword and all different, got {self.codewords.tolist()}")
        if not (self.scale >= LEAST_SCALE).all():
            raise ValueError(f"scale is {self.scale.tolist()}, expected positive numbers of at least {LEAST_SCALE}")
        self.metric = metric
        self._scaled = self.codewords / self.scale
        for array in (self.codewords, self.scale):  # an edit would not reach the look-up
            array.setflags(write=False)

    def __repr__(self) -> str:
        d, m = len(self.task.inputs), len(self.task.outputs)
        return f"<VoronoiPolicy of {self.task.name}: {len(self)} cells, {d} inputs, {m} actions; to_text() shows it>"

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
        a recurrent state. Raises ValueError for a wrong shape or numbers that are not finite.
        """
        return np.minimum(np.maximum(self.linear(obs), self.task.action_low), self.task.action_high), None

    def explain(self, obs: np.ndarray) -> Explanation:
        """Explain the action at one observation (d,): cell, equations, contributions of features, and nearest borders.

        Raises ValueError for a batch, and for bad numbers as `predict` does.
        """
        state = self._states(obs)
        if state.ndim != 1:
            raise ValueError(f"observation has shape {state.shape}, expected {(len(self.task.low),)}: one state")
        gaps = geometry.distances((state / self.scale)[None], self._scaled, self.metric)[0]
        order = gaps.argsort(kind="stable")
        cell, raw = int(order[0]), self.linear(state)
        return Explanation(
            cell=cell,
            codeword=self.codewords[cell],
            equations=self.equations(cell),
            contributions=self.policy_class.contributions(state, self.coefficients[cell]).set_axis(self.task.outputs),
            raw=raw,
            action=self.predict(state)[0],
            next_cell=int(order[1]) if len(self) > 1 else None,
            margin=float(gaps[order[1]] - gaps[order[0]]) if len(self) > 1 else float("inf"),
            borders=self._borders(state, cell),
        )

    def _borders(self, state: np.ndarray, cell: int) -> pd.DataFrame:
        """Return the columns change (in units of the input; NaN where no change within the box leads to another cell)
        and cell (-1 there).

        Tries `_STEPS` points on each axis, then refines between two of them. A very thin cell may be missed. Where the
        box has no limit, it looks as far as twice the range of the codewords.
        """
        import pandas as pd  # here, because it takes long to import

        rows = []
        for axis in range(len(state)):
            low, high = min(self.task.low[axis], state[axis]), max(self.task.high[axis], state[axis])
            far = 2 * np.ptp(np.append(self.codewords[:, axis], state[axis]))
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

    def to_frame(self) -> pd.DataFrame:
        """Return one row per cell: the codeword's coordinates, then the coefficients, named as in data/paper."""
        import pandas as pd  # here, because it takes long to import

        columns = {f"codeword_{name}": self.codewords[:, i] for i, name in enumerate(self.task.inputs)}
        for j, output in enumerate(self.task.outputs):
            for i, name in enumerate(self.policy_class.rows):
                columns[f"{output.replace('Δ', 'd')}_{name}"] = self.coefficients[:, i, j]
        return pd.DataFrame(columns).rename_axis("cell")

    def save(self, path: str | os.PathLike) -> None:
        """Write the policy to one sealed file, atomically."""
        arrays = {"codewords": self.codewords, "coefficients": self.coefficients, "scale": self.scale}
        arrays |= {limit: getattr(self.task, limit) for limit in BOX}
        about = {"task": self.task.name, "metric": self.metric, "sub_policy": self.policy_class.name}
        names = {"inputs": self.task.inputs, "outputs": self.task.outputs}
        sealed.save_arrays(path, arrays, {"kind": "VoronoiPolicy", **about, **names})

    @classmethod
    def load(cls, path: str | os.PathLike) -> VoronoiPolicy:
        """Read a policy that `save` wrote, with the names and the box of its task.

        It can act even if the task is not registered. Raises FileNotFoundError, and `run.atomic.DamagedFile` if a bit
        is missing or altered, or if the file holds no policy.
        """
        arrays, about = sealed.load_arrays(path, kind="VoronoiPolicy")
        try:
            box = {limit: arrays.pop(limit) for limit in BOX}
            task = saved_task(about["task"], about["inputs"], about["outputs"], box)
            return cls(**arrays, task=task, metric=about["metric"], sub_policy=about["sub_policy"])
        except (KeyError, TypeError, ValueError) as error:
            raise DamagedFile(f"{path}: the checksum is right, but the file holds no valid policy: {error}") from error

    def _cells(self, states: np.ndarray) -> np.ndarray:
        found = geometry.look_up(self._scaled, states.reshape(-1, states.shape[-1]) / self.scale, self.metric)
        return found.reshape(states.shape[:-1])[()]  # a scalar for one state: faster to index with

    def _states(self, obs: np.ndarray) -> np.ndarray:
        return check_observations(obs, len(self.task.low), self.task.name)
