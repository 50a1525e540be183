"""A distillation to play with in JupyterLab: a run under a slider, and a laboratory where its settings are changed.

Widgets (ipywidgets) are a thin layer here over what `animation.py` draws. Where no kernel runs, and so no widget can
answer, some of the pages stand there as still pictures. Notebooks call the classes `replay` and `laboratory`.
"""

from __future__ import annotations

import bisect
import dataclasses
import html
import math
from typing import NamedTuple

import ipywidgets as widgets
import numpy as np
import pandas as pd
from IPython.display import display

from . import figures
from .animation import Growth, Maps, check_plays
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
PLAYED = 80  # iterations that the player shows, beside those that split or merged
DPI = 180
N_STARTS = 300  # shared start states that the laboratory judges by
EVALUATION_SEED = 1  # of these
# Share of the iterations that the laboratory plays, so that a trial takes less than 2 s. Fixed, not timed: the same
# settings must give the same cells on any machine. A network's step takes three times as long as a linear map's.
SHARE = {"quadratic": 0.8, "network": 0.4}
# How far the laboratory's sliders reach, in multiples of the setting they begin with. Half the distance makes three to
# four times the cells, which is what bounds the time of a trial from above.
REACH = {"max_pol_loss": (1e-2, 1e4), "min_pol_distance": (0.5, 3.0), "min_param_distance": (0.2, 4.0)}
# The trials that it begins with: the settings as they are, and two in which one of them is so many times larger
FIRST = ({}, {"max_pol_loss": 1e3}, {"min_pol_distance": 2.0})
SHOWN = 8  # trials in the table

_LABELS = {"style": {"description_width": "145px"}, "layout": {"width": "455px"}}
# A page that is opened later knows the controls no more, but their place. So the strip is there too, hidden while they
# live; and it hides the error in their place.
_STYLE = """<style>
.jp-OutputArea-child:has(.vsp-controls) + .jp-OutputArea-child:has(.vsp-strip),
.jp-OutputArea-child:has(+ .jp-OutputArea-child .vsp-strip):not(:has(.vsp-controls)) { display: none }
</style>"""


class Page(NamedTuple):
    """A picture (height, width, 3) with its alternative text, and what is written beside it, as HTML."""

    image: np.ndarray
    alt: str
    text: str

    def still(self) -> str:
        """The page as HTML, with a small picture, and the text below it."""
        picture = figures.embedded(png(self.image, small=True), self.alt)
        return f"<figure>{picture}<figcaption>{self.text}</figcaption></figure>"


class Explorer:
    """What a notebook shows: controls and a page where a kernel runs, else a strip of three pages."""

    ready, busy = "", ""  # what the status says
    height = "300px"  # kept for the text, so that the picture below stays where it is

    def __init__(self, *controls: widgets.Widget):
        self.status, self.picture = widgets.HTML(self.ready), widgets.HTML()
        self.text = widgets.HTML(layout={"flex": "1 1 440px", "min_width": "0", "min_height": self.height})
        beside = widgets.VBox([*controls, self.status], layout={"width": "470px", "max_width": "100%"})
        above = widgets.HBox([beside, self.text], layout={"flex_flow": "row wrap"})
        self.view = widgets.VBox([above, self.picture])
        self.view.add_class("vsp-controls")

    def turn(self) -> tuple[str, Page]:
        """The page that the controls ask for, and its name."""
        raise NotImplementedError

    def strip(self) -> list[Page]:
        """Three pages, for where no kernel runs."""
        raise NotImplementedError

    def _answer(self, _=None) -> None:
        """Show the page that the controls ask for. What fails is said beside them too, for a notebook only logs it."""
        self.status.value = self.busy
        try:
            name, page = self.turn()
        except BaseException as error:  # also where the kernel is interrupted
            said = html.escape(f"{type(error).__name__}: {error}")
            self.status.value = f"<b>failed</b>: {said}. The picture below is {self._shown}."
            raise
        self._put(name, page)
        self.status.value = self.ready

    def _put(self, name: str, page: Page) -> None:
        self._shown, self.text.value = name, f'<div class="jp-RenderedHTMLCommon">{page.text}</div>'
        self.picture.value = figures.embedded(png(page.image), page.alt)

    def _ipython_display_(self) -> None:
        """Two outputs, for of one that holds both JupyterLab shows the widget alone, even where it cannot."""
        about = {"text/plain": type(self).__doc__.split("\n")[0]}
        display({**self.view._repr_mimebundle_(), **about}, raw=True)
        strip = "\n".join(page.still() for page in self.strip())
        display({"text/html": f'{_STYLE}<div class="vsp-strip">{strip}</div>', **about}, raw=True)


