"""`Replay`: the iterations of a distillation, under a slider."""

from __future__ import annotations

import bisect
import html

import ipywidgets as widgets
import numpy as np
import pandas as pd

from ..history import History
from ..policy import VoronoiPolicy
from ..rollouts import Policy
from ..tasks.base import Task
from ..tasks.registry import get_task
from .animation import Growth
from .page import _LABELS, DPI, Explorer, Page, _button, _state, _table

STATIC = (0.01, 0.1, 1.0)  # shares of the iterations that the static pages show
PLAYED = 80  # iterations that the player shows, in addition to those with a split or merge


class Replay(Explorer):
    """Replay of a distillation: the partition at any iteration, and what teacher and copy do in a chosen state.

    Raises ValueError as `Growth` does: for tasks other than the paper's, for a history of another method or task, and
    for a teacher that does not play the task.
    """

    def __init__(self, teacher: Policy, task: str | Task, history: History):
        self.teacher, self.task = teacher, get_task(task)
        self.growth = Growth(history, teacher, task, dpi=DPI, chosen=True)
        self._passes = sorted({event.iteration for event in history.events})
        self._played = sorted({*self.growth.moments(PLAYED), *self._passes})
        self.iteration = widgets.IntSlider(0, 0, len(self.growth) - 1, description="iteration n", **_LABELS)
        about = {"tooltip": "play the run", "layout": {"width": "100px"}}  # its buttons have no text
        self.player = widgets.Play(max=len(self._played) - 1, interval=150, show_repeat=False, **about)
        self.previous, self.next = _button("previous change"), _button("next change")
        self.point = tuple(map(_state, self.task.input_labels, self.task.low, self.task.high))
        label = widgets.Label("play the run", layout={"flex": "0 0 auto"})
        row = widgets.HBox([label, self.player, self.previous, self.next])
        super().__init__(row, self.iteration, *self.point)
        self._put(*self.turn())
        self.player.observe(self._play, names="value")
        self.previous.on_click(lambda _: self._jump(-1))
        self.next.on_click(lambda _: self._jump(1))
        for control in (self.iteration, *self.point):
            control.observe(self._answer, names="value")

    def turn(self) -> tuple[str, Page]:
        """The page of the slider's iteration; the player and the buttons follow the slider."""
        n = self.iteration.value
        self.player.value = self._place(n)
        self.previous.disabled, self.next.disabled = not self._ahead(-1), not self._ahead(1)
        return f"that of iteration {n}", self.show(n)

    def _place(self, n: int) -> int:
        """The player's position for iteration n: the last one it shows up to n."""
        return bisect.bisect(self._played, n) - 1

    def _play(self, change: dict) -> None:
        if change["new"] != self._place(self.iteration.value):  # else the slider moved the player
            self.iteration.value = self._played[change["new"]]

    def _ahead(self, way: int) -> list[int]:
        """The iterations with a split or merge after (`way` 1) or before (-1) the current one, the nearest first."""
        return [n for n in self._passes[::way] if way * (n - self.iteration.value) > 0]

    def _jump(self, way: int) -> None:
        self.iteration.value = self._ahead(way)[0]

    def show(self, n: int) -> Page:
        """The page of iteration n."""
        point = np.array([slider.value for slider in self.point])
        policy, words = self.growth.history.policy_at(n), self.growth.words(n)
        cell = int(policy.cells(point))
        place = ", ".join(f"{name} = {value:.3f}" for name, value in zip(self.task.inputs, point))
        codeword = ", ".join(f"{value:.3f}" for value in policy.codewords[cell])
        where = f"The chosen state, {place}, is in the cell of the codeword ({codeword}). There the copy has:"
        equations = "".join(f"<li><code>{html.escape(line)}</code></li>" for line in policy.equations(cell))
        drawn = "The teacher's policy map, the copy's with its cells, and the number of cells over the iterations."
        text = f"<p>{words}</p><p>{where}</p><ul>{equations}</ul>{_table(self._actions(policy, point), '{:.3f}')}"
        return Page(self.growth.shoot(n, point=point), f"{words} {drawn}", text)

    def _actions(self, policy: VoronoiPolicy, point: np.ndarray) -> pd.DataFrame:
        """The actions of both policies in a state (2,), a row per action; of the copy also before clipping."""
        limits = [f"{low:g} to {high:g}" for low, high in zip(self.task.action_low, self.task.action_high)]
        return pd.DataFrame(
            {"action": self.task.outputs, "teacher": self.teacher.predict(point)[0]}
            | {"equation gives": policy.linear(point), "limits": limits, "copy": policy.predict(point)[0]}
        )

    def strip(self) -> list[Page]:
        """Pages of three iterations."""
        return [self.show(round(share * (len(self.growth) - 1))) for share in STATIC]
