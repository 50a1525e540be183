"""`Laboratory`: a distillation at each change of a setting."""

from __future__ import annotations

import dataclasses
import math

import ipywidgets as widgets
import numpy as np
import pandas as pd

from ..algorithms import distill
from ..config import Config, paper_preset
from ..evaluation import evaluate
from ..policy import VoronoiPolicy
from ..rollouts import Policy
from ..subpolicies.registry import POLICY_CLASSES, policy_class
from ..tasks.base import Task
from ..tasks.registry import get_task
from . import state_space, style
from .animation import Maps, check_plays
from .page import _LABELS, DPI, Controls, Page, _button, _table
from .stage import Stage, trials

N_STARTS, EVALUATION_SEED = 300, 1  # shared start states for the evaluation of every trial, and their seed
# Share of the iterations that a trial runs, so that it takes less than 2 s. Fixed, not timed: the same settings must
# give the same cells on any machine. A step of a network takes three times as long as one of a linear map.
SHARE = {"quadratic": 0.8, "network": 0.4}
# Range of each slider, as multiples of the initial setting. Half the distance makes three to four times the cells,
# which limits the time of a trial.
REACH = {"max_pol_loss": (1e-2, 1e4), "min_pol_distance": (0.5, 3.0), "min_param_distance": (0.2, 4.0)}
# The first trials: the initial settings, and two in which one setting is so many times larger
FIRST = ({}, {"max_pol_loss": 1e3}, {"min_pol_distance": 2.0})
SHOWN = 8  # trials in the table


