"""`Explorer`: policies of one task to explore in a browser, as an element of a page or as a standalone file."""

import html
import io
import json
import os
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from ...config import PAPER_TASKS
from ...history import History
from ...policy import PiecewisePolicy, VoronoiPolicy
from ...rollouts import Policy
from ...run import atomic
from .. import page, state_space, style
from .scene import bench_of, scene_of, to_json
from .scripts import BENCH, PAGE, SCRIPT, STYLE

# A browser runs what a page contains, and loads nothing from another host
SECURITY = """<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline';
script-src 'unsafe-inline' blob:; worker-src blob:; img-src data:; connect-src 'self'; base-uri 'none';
form-action 'none'">"""


def standalone(title: str, body: str, style: str = "", script: str = f"{SCRIPT}\nmountAll") -> str:
    """Return a whole page: `title` is text, `body` HTML, `style` CSS, `script` ends with the function that it calls, by
    default one that draws explorers. A browser loads nothing from elsewhere for it."""
    style = STYLE + style
    return PAGE.format(title=html.escape(title), body=body, style=style, script=script, security=SECURITY)


class Explorer:
    """Policies of one task, to replay, query and change in a browser. `policies`: policies with linear maps by name,
    all of one task that the script plays: SimpleGoal, MountainCarContinuous or Pendulum. `history`: replays the first
    of them. Raises ValueError for other policies and tasks, and for the history of another run."""

    def __init__(
        self, policies: dict[str, VoronoiPolicy], *, teacher: Policy | None = None, history: History | None = None
    ):
        for policy in policies.values():
            if not isinstance(policy, VoronoiPolicy) or policy.where.metric.order is None:
                raise ValueError(f"the policy is {policy!r:.60}, expected a VoronoiPolicy with a Minkowski distance")
            policy.check_linear()
        tasks = {policy.task.name: policy.task for policy in policies.values()}
        if len(tasks) != 1:
            raise ValueError(f"the policies play {sorted(tasks) or 'nothing'}, expected one task")
        self.policies, (self.task,), first = policies, tasks.values(), next(iter(policies.values()))
        if history and not np.array_equal(history.policy_at(len(history.cells) - 1).codewords, first.codewords):
            raise ValueError("history is of another run than the first policy, expected the one that gave it")
        self.history, self.scene = history, scene_of(policies, self.task, teacher, history)

    def save(self, path: str | os.PathLike) -> None:
        """Write a standalone HTML file, which opens from disk and needs no other file or host."""
        atomic.write_text(path, standalone(f"{self.task.name}: explore the policy", self.element()))

    def element(self, *, sources: dict[str, str] | None = None) -> str:
        """Return HTML with the script's scene inside, and a picture to show without it. `sources`: files with scenes to
        choose from, by name, instead of that scene."""
        caption = f"<figcaption>{html.escape(self._alt())}</figcaption>"
        picture = f"<figure>{style.embedded(self._still(), self._alt(), width=440)}{caption}</figure>"
        if sources is not None:
            return f'<div class="vsp-explorer" data-scenes="{html.escape(json.dumps(sources))}">{picture}</div>'
        scene = to_json(self.scene).replace("<", "\\u003c")  # no tag ends here
        return f'<div class="vsp-explorer">{picture}<script type="application/json">{scene}</script></div>'

    def _ipython_display_(self) -> None:
        from .view import View  # here: anywidget takes long to import

        view, _ = View(scene=to_json(self.scene))._repr_mimebundle_() or ({}, {})
        page.show(view, self.element(), self._alt())

    def _alt(self) -> str:
        name, policy = next(iter(self.policies.items()))
        plane, cells = " and ".join(self.scene["plane"]["labels"]), f"{len(policy)} cell{'s' * (len(policy) > 1)}"
        return f"The map of one policy ({name}, {cells}) over {plane}: cells and actions."

    def _still(self) -> bytes:
        """Draw the first policy over its plane, as a PNG: forces as colours, or cells and arrows."""
        policy, (low, high, labels) = next(iter(self.policies.values())), self.scene["plane"].values()
        fig, (ax,) = style.panels(1, width=3.2, height=3.0)
        x, y, points = state_space.grid(np.array(low), np.array(high), 201)
        single = len(self.task.outputs) == 1
        if single:
            actions = policy.predict(self.task.see(points))[0][:, 0] / self.task.action_high[0]
            state_space.force_map(ax, x, y, actions)
        fill = None if single else state_space.birth_colours(policy, self.history)[1]
        state_space.cells(ax, x, y, policy.cells(self.task.see(points)), fill=fill)
        if not single:
            coarse = state_space.grid(np.array(low), np.array(high), 15)[2]
            state_space.arrows(ax, coarse, policy.predict(coarse)[0], color=style.OTHER)
        ax.set(xlabel=labels[0], ylabel=labels[1], xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        file = io.BytesIO()
        fig.savefig(file, format="png", dpi=150, metadata={"Software": None})
        plt.close(fig)
        return file.getvalue()


class Workbench:
    """The paper's method, run in the browser: its tasks, every setting that a picture can show, runs side by side."""

    def save(self, path: str | os.PathLike) -> None:
        """Write a standalone HTML file, which opens from disk and needs no other file or host."""
        atomic.write_text(path, self.page())

    def page(self) -> str:
        """Return that file's text."""
        data = to_json([bench_of(task) for task in PAPER_TASKS])
        body = "<p>Press distil: cells split where the imitation fails, and merge where neighbours agree.</p>"
        body += f'<div class="vsp-explorer" data-bench><script type="application/json">{data}</script></div>'
        return standalone("Distil a network", body, ".vsp-page { max-width: 110rem }", f"{BENCH}\nbegin")

    def _repr_html_(self) -> str:
        style = "border: 0; width: 100%; height: 50rem"
        return f'<iframe srcdoc="{html.escape(self.page())}" style="{style}"></iframe>'


def explore(
    policies: PiecewisePolicy | dict[str, VoronoiPolicy] | None = None, *, teacher: Policy | None = None,
    history: History | None = None,
) -> Explorer | Workbench:  # fmt: skip
    """Replay, query and change a policy in a browser: shown by JupyterLab, or saved as a standalone HTML file.

    `policies`: one policy with linear maps, or several by name; None: a `Workbench`, which distils in the browser.
    `teacher`: its mean return is shown beside theirs. `history`: replays the distillation of the first policy. The
    browser plays SimpleGoal, MountainCarContinuous and Pendulum. Raises ValueError for other policies and tasks, and
    for a history of another method or task."""
    if policies is None:
        return Workbench()
    shown: dict[str, Any] = policies if isinstance(policies, dict) else {"policy": policies}
    return Explorer(shown, teacher=teacher, history=history)
