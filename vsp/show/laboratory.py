"""`Laboratory`: change settings, say what to expect, distil again, and draw the result with the explorer."""

import dataclasses
import math
from typing import Any

import ipywidgets as widgets
import numpy as np
import pandas as pd

from ..algorithms import distill
from ..config import PAPER_TASKS, Config, paper_preset
from ..policy import VoronoiPolicy
from ..rollouts import Policy, rollout
from ..tasks import GOAL, Task, get_task
from . import page
from .explorer import Explorer, scene_of
from .explorer.scene import N_STARTS, starts_of, to_json
from .explorer.view import View

# Range of each slider, as multiples of the initial setting. Half the distance gives three to four times the cells, so
# these limits keep a trial short.
REACH = {"max_pol_loss": (1e-2, 1e4), "min_pol_distance": (0.5, 3.0), "min_param_distance": (0.2, 4.0)}
DRAWN = ("linear", "constant")  # sub-policies that the explorer draws: a constant is a linear map without weights
SHOWN = 8  # trials in the table and in the explorer

_WITHOUT = "<p>The laboratory's controls need a kernel: run this cell in JupyterLab (again). Here is trial 1.</p>"
_LABELS = {"style": {"description_width": "145px"}, "layout": {"width": "455px"}}


class Laboratory:
    """Laboratory: change settings, say what to expect, distil, explore the policy, and compare it with earlier trials.

    `config` holds the initial settings, to six digits, by default the paper's preset. Raises ValueError for tasks other
    than the paper's, for sub-policies that are not linear or constant, and for a teacher that cannot act in the task.
    """

    def __init__(self, teacher: Policy, task: str | Task, config: Config | None = None, *, seed: int = 0):
        self.teacher, self.task, self.seed = teacher, get_task(task), seed
        if self.task.name not in PAPER_TASKS:  # a run of others takes long
            raise ValueError(f"task is {self.task.name}, expected one of {list(PAPER_TASKS)}")
        self.config = paper_preset(self.task) if config is None else config
        if not isinstance(self.config, Config) or self.config.sub_policy not in DRAWN:
            raise ValueError(f"config is {self.config!r}, expected a Config whose sub_policy is one of {list(DRAWN)}")
        self._teacher_result = _judge(teacher, self.task)
        self.trials: list[tuple[Config, VoronoiPolicy, dict]] = []
        self.settings = {name: self._slider(name) for name in REACH}
        about = {"options": DRAWN, "description": "sub-policy", **_LABELS}
        self.settings["sub_policy"] = widgets.Dropdown(value=self.config.sub_policy, **about)
        self.expected = widgets.Text(description="I expect", placeholder="fewer cells, because ...", **_LABELS)
        self.distil, self.back = (widgets.Button(description=what) for what in ("distil", "back to trial 1"))
        self.status, self.text = widgets.HTML(), widgets.HTML(layout={"flex": "1 1 560px", "min_width": "0"})
        self.explorer = View()
        self._answer()
        controls = [*self.settings.values(), self.expected, widgets.HBox([self.distil, self.back]), self.status]
        left = widgets.VBox(controls, layout={"max_width": "100%"})
        above = widgets.HBox([left, self.text], layout={"flex_flow": "row wrap"})
        self.view = widgets.VBox([above, self.explorer]).add_class("vsp-controls")
        self.distil.on_click(self._answer)
        self.back.on_click(self._go_back)

    def _slider(self, name: str) -> widgets.Widget:
        """A slider over the range in `REACH`: logarithmic for a loss, linear for a distance."""
        value = getattr(self.config, name)
        low, high = (value * times for times in REACH[name])
        about = {"description": name, **_LABELS}
        if name == "max_pol_loss":
            low, high = math.log10(low), math.log10(high)
            return widgets.FloatLogSlider(value, min=low, max=high, step=0.5, readout_format=".1e", **about)
        return widgets.FloatSlider(value, min=low, max=high, step=value / 10, readout_format=".3f", **about)

    def _go_back(self, _=None) -> None:
        """Reset all settings, and show trial 1."""
        for name, control in self.settings.items():
            control.value = getattr(self.config, name)
        self._answer()

    def _answer(self, _=None) -> None:
        """Distil with the current settings, unless an earlier trial had them, and show the trial."""
        self.status.value = "distilling …"
        chosen = {name: _rounded(control.value) for name, control in self.settings.items()}
        config = dataclasses.replace(self.config, **chosen)
        place = next((n for n, (tried, *_) in enumerate(self.trials) if tried == config), len(self.trials))
        if place == len(self.trials):
            policy, _ = distill(self.teacher, self.task, config, seed=self.seed)
            self.trials.append((config, policy, _judge(policy, self.task) | {"I expected": self.expected.value}))
            self.expected.value = ""
        self._put(place)
        self.status.value = "Change a setting, say what you expect, and distil: about a second."

    def to_frame(self) -> pd.DataFrame:
        """Return one row per trial: its results and its settings."""
        rows = [
            {"cells": len(policy), **result} | {name: getattr(config, name) for name in self.settings}
            for config, policy, result in self.trials
        ]
        return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trial"))

    def _put(self, place: int) -> None:
        """Show a trial beside the newest others: the explorer, and a table in which an arrow marks it."""
        others = [n for n in reversed(range(len(self.trials))) if n != place][: SHOWN - 1]
        table = self.to_frame().iloc[sorted([*others, place], reverse=True)].reset_index()
        table["trial"] = [f"→\N{NO-BREAK SPACE}{n}" if n == place + 1 else str(n) for n in table["trial"]]
        table.columns = [name.replace("_", " ") for name in table]  # heads that can wrap
        page = table.to_html(float_format="{:.4g}".format, border=0, index=False)
        self.text.value = f'<div class="jp-RenderedHTMLCommon"><p>{self.words(place)}</p>{page}</div>'
        policies = {f"trial {n + 1}": _as_linear(self.trials[n][1]) for n in (place, *others)}
        scene = scene_of(policies, self.task) | {"teacher": {"mean": self._teacher_result["mean return"]}}
        self.explorer.scene = to_json(scene)

    def words(self, place: int) -> str:
        """Describe the results of a trial and of the teacher."""
        (_, policy, result), teacher = self.trials[place], self._teacher_result
        return (
            f"Trial {place + 1}: {len(policy)} cell{'s' * (len(policy) > 1)}, mean return {result['mean return']:.2f}; "
            f"{result['failures'] or 'none'} of {N_STARTS} starts fail to reach the goal. The teacher: mean return "
            f"{teacher['mean return']:.2f}, {teacher['failures'] or 'no'} failures."
        )

    def _ipython_display_(self) -> None:
        still = _WITHOUT + Explorer({"trial 1": _as_linear(self.trials[0][1])}, teacher=self.teacher).element()
        page.show(self.view._repr_mimebundle_(), still, (type(self).__doc__ or "").split("\n")[0])


def _as_linear(policy: VoronoiPolicy) -> VoronoiPolicy:
    """Return the policy with linear maps; a constant becomes a map with zero weights."""
    weights = np.zeros((len(policy), len(policy.task.low) + 1 - policy.coefficients.shape[1], len(policy.task.outputs)))
    return policy.with_maps(np.concatenate([weights, policy.coefficients], axis=1))


def _judge(policy: Policy, task: Task) -> dict[str, float]:
    """Return the mean return and the number of episodes that miss the goal, from the explorer's starts."""
    result = rollout(policy, task, starts_of(task))
    return {"mean return": float(result.returns.mean()), "failures": int((result.outcomes != GOAL).sum())}


def _rounded(value: Any) -> Any:
    """Round to six significant digits: a slider's value may be 0.30000000000000004."""
    return float(f"{value:.6g}") if isinstance(value, float) else value
