"""`Explorer`: policies of one task for a browser, as an element of a page or as a file of their own."""

from __future__ import annotations

import html
import io
import json
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ...history import History
from ...policy import VoronoiPolicy
from ...rollouts import Policy
from ...run import atomic
from .. import page, state_space, style
from .scene import PLANES, scene_of

SCRIPT = Path(__file__).with_name("explorer.js")
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>
body {{ font-family: system-ui, sans-serif; max-width: 60rem; margin: 1rem auto; padding: 0 1rem }}
h1 {{ overflow-wrap: anywhere }}
</style>
<h1>{title}</h1>
{body}
<script type="module">
{script}
mountAll()
</script>
</html>
"""


class Explorer:
    """Policies of one task, to be replayed, asked and changed in a browser.

    `policies`: names and policies with linear maps, all of one task among SimpleGoal, MountainCarContinuous and
    Pendulum; `history` replays the first of them. Raises ValueError for other policies.
    """

    def __init__(
        self, policies: dict[str, VoronoiPolicy], *, teacher: Policy | None = None, history: History | None = None
    ):
        for policy in policies.values():
            if not isinstance(policy, VoronoiPolicy) or policy.task.name not in PLANES:
                raise ValueError(f"the policy is {policy!r}, expected a VoronoiPolicy for one of {', '.join(PLANES)}")
            policy.check_linear()
        tasks = {policy.task.name: policy.task for policy in policies.values()}
        if len(tasks) != 1:
            raise ValueError(f"the policies play {sorted(tasks) or 'nothing'}, expected one task")
        self.policies, (self.task,) = policies, tasks.values()
        self.scene = scene_of(policies, self.task, teacher, history)

    def save(self, path: str | os.PathLike) -> None:
        """Write an HTML file that opens from disk, without any other file or host."""
        title = f"{self.task.name}: explore the policy"
        page = _PAGE.format(title=html.escape(title), body=self.element(), script=SCRIPT.read_text("utf-8"))
        atomic.write_text(path, page)

    def element(self, *, source: str | None = None) -> str:
        """HTML in which the script finds its scene, in it or in the file `source`; without a script, a picture."""
        said = f"<figcaption>{html.escape(self._alt())}</figcaption>"
        picture = f"<figure>{style.embedded(self._still(), self._alt(), width=440)}{said}</figure>"
        if source is not None:
            return f'<div class="vsp-explorer" data-scene="{html.escape(source)}">{picture}</div>'
        scene = json.dumps(self.scene, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
        return f'<div class="vsp-explorer">{picture}<script type="application/json">{scene}</script></div>'

    def _ipython_display_(self) -> None:
        from .view import View  # with anywidget, which takes a while to import

        page.show(View(scene=json.dumps(self.scene))._repr_mimebundle_()[0], self.element(), self._alt())

    def _alt(self) -> str:
        name, policy = next(iter(self.policies.items()))
        plane = " and ".join(PLANES[self.task.name][2])
        return f"The map of one policy ({name}, {len(policy)} cells) over {plane}: cells and actions."

    def _still(self) -> bytes:
        """The map of the first policy, as a PNG."""
        policy, (low, high, labels) = next(iter(self.policies.values())), PLANES[self.task.name]
        fig, (ax,) = style.panels(1, width=3.2, height=3.0)
        x, y, points = state_space.grid(np.array(low), np.array(high), 201)
        if len(self.task.outputs) == 1:
            actions = policy.predict(self.task.see(points))[0][:, 0] / self.task.action_high[0]
            state_space.force_map(ax, x, y, actions)
        state_space.cells(ax, x, y, policy.cells(self.task.see(points)), fill=len(self.task.outputs) > 1)
        if len(self.task.outputs) == 2:
            coarse = state_space.grid(np.array(low), np.array(high), 15)[2]
            state_space.arrows(ax, coarse, policy.predict(coarse)[0], color=style.OTHER)
        ax.set(xlabel=labels[0], ylabel=labels[1], xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        file = io.BytesIO()
        fig.savefig(file, format="png", dpi=150, metadata={"Software": None})
        plt.close(fig)
        return file.getvalue()


def explore(
    policies: VoronoiPolicy | dict[str, VoronoiPolicy],
    *,
    teacher: Policy | None = None,
    history: History | None = None,
) -> Explorer:
    """Replay, ask and change a policy in a browser: shown by JupyterLab, or saved to an HTML file of its own.

    `policies`: one with linear maps for SimpleGoal, MountainCarContinuous or Pendulum, or some by name; `teacher`: its
    actions stand beside theirs; `history` of a distillation: replays the first policy. Raises ValueError for others.
    """
    return Explorer(policies if isinstance(policies, dict) else {"policy": policies}, teacher=teacher, history=history)
