"""The directive `explorer`: the companion's policies for some tasks, to be replayed, asked and changed."""

import functools
import re

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import vsp
import vsp_beyond
from studies import comparison
from vsp.paper.baselines import linear_map
from vsp.paper.printed import TASKS, published_policy
from vsp.paper.results import read_results
from vsp.show.explorer import Explorer
from vsp.show.explorer.scene import bench_of, to_json
from vsp.show.explorer.scripts import BENCH
from vsp.teachers.teacher import Teacher

AGENTS = comparison.RESULTS / "agents"


@functools.cache  # a run and a tuning each take seconds
def of_task(task: str) -> Explorer:
    """The paper's method's best rerun with the run, the paper's policy, ours, one linear map, and agents of the zoo."""
    teacher, policies, history = vsp.load_teacher(task), {}, None
    if task in TASKS:
        best = int(read_results(task).set_index("seed")["validation_mean"].idxmax())
        policies["the paper's method, best rerun"], history = vsp.distill(teacher, task, vsp.preset(task), seed=best)
        policies["the paper's, as published"] = published_policy(task)
    policies |= {f"ours, {name}": policy for name, policy in _ours(task, teacher)}
    episodes = vsp.collect_episodes(teacher, task, vsp.start_states(task, 200, 0))
    policies["one linear map"] = linear_map(episodes.states, episodes.actions, task)
    agents = {
        f"{path.name.split('-')[0].upper()} agent of the zoo, distilled": vsp.VoronoiPolicy.load(path)
        for path in sorted(AGENTS.glob(f"*-{task}.policy"))
    }
    explorer = vsp.explore(policies | agents, teacher=teacher, history=history)
    for about in explorer.scene["policies"]:
        if about["name"] in agents:
            about["teacher"] = None  # these imitate others
    return explorer


def _ours(task: str, teacher: Teacher):
    """Yield our policies with their names."""
    yield "faithful", vsp.VoronoiPolicy.load(comparison.RESULTS / f"faithful_{task}.policy")
    yield "tuned", vsp_beyond.tuned(teacher, task, seed=0)
    yield "at the limit", vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{task}.policy")


class Shown(SphinxDirective):
    """Shows an explorer with a choice of the tasks that its argument names.

    The scene of each is a file, which loads when the task is chosen. The content is for readers of the source.
    """

    has_content = True
    required_arguments = 1
    final_argument_whitespace = True

    def run(self):
        top, explorers = "../" * self.env.docname.count("/"), {t: of_task(t) for t in self.arguments[0].split()}
        self.env.app.explorers |= explorers
        sources = {re.sub(r"(Continuous)?-v\d+$", "", task): f"{top}_static/{task}.json" for task in explorers}
        return [nodes.raw("", next(iter(explorers.values())).element(sources=sources), format="html")]


class Bench(SphinxDirective):
    """Shows the workbench. Its content is for readers of the source."""

    has_content = True

    def run(self):
        top = "../" * self.env.docname.count("/") + "_static/workbench"
        script = f'<script type="module" id="vsp-script" src="{top}.js"></script>'
        return [nodes.raw("", f'<div class="vsp-explorer" data-bench="{top}.json"></div>{script}', format="html")]


def _write(app, error):
    """The scenes and the workbench, beside the pages."""
    if error is None:
        (app.outdir / "_static/workbench.json").write_text(to_json([bench_of(task) for task in TASKS]), "utf-8")
        (app.outdir / "_static/workbench.js").write_text(f"{BENCH}\nbegin()\n", "utf-8")
    for task, explorer in app.explorers.items() if error is None else ():
        (app.outdir / "_static" / f"{task}.json").write_text(to_json(explorer.scene), "utf-8")


def setup(app):
    app.explorers = {}
    app.add_directive("explorer", Shown)
    app.add_directive("workbench", Bench)
    app.connect("build-finished", _write)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
