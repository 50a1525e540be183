"""One page about a policy and the agent that it imitates, in one file to send: it needs no other file or host."""

import base64
import html
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vsp import PiecewisePolicy, Policy, Task, VoronoiPolicy, get_task
from vsp import agent as as_agent
from vsp.evaluation import ALIKE, CLOSE, Likeness, likeness
from vsp.protocol import interval, share_interval
from vsp.show.explorer import PLANES, Explorer, standalone
from vsp.show.state_space import birth_colours
from vsp.show.style import CELLS

from .device import to_c, to_header
from .episodes import episodes
from .few_cells.fewest import LOSS, SHARE, Tried
from .proofs import PROVERS

MOST_INPUTS = 8  # in an equation; of more, the five that move the action most
PROOF_SECONDS = 60
_PROVE = """import sys, vsp, vsp_beyond
proof = vsp_beyond.prove(vsp.VoronoiPolicy.load(sys.argv[1]))
print(f"{proof}. In this order: {' '.join(type(proof).claim.__doc__.split())}")"""
_STYLE = """body { line-height: 1.5 }
table { border-collapse: collapse }
td, th { padding: .2rem .8rem; text-align: left; border-bottom: 1px solid #ccc }
@media (max-width: 500px) { table { font-size: .8rem } td, th { padding: .1rem .25rem } meter { display: none } }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 1rem }
.cards > div, .wide { overflow-x: auto }
.cards > div { border: 1px solid #ccc; border-radius: 6px; padding: .6rem 1rem }
.vsp-explorer { margin-top: 1.5rem }
"""


def report(
    policy: PiecewisePolicy, agent: Policy, task: str | Task, *, name: str = "agent", remarks: str = "",
    tried: Sequence[Tried] = (), until: float = math.inf,
) -> str:  # fmt: skip
    """Return a page as HTML: what it says first, equations, sizes that were tried, episodes, the explorer, how alike
    they act, what is proved, and the policy as files to save. `name` and `remarks` stand on the page as text. `tried`:
    stages of `fewest`. `until`, a time of `time.monotonic`, bounds the proof. Raises ValueError unless the policy is
    cells and maps and both fit the task."""
    task, agent = get_task(task), as_agent(agent)
    if not isinstance(policy, PiecewisePolicy):
        raise ValueError(f"the policy is {policy!r:.60}, expected cells and maps: a vsp.PiecewisePolicy")
    known = [one.alike for one in tried if one.policy is policy]
    alike = known[0] if known else likeness(policy, agent, task)
    no_failures = alike.failures["policy"] is None
    why = "the return is lower" if no_failures else "more episodes fail"
    why = f", but not closely: {'the actions differ' if alike.r2 < ALIKE else why}" if alike.poor else ""
    acts = "is imitated by" if alike.poor else "acts like"
    what = f"{len(policy)} cells with a map each" if len(policy) > 1 else "one equation"
    what = "one map: an equation for each action" if len(policy) == 1 < len(task.outputs) else what
    lines = "".join(f"<p>Note: {html.escape(line)}</p>" for line in remarks.splitlines())
    said = f"{alike}".removeprefix("warning: ") + "; no episode reaches a goal, so none counts as failed" * no_failures
    parts = [
        f"<p><strong>{html.escape(f'{name} {acts} {what}{why}.')}</strong> {html.escape(said)}.</p>",
        lines, _cards(policy, alike), _sizes(tried, policy), _played(policy, agent, alike), _numbers(policy, alike),
        _kept(policy, alike.states, until),
    ]  # fmt: skip
    return standalone(f"{task.name}: {name}", "\n".join(parts), _STYLE)


