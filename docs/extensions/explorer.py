"""The directive `explorer`: the companion's policies for one task, to be replayed, asked and changed."""

import functools
import shutil

import numpy as np
from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

import vsp
import vsp_beyond
from studies import comparison
from vsp.paper.baselines import linear_map
from vsp.paper.printed import TASKS, published_policy
from vsp.paper.results import read_results
from vsp.show.explorer import SCRIPT, Explorer
from vsp.show.explorer.scene import to_json
from vsp.teachers.teacher import Teacher


@functools.cache  # a run and a tuning each take seconds
def of_task(task: str, axes: tuple[str, ...] | None = None) -> Explorer:
    """The paper's policy, its method's best rerun with the run, ours, and one linear map: those that the task has."""
    teacher, policies, history = vsp.load_teacher(task), {}, None
    if task in TASKS:
        best = int(read_results(task).set_index("seed")["validation_mean"].idxmax())
        policies["the paper's method, best rerun"], history = vsp.distill(teacher, task, vsp.preset(task), seed=best)
        policies["the paper's, as published"] = published_policy(task)
    policies |= {f"ours, {name}": policy for name, policy in _ours(task, teacher)}
    episodes = vsp.collect_episodes(teacher, task, vsp.start_states(task, 200, 0))
    states = np.concatenate([episode.states for episode in episodes])
    actions = np.concatenate([episode.actions for episode in episodes])
    policies["one linear map"] = linear_map(states, actions, task)
    return vsp.explore(policies, teacher=teacher, history=history, axes=axes)


def _ours(task: str, teacher: Teacher):
    """Yield our policies with their names. Tuning takes seconds, but hours for a task whose tuned policy is kept."""
    for name, table in (("faithful", "faithful"), ("tuned", "methods"), ("at the limit", "limit")):
        if (path := comparison.RESULTS / f"{table}_{task}.policy").exists():
            yield name, vsp.VoronoiPolicy.load(path)
        elif name == "tuned":
            yield name, vsp_beyond.tuned(teacher, task, seed=0)


def challenge(task: str, guess: str) -> Explorer:
    """The paper's policy, about which `guess` asks, and three cells for the reader, which all go to the origin."""
    maps = np.zeros((3, 3, 2))
    maps[:, 2] = -1.0
    three_cells = vsp.VoronoiPolicy([[0.25, 0.25], [0.75, 0.4], [0.4, 0.75]], maps, task=task)
    policies = {"the paper's, as published": published_policy(task), "three cells, for you to change": three_cells}
    return vsp.explore(policies, teacher=vsp.load_teacher(task), guess=guess)


class Shown(SphinxDirective):
    """Shows the explorer of the task that its argument names; its data is a file, which loads when it is in view.

    Option `axes`: two inputs, for a task with stored episodes. Option `guess`: a question about the paper's policy for
    SimpleGoal, which the reader answers first and then has three cells to do better. The content is for readers of the
    source, on GitHub.
    """

    has_content = True
    required_arguments = 1
    option_spec = {"guess": directives.unchanged_required, "axes": directives.unchanged_required}

    def run(self):
        (task,), guess, axes = self.arguments, self.options.get("guess"), self.options.get("axes")
        explorer = challenge(task, guess) if guess else of_task(task, tuple(axes.split()) if axes else None)
        top, name = "../" * self.env.docname.count("/"), f"explorer_{task}{'_guess' * bool(guess)}.json"
        self.env.app.explorers[name] = to_json(explorer.scene)
        return [nodes.raw("", explorer.element(source=f"{top}_static/{name}"), format="html")]


def _write(app, error):
    """The script, which notebooks need too, and the scenes, beside the pages."""
    if error is None:
        shutil.copy(SCRIPT, app.outdir / "_static")
        for name, scene in app.explorers.items():
            (app.outdir / "_static" / name).write_text(scene, "utf-8")


def setup(app):
    app.explorers = {}
    app.add_directive("explorer", Shown)
    app.connect("build-finished", _write)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