class Laboratory(Controls):
    """Laboratory: a distillation at each change of a setting, with its cells and its return beside earlier trials.

    `config` holds the initial settings, by default the paper's preset. Raises ValueError for tasks other than the
    paper's, for a `Refinement`, and for a teacher that does not play the task.
    """

    ready, busy, height = "Change a setting: a distillation follows, in about a second.", "distilling …", "395px"

    def __init__(self, teacher: Policy, task: str | Task, config: Config | None = None, *, seed: int = 0):
        self.teacher, self.task, self.seed = Remembered(teacher), get_task(task), seed
        self.maps = Maps(self.task)
        check_plays(teacher, self.task)
        self.config = paper_preset(self.task) if config is None else config
        if not isinstance(self.config, Config):
            raise ValueError(f"config is a {type(self.config).__name__}, expected a Config: it has no cells to split")
        self.trials: list[tuple[Config, VoronoiPolicy, dict]] = []
        self._own = _judge(self.teacher, self.task)
        self.settings = {name: self._slider(name) for name in REACH}
        about = {"options": list(filter(self._fits, POLICY_CLASSES)), "description": "sub-policy", **_LABELS}
        self.settings["sub_policy"] = widgets.Dropdown(value=self.config.sub_policy, **about)
        self.back = _button("back to trial 1")
        super().__init__(*self.settings.values(), self.back)
        for changes in FIRST:
            self.trial({name: times * getattr(self.config, name) for name, times in changes.items()})
        self.stage, self._axes = self._set_stage()
        self._put("trial 1", self.show(0))
        self.back.on_click(self._go_back)
        self._listen(True)

    def _slider(self, name: str) -> widgets.Widget:
        """A slider over the range in `REACH`: logarithmic for a loss, linear for a distance."""
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
            policy_class(sub_policy, self.task)
        except ValueError:
            return False
        return True

    def _set_stage(self) -> tuple[Stage, np.ndarray]:
        fig, axes = self.maps.panels(self.teacher, DPI)
        state_space.codewords(axes[1], np.zeros((0, 2)))
        self._draw_trials(axes, self.to_frame(), 0)
        handles = [handle for ax in axes[1:] for handle in ax.get_legend_handles_labels()[0]]
        fig.legend(handles=handles, frameon=False, loc="outside lower center", ncol=len(handles))
        stage = Stage(fig)
        fig.set_layout_engine("none")  # keeps the panels in place from trial to trial
        return stage, axes

    def _draw_trials(self, axes: np.ndarray, frame: pd.DataFrame, place: int) -> None:
        axes[2].clear()
        trials(axes[2], frame, place, self._own["mean"])
        style.letter(axes, ["teacher", "copy", "trials"])

    def _listen(self, on: bool) -> None:
        for control in self.settings.values():
            (control.observe if on else control.unobserve)(self._answer, names="value")

    def _go_back(self, _=None) -> None:
        """Reset all settings at once, for a single trial."""
        self._listen(False)
        for name, control in self.settings.items():
            control.value = getattr(self.config, name)
        self._listen(True)
        self._answer()

    def turn(self) -> tuple[str, Page]:
        """The page of the trial with the current settings."""
        place = self.trial({name: control.value for name, control in self.settings.items()})
        return f"trial {place + 1}", self.show(place)

    def trial(self, changes: dict[str, object]) -> int:
        """Distil and evaluate with these fields of the configuration changed; return the index in `trials`.

        Settings that were tried before return that earlier trial.
        """
        config = self._config(changes)
        for place, (earlier, _, _) in enumerate(self.trials):
            if earlier == config:
                return place
        policy, _ = distill(self.teacher, self.task, config, seed=self.seed)
        self.trials.append((config, policy, _judge(policy, self.task)))
        return len(self.trials) - 1

    def _config(self, changes: dict[str, object]) -> Config:
        """The configuration of a trial, with the `SHARE` of the iterations for its class of sub-policy."""
        rounded = {name: _rounded(value) for name, value in changes.items()}
        changed = {name: value for name, value in rounded.items() if value != _rounded(getattr(self.config, name))}
        config = dataclasses.replace(self.config, **changed)
        share = SHARE.get(config.sub_policy, 1.0)
        parts = {name: max(1, round(share * getattr(config, name))) for name in ("n_epochs", "n_freeze")}
        return dataclasses.replace(config, **parts)

    def to_frame(self) -> pd.DataFrame:
        """One row per trial: its results and its settings."""
        rows = [
            {"cells": len(policy), "mean return": result["mean"], "failures": result["failures"]}
            | {name: getattr(config, name) for name in self.settings}
            for config, policy, result in self.trials
        ]
        return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trial"))

    def show(self, place: int, *, among: int | None = None) -> Page:
        """The page of a trial, compared with the first `among` trials (None: all)."""
        policy, frame, words = self.trials[place][1], self.to_frame()[:among], self._words(place)
        settings = ", ".join(f"{name} {value}" for name, value in frame.iloc[place][list(self.settings)].items())
        alt = f"{words} With {settings}. The teacher's policy map, the copy's with its cells, and all trials so far."
        text = f"<p>{words}</p>{_table(self._newest(frame, place), '{:.4g}')}"
        return Page(self._shoot(policy, frame, place), alt, text)

    def _words(self, place: int) -> str:
        config, policy, result = self.trials[place]
        cells = "1 cell" if len(policy) == 1 else f"{len(policy)} cells"
        text = (
            f"Trial {place + 1}: {cells}, mean return {result['mean']:.2f}; {result['failures'] or 'none'} of "
            f"{N_STARTS} starts fail to reach the goal. The teacher: mean return {self._own['mean']:.2f}, "
            f"{self._own['failures'] or 'no'} failures."
        )
        if config.n_epochs < self.config.n_epochs:
            text += f" This trial played only {config.n_epochs} of {self.config.n_epochs} iterations, to be quick."
        return text

    def _newest(self, frame: pd.DataFrame, place: int) -> pd.DataFrame:
        """The newest trials and the one at `place`, which an arrow marks; headers without underscores can wrap."""
        rows = sorted({*range(len(frame))[-SHOWN:]} - {place})[-(SHOWN - 1) :] + [place]
        table = frame.iloc[sorted(rows, reverse=True)].reset_index()
        table["trial"] = table["trial"].astype(str).replace(str(place + 1), f"→\N{NO-BREAK SPACE}{place + 1}")
        return table.rename(columns=lambda name: name.replace("_", " "))

    def _shoot(self, policy: VoronoiPolicy, frame: pd.DataFrame, place: int) -> np.ndarray:
        self._draw_trials(self._axes, frame, place)
        self.stage.stand()

        def paint() -> None:
            self.maps.policy(self._axes[1], policy)
            for ax in self._axes[:2]:
                self.maps.cells(ax, policy)

        return self.stage.shoot(paint)

    def strip(self) -> list[Page]:
        """Pages of the first three trials, each without the later ones."""
        return [self.show(place, among=place + 1) for place in range(len(FIRST))]


class Remembered:
    """A teacher whose answers to whole batches of states are cached.

    With one seed, a distillation starts its episodes in the same states whatever the settings: all trials share them.
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
    """The mean return, and how many of the shared starts do not end in the goal."""
    result = evaluate(policy, task, N_STARTS, seed=EVALUATION_SEED)
    return {"mean": result["return"].mean(), "failures": int((result["outcome"] != "goal").sum())}


def _rounded(value: object) -> object:
    """Six significant digits: a slider's value may be 0.30000000000000004."""
    return float(f"{value:.6g}") if isinstance(value, float) else value