def _sizes(tried: Sequence[Tried], policy: PiecewisePolicy) -> str:
    """Return how much each number of cells acts like the agent, and which was chosen."""
    if not tried:
        return ""
    rows = ""
    for one in tried:
        alike, returns, failed = one.alike, one.alike.returns["policy"], one.alike.failures["policy"]
        said = "not defined" if failed is None else f"{failed} of {len(returns)}"
        name, bar = one.stage.name + " (chosen)" * (one.policy is policy), f'<meter value="{max(alike.r2, 0):.4f}">'
        returned = f"{returns.mean():.5g}{'' if one.level else ' (too low)'}"
        cells = name, f"{alike.r2:.4f} {bar}", f"{alike.within.min():.1%}", returned, said
        rows += "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
    head = "".join(f"<th>{name}</th>" for name in ("cells", "R²", f"within {CLOSE:.0%}", "return", "failed"))
    rule = (
        f"The fewest cells are chosen whose R² is at most {LOSS} below the highest and whose return falls short of "
        f"the agent's by at most half of the paired 95 % interval, or {SHARE:.0%} of its distance to the best constant "
        "action. Where none is, the best of them is tuned on the return, if there is time, and the one that returns "
        "most is chosen. “Within” counts the action that is close in the fewest states."
    )
    return f'<h2>How many cells?</h2><div class="wide"><table><tr>{head}</tr>{rows}</table></div><p>{rule}</p>'


def _numbers(policy: PiecewisePolicy, alike: Likeness) -> str:
    rows = ""
    for name, returns in alike.returns.items():
        low, high = interval(returns, np.mean, vectorized=True)
        failed, n = alike.failures[name], len(returns)
        least, most = (0, 0) if failed is None else share_interval(failed, n)
        said = "not defined" if failed is None else f"{failed} of {n} ({least:.1%} to {most:.1%})"
        rows += f"<tr><td>{name}</td><td>{returns.mean():.2f} ({low:.2f} to {high:.2f})</td><td>{said}</td></tr>"
    close = ", ".join(f"{name} in {share:.1%}" for name, share in zip(policy.task.outputs, alike.within))
    head = "<tr><th></th><th>mean return (95 %)</th><th>failed episodes (95 %)</th></tr>"
    return (
        f"<h2>How alike?</h2><p>The policy reproduces {alike.r2:.1%} of the variance of the agent's actions (R²), on "
        f"{len(alike.states):,} states of the agent that no fit saw. Each action is within {CLOSE:.0%} of its "
        f"range of the agent's: {html.escape(close)} of these states.</p>"
        f'<div class="wide"><table>{head}{rows}</table></div>'
    )


def _cards(policy: PiecewisePolicy, alike: Likeness) -> str:
    """Return a card per cell: where it is, the share of the agent's states in it, and its equations."""
    inside, cards = policy.cells(alike.states), ""
    tints = birth_colours(policy)[1] if isinstance(policy, VoronoiPolicy) else np.arange(len(policy)) % len(CELLS)
    for cell, tint in enumerate(tints):
        here = inside == cell
        where = html.escape(policy.where.place(cell, policy.task.inputs, 3))
        text = "".join(f"<p>{html.escape(line)}</p>" for line in _equations(policy, cell, alike.states[here]))
        if len(policy.task.inputs) > MOST_INPUTS:
            lines = "".join(f"<p>{html.escape(line)}</p>" for line in policy.equations(cell))
            text += f"<details><summary>exactly</summary>{where * (len(policy) > 1)}{lines}</details>"
            where = html.escape(_typical(policy, alike.states, here))
        close = (alike.errors[here] <= CLOSE).all(axis=1)
        said = f", all actions within {CLOSE:.0%} in {close.mean():.0%} of these" if len(close) else ""
        edge = "; border-top: .3em solid" * (cell >= len(CELLS))
        mark = f'<i class="vsp-mark" style="border-radius: 0; background: {CELLS[tint]}{edge}"></i>'
        place = f"{mark}<b>Cell {cell}</b>, {here.mean():.0%} of the states{said}<br>{where}"
        cards += f"<div>{place * (len(policy) > 1)}{text}</div>"
    about = f"In each state one cell acts. {policy.where.about(policy.task.inputs, 3)}" if len(policy) > 1 else ""
    if about and isinstance(policy, VoronoiPolicy):
        units = ", ".join(f"{name} {unit:.3g}" for name, unit in zip(policy.task.inputs, policy.scale))
        about = "In each state the cell with the nearest codeword acts. Codewords need not be possible states. Their "
        about += f"distances are {policy.metric}, after each input is divided by its unit: {units}"
    if len(policy.policy_class.terms) > MOST_INPUTS:
        about += f"{'. ' * bool(about)}An equation shows the five inputs that move the action most, and the others at "
        about += "their mean; in brackets, the share of the action's variance that this hides"
    return f'<h2>The policy</h2><p>{html.escape(about and f"{about}.")}</p><div class="cards">{cards}</div>'


