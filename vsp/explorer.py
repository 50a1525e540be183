"""A distillation to play with in JupyterLab: a run under a slider, and a laboratory where its settings are changed.

Widgets (ipywidgets) are a thin layer here over what `animation.py` draws. Where no kernel runs, and so no widget can
answer, the same output shows some of its pages as still pictures.
"""

from __future__ import annotations

import base64
import dataclasses
import html
import math

import ipywidgets as widgets
import numpy as np
import pandas as pd

from . import figures
from .animation import Growth, Maps
from .config import Config, preset
from .distill import distill
from .envs import Task, get_task
from .evaluate import evaluate
from .figures_explorer import Stage, png, teacher_line, trials
from .history import History
from .policy import VoronoiPolicy
from .rollouts import Policy
from .subpolicies import FORMS, form_of

MOMENTS = (0.01, 0.1, 1.0)  # of a run, on the pages that need no kernel: shares of its iterations
DPI = 180
N_STARTS = 300  # shared start states that the laboratory judges by
EVALUATION_SEED = 1  # of these
# Share of the iterations that the laboratory plays, so that a trial takes less than 2 s. Fixed, not timed: the same
# settings must give the same cells on any machine. Only networks, whose step is three times as long, need it.
SHARE = {"network": 0.4}
# How far the laboratory's sliders reach, in multiples of the setting they begin with. Half the distance makes three to
# four times the cells, which is what bounds the time of a trial from above.
REACH = {"max_pol_loss": (1e-2, 1e4), "min_pol_distance": (0.5, 3.0), "min_param_distance": (0.2, 4.0)}
# The trials that it begins with: the settings as they are, and two in which one of them is so many times larger
FIRST = ({}, {"max_pol_loss": 1e3}, {"min_pol_distance": 2.0})
SHOWN = 8  # trials in the table

_LABELS = {"style": {"description_width": "150px"}, "layout": {"width": "480px"}}


class Explorer:
    """What a notebook shows: controls and a page where a kernel runs, else a strip of pages."""

    def __init__(self, *controls: widgets.Widget):
        self.page = widgets.HTML()
        self.view = widgets.VBox([*controls, self.page])

    def strip(self) -> list[str]:
        """The pages that need no kernel, as HTML."""
        raise NotImplementedError

    def _repr_mimebundle_(self, **kwargs) -> dict:
        about = type(self).__doc__.split("\n")[0]
        return {**self.view._repr_mimebundle_(**kwargs), "text/html": "\n".join(self.strip()), "text/plain": about}


def replay(teacher: Policy, task: str | Task, history: History) -> Replay:
    """A run of `vsp.distill` under a slider, for the tasks of the paper; see `Replay`.

    Raises ValueError for another task, and for a history of another method.
    """
    return Replay(teacher, task, history)


def laboratory(teacher: Policy, task: str | Task, config: Config | None = None, *, seed: int = 0) -> Laboratory:
    """Sliders for the settings of a distillation, which is made anew at each change; see `Laboratory`.

    `config` is where the sliders begin, the paper's preset if None. Raises ValueError for another task than the
    paper's, and for a `Refinement`.
    """
    return Laboratory(teacher, task, config, seed=seed)