class Replay(Explorer):
    """Replay of a distillation: the partition at any iteration, and what teacher and copy do in a chosen state.

    Raises ValueError for another task than the paper's, for a history of another method or task, and for a teacher that
    does not play the task.
    """

    def __init__(self, teacher: Policy, task: str | Task, history: History):
        self.teacher, self.task = teacher, get_task(task)
        self.growth = Growth(history, teacher, task, dpi=DPI, chosen=True)
        self._passes = sorted({event.iteration for event in history.events})
        self._played = sorted({*self.growth.moments(PLAYED), *self._passes})
        self.iteration = widgets.IntSlider(0, 0, len(self.growth) - 1, description="iteration n", **_LABELS)
        about = {"tooltip": "play the run", "layout": {"width": "100px"}}  # its buttons have no words
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
        """The page of the iteration that the slider is at; the player and the buttons follow it."""
        n = self.iteration.value
        self.player.value = self._place(n)
        self.previous.disabled, self.next.disabled = not self._ahead(-1), not self._ahead(1)
        return f"that of iteration {n}", self.show(n)

    def _place(self, n: int) -> int:
        """Of the last iteration up to n that the player shows: it goes on from there."""
        return bisect.bisect(self._played, n) - 1

    def _play(self, change: dict) -> None:
        if change["new"] != self._place(self.iteration.value):  # else the slider moved the player
            self.iteration.value = self._played[change["new"]]

    def _ahead(self, way: int) -> list[int]:
        """The iterations that split or merged, forwards (1) or back (-1), the nearest first."""
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
        alt = (
            f"{words} The teacher's policy map, the copy's with its cells, and the number of cells over the iterations."
        )
        text = f"<p>{words}</p><p>{where}</p><ul>{equations}</ul>{_table(self._actions(policy, point), '{:.3f}')}"
        return Page(self.growth.shoot(n, point=point), alt, text)

    def _actions(self, policy: VoronoiPolicy, point: np.ndarray) -> pd.DataFrame:
        """What teacher and copy do in a state (2,), a row per action; the copy's equation may give more than it may."""
        limits = [f"{low:g} to {high:g}" for low, high in zip(self.task.action_low, self.task.action_high)]
        return pd.DataFrame(
            {"action": self.task.outputs, "teacher": self.teacher.predict(point)[0]}
            | {"equation gives": policy.linear(point), "limits": limits, "copy": policy.predict(point)[0]}
        )

    def strip(self) -> list[Page]:
        """Pages of three moments of the run."""
        return [self.show(round(share * (len(self.growth) - 1))) for share in MOMENTS]