def _typical(policy: PiecewisePolicy, states: np.ndarray, here: np.ndarray) -> str:
    """Say by which inputs the states (n, d) in a cell differ most from all, in standard deviations."""
    if not here.any():
        return ""
    mean, ours = states.mean(axis=0), states[here].mean(axis=0)
    apart = np.abs(ours - mean) / (states.std(axis=0) + 1e-12)
    said = [f"{policy.task.inputs[i]} {ours[i]:.3g} ({mean[i]:.3g})" for i in np.argsort(-apart)[:3]]
    return f"on average (in all cells): {', '.join(said)}"


def _equations(policy: PiecewisePolicy, cell: int, states: np.ndarray) -> tuple[str, ...]:
    """Return the equations of a cell; with many inputs, short ones over `states` (n, d) in the cell."""
    names = policy.policy_class.terms
    if len(names) <= MOST_INPUTS or not len(states):
        return policy.equations(cell)
    weights, lines = policy.coefficients[cell], []
    for j, output in enumerate(policy.task.outputs):
        terms = policy.policy_class.features(states) * weights[:-1, j]
        rest, text = terms.sum(axis=1), ""
        whole, left = rest.var() or 1.0, list(range(terms.shape[1]))
        for _ in range(5):  # each time the one without which the rest varies least
            best = np.argmin([(rest - terms[:, i]).var() for i in left])
            i = left.pop(int(best))
            rest, text = rest - terms[:, i], f"{text}{_signed(weights[i, j])} · {names[i]} "
        text += f"{_signed(weights[-1, j] + rest.mean())} (hides {rest.var() / whole:.1%})"
        lines.append(f"{output} = {text.removeprefix('+ ')}")
    return tuple(lines)


def _signed(value: float) -> str:
    return f"{'−' if value < 0 else '+'} {abs(value):.3g}"


def _played(policy: PiecewisePolicy, agent: Policy, alike: Likeness) -> str:
    """Return episodes to look at, and the explorer if the browser plays the task; or why there is neither."""
    linear = policy.policy_class.name == "linear"
    if not (linear and isinstance(policy, VoronoiPolicy) and policy.where.metric.order is not None):
        return "<p>No episode is shown: that takes linear maps, and codewords with a Minkowski distance.</p>"
    seen, shown = episodes(policy, agent, alike), policy.task.name in PLANES
    return seen + ("<h2>Explore</h2>" + Explorer({"policy": policy}).element() if shown else "")


def _kept(policy: PiecewisePolicy, states: np.ndarray, until: float) -> str:
    """Return what is proved, if the task has a prover and it is done in time, and the policy as files."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.vsp"
        policy.save(path)
        saved = path.read_bytes()
        provable = isinstance(policy, VoronoiPolicy) and policy.task.name in PROVERS
        proof = _proof(path, min(PROOF_SECONDS, max(1.0, until - time.monotonic()))) if provable else ""
    files = {
        "policy.vsp": saved,
        "policy.c": to_c(policy, states=states).encode(),
        "policy.h": to_header(policy).encode(),
        "policy.py": policy.to_python().encode(),
    }
    links = []
    for name, content in files.items():
        data = base64.b64encode(content).decode()
        links.append(f'<a download="{name}" href="data:application/octet-stream;base64,{data}">{name}</a>')
    return f"{proof}<h2>The policy as a file</h2><p>{', '.join(links)}</p>"


def _proof(path: Path, seconds: float) -> str:
    try:  # in a process of its own, which can be stopped
        done = subprocess.run([sys.executable, "-c", _PROVE, path], capture_output=True, text=True, timeout=seconds)
        said = done.stdout or f"Nothing is proved: {done.stderr.strip().rpartition(': ')[2]}."
    except subprocess.TimeoutExpired:
        said = f"Nothing is proved within {seconds:.2g} s; vsp_beyond.prove(policy) may take minutes."
    return f"<h2>What is certain?</h2><p>{html.escape(said)}</p>"