class Replay(Explorer):
    """Replay of a distillation: the partition at any iteration, and what teacher and copy do in a chosen state."""

    def __init__(self, teacher: Policy, task: str | Task, history: History):
        self.teacher, self.task = teacher, get_task(task)
        self.growth = Growth(history, teacher, task, dpi=DPI, chosen=True)
        self._passes = sorted({event.iteration for event in history.events})
        last = len(self.growth) - 1
        self.iteration = widgets.IntSlider(0, 0, last, description="iteration n", **_LABELS)
        self.player = widgets.Play(min=0, max=last, step=max(1, last // 100), interval=150, description="play the run")
        widgets.jslink((self.player, "value"), (self.iteration, "value"))
        self.previous = widgets.Button(description="previous change", icon="step-backward", layout={"width": "170px"})
        self.next = widgets.Button(description="next change", icon="step-forward", layout={"width": "170px"})
        self.previous.on_click(lambda _: self._jump(-1))
        self.next.on_click(lambda _: self._jump(1))
        self.point = tuple(
            widgets.FloatSlider(
                low + 0.7 * (high - low), min=low, max=high, step=(high - low) / 100, readout_format=".3f",
                description=f"state: {name}", **_LABELS,
            )
            for name, low, high in zip(self.task.input_labels, self.task.low, self.task.high)
        )  # fmt: skip
        super().__init__(widgets.HBox([self.player, self.previous, self.next]), self.iteration, *self.point)
        for control in (self.iteration, *self.point):
            control.observe(self._turn, names="value")
        self._turn()

    def _turn(self, _=None) -> None:
        self.page.value = self.show(self.iteration.value)

    def _jump(self, way: int) -> None:
        """To the nearest iteration, forwards (1) or back (-1), that split or merged; nowhere if there is none."""
        ahead = [n for n in self._passes if way * (n - self.iteration.value) > 0]
        if ahead:
            self.iteration.value = ahead[0] if way > 0 else ahead[-1]

    def show(self, n: int, *, small: bool = False) -> str:
        """The page of iteration n as HTML (`small`: with a small picture)."""
        point = np.array([slider.value for slider in self.point])
        policy = self.growth.history.policy_at(n)
        cell, words = int(policy.cells(point)), self.growth.words(n)
        place = ", ".join(f"{name} = {value:.3f}" for name, value in zip(self.task.inputs, point))
        codeword = ", ".join(f"{value:.3f}" for value in policy.codewords[cell])
        where = f"The chosen state, {place}, is in cell {cell}, whose codeword is ({codeword}). There:"
        actions = {"teacher": self.teacher.predict(point)[0], "copy": policy.predict(point)[0]}
        table = pd.DataFrame({"action": self.task.outputs, **actions})
        equations = "".join(f"<li><code>{html.escape(line)}</code></li>" for line in policy.equations(cell))
        shown = f"<p>{words}</p><p>{where}</p><ul>{equations}</ul>{_table(table, '{:.3f}')}"
        alt = (
            f"{words} The teacher's policy map, the copy's with its cells, and the number of cells over the iterations."
        )
        return _page(self.growth.shoot(n, point=point), alt, shown, small)

    def strip(self) -> list[str]:
        """Pages of three moments of the run."""
        return [self.show(round(share * (len(self.growth) - 1)), small=True) for share in MOMENTS]


class Laboratory(Explorer):
    """Laboratory: a distillation at each change of a setting, with its cells and its return beside earlier trials."""

    def __init__(self, teacher: Policy, task: str | Task, config: Config | None = None, *, seed: int = 0):
        self.teacher, self.task, self.seed = Remembered(teacher), get_task(task), seed
        self.maps = Maps(self.task)
        self.config = preset(self.task.name) if config is None else config
        if not isinstance(self.config, Config):
            raise ValueError(f"config is a {type(self.config).__name__}, expected a Config: it has no cells to split")
        self.trials: list[tuple[Config, VoronoiPolicy, dict]] = []
        self._own = _judge(self.teacher, self.task)
        self.stage, self._axes = self._set_stage()
        self.settings = {name: self._slider(name) for name in REACH}
        fitting = [name for name in FORMS if self._fits(name)]
        self.settings["sub_policy"] = widgets.Dropdown(
            options=fitting, value=self.config.sub_policy, description="sub-policy", **_LABELS
        )
        self.status = widgets.Label("change a setting: a distillation follows, in about a second")
        super().__init__(*self.settings.values(), self.status)
        for changes in FIRST:
            self.trial({name: times * getattr(self.config, name) for name, times in changes.items()})
        self.page.value = self.show(0)
        for control in self.settings.values():
            control.observe(self._change, names="value")

    def _slider(self, name: str) -> widgets.Widget:
        """From the least to the most in `REACH`: a loss by orders of magnitude, a distance in even steps."""
        value = getattr(self.config, name)
        low, high = (value * times for times in REACH[name])
        about = {"description": name, "continuous_update": False, **_LABELS}
        if name == "max_pol_loss":
            low, high = math.log10(low), math.log10(high)
            return widgets.FloatLogSlider(value, min=low, max=high, step=0.5, readout_format=".1e", **about)
        return widgets.FloatSlider(value, min=low, max=high, step=value / 10, readout_format=".3f", **about)

    def _fits(self, sub_policy: str) -> bool:
        """Whether the task and the configuration allow this class of sub-policy."""
        try:
            dataclasses.replace(self.config, sub_policy=sub_policy)
            form_of(sub_policy, self.task)
        except ValueError:
            return False
        return True

    def _set_stage(self) -> tuple[Stage, np.ndarray]:
        fig, axes = self.maps.panels(self.teacher, DPI)
        figures.legend_below(fig, figures.codewords(axes[1], np.zeros((0, 2))), ncol=3)
        return Stage(fig), axes

    def _change(self, _=None) -> None:
        self.status.value = "distilling …"
        place = self.trial({name: control.value for name, control in self.settings.items()})
        self.page.value = self.show(place)
        self.status.value = "done"

    def trial(self, changes: dict[str, object]) -> int:
        """Distil and judge with those fields of the configuration changed; returns the trial's place in `trials`, that
        of an earlier one if it had the same settings."""
        config = self._config(changes)
        for place, (earlier, _, _) in enumerate(self.trials):
            if earlier == config:
                return place
        policy, _ = distill(self.teacher, self.task, config, seed=self.seed)
        self.trials.append((config, policy, _judge(policy, self.task)))
        return len(self.trials) - 1

    def _config(self, changes: dict[str, object]) -> Config:
        """The configuration of a trial, with as many iterations as its class of sub-policy is granted."""
        rounded = {name: float(f"{v:.6g}") if isinstance(v, float) else v for name, v in changes.items()}
        config = dataclasses.replace(self.config, **rounded)  # a slider says 0.30000000000000004
        share = SHARE.get(config.sub_policy, 1.0)
        parts = {name: max(1, round(share * getattr(config, name))) for name in ("n_epochs", "n_freeze")}
        return dataclasses.replace(config, **parts)

    def to_frame(self) -> pd.DataFrame:
        """One row per trial: its settings and what came out."""
        rows = [
            {name: getattr(config, name) for name in self.settings}
            | {"iterations": config.n_epochs, "cells": len(policy), "mean return": result["mean"]}
            | {"failures": result["failures"]}
            for config, policy, result in self.trials
        ]
        return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trial"))

    def show(self, place: int, *, among: int | None = None, small: bool = False) -> str:
        """The page of a trial as HTML, beside the first `among` trials (None: all)."""
        policy, result = self.trials[place][1:]
        frame = self.to_frame()[:among]
        words = (
            f"Trial {place + 1}: {len(policy)} cells, mean return {result['mean']:.2f}; {result['failures']} of "
            f"{N_STARTS} starts do not reach the goal. The teacher: {self._own['mean']:.2f}; {self._own['failures']}. "
            f"Played: {frame['iterations'].iloc[place]} of {self.config.n_epochs} iterations."
        )
        settings = ", ".join(f"{name} {value}" for name, value in frame.iloc[place][list(self.settings)].items())
        alt = f"{words} With {settings}. The teacher's policy map, the copy's with its cells, and all trials so far."
        table = _table(frame[::-1].head(SHOWN).reset_index(), "{:.4g}")
        return _page(self._shoot(policy, frame, place), alt, f"<p>{words}</p>{table}", small)

    def _shoot(self, policy: VoronoiPolicy, frame: pd.DataFrame, place: int) -> np.ndarray:
        self._axes[2].clear()
        trials(teacher_line(self._axes[2], self._own["mean"]), frame, place).legend(fontsize=6)
        figures.letter(self._axes, ["teacher", "copy", "trials"])
        self.stage.stand()

        def paint() -> None:
            self.maps.policy(self._axes[1], policy)
            for ax in self._axes[:2]:
                self.maps.cells(ax, policy)

        return self.stage.shoot(paint)

    def strip(self) -> list[str]:
        """Pages of the first trials, each as it was when no later one was there."""
        return [self.show(place, among=place + 1, small=True) for place in range(len(FIRST))]


class Remembered:
    """A teacher that answers a batch of states it was asked before from memory, so that episodes cost it once.

    A distillation with the same seed begins its episodes in the same states, whatever the settings.
    """

    def __init__(self, teacher: Policy):
        self._teacher, self._answers = teacher, {}

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        """As the teacher does."""
        obs = np.asarray(obs)
        key = obs.shape, obs.dtype.str, obs.tobytes()
        if key not in self._answers:
            self._answers[key] = self._teacher.predict(obs)[0]
        return self._answers[key].copy(), None


def _judge(policy: Policy, task: Task) -> dict[str, float]:
    """Mean return, and how many of the shared starts do not end in the goal."""
    result = evaluate(policy, task, N_STARTS, seed=EVALUATION_SEED)
    return {"mean": result["return"].mean(), "failures": int((result["outcome"] != "goal").sum())}


def _page(image: np.ndarray, alt: str, shown: str, small: bool) -> str:
    """A picture with its alternative text, and what is written below it."""
    data = base64.b64encode(png(image, small=small)).decode()
    height, width = image.shape[:2]
    size = f'width="720" height="{round(720 * height / width)}"'  # given, so that nothing jumps while it loads
    return (
        f'<figure><img alt="{html.escape(alt)}" src="data:image/png;base64,{data}" {size} decoding="sync">'
        f"<figcaption>{shown}</figcaption></figure>"
    )


def _table(frame: pd.DataFrame, number: str) -> str:
    return frame.to_html(float_format=number.format, border=0, index=False)