class Laboratory(Explorer):
    """Laboratory: a distillation at each change of a setting, with its cells and its return beside earlier trials.

    `config` is where the controls begin, the paper's preset if None. Raises ValueError for another task than the
    paper's, for a `Refinement`, and for a teacher that does not play the task.
    """

    ready, busy, height = "Change a setting: a distillation follows, in about a second.", "distilling …", "395px"

    def __init__(self, teacher: Policy, task: str | Task, config: Config | None = None, *, seed: int = 0):
        self.teacher, self.task, self.seed = Remembered(teacher), get_task(task), seed
        self.maps = Maps(self.task)
        check_plays(teacher, self.task)
        self.config = preset(self.task.name) if config is None else config
        if not isinstance(self.config, Config):
            raise ValueError(f"config is a {type(self.config).__name__}, expected a Config: it has no cells to split")
        self.trials: list[tuple[Config, VoronoiPolicy, dict]] = []
        self._own = _judge(self.teacher, self.task)
        self.settings = {name: self._slider(name) for name in REACH}
        fitting = [name for name in FORMS if self._fits(name)]
        self.settings["sub_policy"] = widgets.Dropdown(
            options=fitting, value=self.config.sub_policy, description="sub-policy", **_LABELS
        )
        self.back = _button("back to trial 1")
        super().__init__(*self.settings.values(), self.back)
        for changes in FIRST:
            self.trial({name: times * getattr(self.config, name) for name, times in changes.items()})
        self.stage, self._axes = self._set_stage()
        self._put("trial 1", self.show(0))
        self.back.on_click(self._go_back)
        self._listen(True)

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
        figures.codewords(axes[1], np.zeros((0, 2)))
        self._draw_trials(axes, self.to_frame(), 0)
        handles = [handle for ax in axes[1:] for handle in ax.get_legend_handles_labels()[0]]
        fig.legend(handles=handles, frameon=False, loc="outside lower center", ncol=len(handles))
        stage = Stage(fig)
        fig.set_layout_engine("none")  # from now on: no panel moves from trial to trial
        return stage, axes

    def _draw_trials(self, axes: np.ndarray, frame: pd.DataFrame, place: int) -> None:
        axes[2].clear()
        trials(teacher_line(axes[2], self._own["mean"]), frame, place)
        figures.letter(axes, ["teacher", "copy", "trials"])

    def _listen(self, on: bool) -> None:
        for control in self.settings.values():
            (control.observe if on else control.unobserve)(self._answer, names="value")

    def _go_back(self, _=None) -> None:
        """All settings at once to where they began, for one trial."""
        self._listen(False)
        for name, control in self.settings.items():
            control.value = getattr(self.config, name)
        self._listen(True)
        self._answer()

    def turn(self) -> tuple[str, Page]:
        """The page of the trial with the settings as they are."""
        place = self.trial({name: control.value for name, control in self.settings.items()})
        return f"trial {place + 1}", self.show(place)

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
        rounded = {name: _rounded(value) for name, value in changes.items()}
        changed = {name: value for name, value in rounded.items() if value != _rounded(getattr(self.config, name))}
        config = dataclasses.replace(self.config, **changed)
        share = SHARE.get(config.sub_policy, 1.0)
        parts = {name: max(1, round(share * getattr(config, name))) for name in ("n_epochs", "n_freeze")}
        return dataclasses.replace(config, **parts)

    def to_frame(self) -> pd.DataFrame:
        """One row per trial: what came out, and its settings."""
        rows = [
            {"cells": len(policy), "mean return": result["mean"], "failures": result["failures"]}
            | {name: getattr(config, name) for name in self.settings}
            for config, policy, result in self.trials
        ]
        return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trial"))

    def show(self, place: int, *, among: int | None = None) -> Page:
        """The page of a trial, beside the first `among` trials (None: all)."""
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
        """The table: the newest trials, that at `place` among them with an arrow, under heads that wrap."""
        rows = sorted({*range(len(frame))[-SHOWN:]} - {place})[-(SHOWN - 1) :] + [place]
        table = frame.iloc[sorted(rows, reverse=True)].reset_index()
        table["trial"] = [
            f"→\N{NO-BREAK SPACE}{number}" if number == place + 1 else str(number) for number in table["trial"]
        ]
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
        """Pages of the first three trials, each as it was when no later one was there."""
        return [self.show(place, among=place + 1) for place in range(len(FIRST))]


replay, laboratory = Replay, Laboratory


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


def _rounded(value: object) -> object:
    """A slider says 0.30000000000000004."""
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _button(description: str) -> widgets.Button:
    return widgets.Button(description=description, layout={"width": "auto", "align_self": "flex-start"})


def _state(name: str, low: float, high: float) -> widgets.FloatSlider:
    """A slider over one input, in a hundred steps."""
    about = {"description": f"state: {name}", "readout_format": ".3f", **_LABELS}
    return widgets.FloatSlider(low + 0.7 * (high - low), min=low, max=high, step=(high - low) / 100, **about)


def _table(frame: pd.DataFrame, number: str) -> str:
    return frame.to_html(float_format=number.format, border=0, index=False)
