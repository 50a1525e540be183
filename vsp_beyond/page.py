"""One page about a policy and the agent that it imitates, in one file to send: it needs no other file or host."""

from __future__ import annotations

import base64
import html
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from vsp import agent as as_agent
from vsp.evaluation import CLOSE, Likeness, likeness
from vsp.policy import PiecewisePolicy, VoronoiPolicy
from vsp.protocol import interval, share_interval
from vsp.rollouts import Policy
from vsp.show.explorer import explore, standalone
from vsp.tasks import Task, get_task

from .proofs import PROVERS

MOST_INPUTS = 8  # in an equation; of more, the five that contribute most
PROOF_SECONDS = 60
_PROVE = "import sys, vsp, vsp_beyond; print(vsp_beyond.prove(vsp.VoronoiPolicy.load(sys.argv[1])))"
_STYLE = """body { line-height: 1.5 }
table { border-collapse: collapse }
td, th { padding: .2rem .8rem; text-align: left; border-bottom: 1px solid #ccc }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 1rem }
.cards > div { border: 1px solid #ccc; border-radius: 6px; padding: .6rem 1rem; overflow-x: auto }
.vsp-explorer { margin-top: 1.5rem }
"""


def report(policy: PiecewisePolicy, agent: Policy, task: str | Task, *, name: str = "agent", remarks: str = "") -> str:
    """Return a page as HTML: equations, the explorer, how alike they act, where they differ most, what is proved, and
    the policy as files to save. `name` and `remarks` stand on the page as text.

    Raises ValueError unless the policy is cells and maps and both fit the task.
    """
    task, agent = get_task(task), as_agent(agent)
    if not isinstance(policy, PiecewisePolicy):
        raise ValueError(f"the policy is {policy!r:.60}, expected cells and maps: a vsp.PiecewisePolicy")
    alike = likeness(policy, agent, task)
    warning = [str(alike)] if alike.poor else []
    cells = f"{len(policy)} cell{'s' * (len(policy) > 1)}"
    parts = [
        f"<p>{html.escape(f'{name} on {task.name}, imitated by {policy.policy_class.name} maps in {cells}.')}</p>",
        "".join(f"<p><strong>{html.escape(line)}</strong></p>" for line in [*remarks.splitlines(), *warning]),
        _numbers(policy, alike), _cards(policy, alike), _explorer(policy, agent), _worst(policy, agent, alike),
        _kept(policy),
    ]  # fmt: skip
    return standalone(f"{task.name}: {name} in {cells}", "\n".join(parts), _STYLE)


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
        f"range of the agent's: {html.escape(close)} of these states. The cells below show where.</p>"
        f"<table>{head}{rows}</table>"
    )


def _cards(policy: PiecewisePolicy, alike: Likeness) -> str:
    """Return a card per cell: where it is, the share of the agent's states in it, and its equations."""
    names, inside, cards = policy.policy_class.terms, policy.cells(alike.states), ""
    typical = np.abs(policy.policy_class.features(alike.states)).mean(axis=0)
    for cell in range(len(policy)):
        where = policy.where.place(cell, policy.task.inputs, 3)
        lines = policy.equations(cell)
        if len(names) > MOST_INPUTS:
            weights = policy.coefficients[cell, :-1]
            largest = np.argsort(-np.abs(weights) * typical[:, None], axis=0)[:5].T
            lines = tuple(
                f"{output} = " + " ".join(f"{weights[i, j]:+.3f} {names[i]}" for i in rows) + " + ..."
                for j, (output, rows) in enumerate(zip(policy.task.outputs, largest))
            )
        text = "<br>".join(html.escape(line) for line in lines)
        close = (alike.errors[inside == cell] <= CLOSE).all(axis=1)
        said = f", all actions within {CLOSE:.0%} in {close.mean():.0%} of these" if len(close) else ""
        cards += f"<div><b>Cell {cell}</b>, {np.mean(inside == cell):.0%} of the states{said}<br>"
        cards += f"{html.escape(where)}<br>{text}</div>" if len(policy) > 1 else f"{text}</div>"
    about = policy.where.about(policy.task.inputs, 3) if len(policy) > 1 else ""
    return f'<h2>The policy</h2><p>{html.escape(about and f"{about}.")}</p><div class="cards">{cards}</div>'


def _explorer(policy: PiecewisePolicy, agent: Policy) -> str:
    """Return the explorer, or why there is none."""
    try:
        return explore(policy, teacher=agent).element()
    except ValueError as error:
        return f"<p>This page has no explorer: {html.escape(str(error))}.</p>"


def _worst(policy: PiecewisePolicy, agent: Policy, alike: Likeness) -> str:
    """Return the states in which the actions differ most, one per cell at most."""
    worst, rows = np.argsort(-np.linalg.norm(alike.errors, axis=1)), ""
    firsts = np.unique(policy.cells(alike.states[worst]), return_index=True)[1]  # of each cell, the worst state
    for i in worst[np.sort(firsts)[:3]]:
        state = ", ".join(f"{name} {value:.3g}" for name, value in zip(policy.task.inputs, alike.states[i]))
        actions = (
            ", ".join(f"{a:.3g}" for a in np.ravel(one.predict(alike.states[i : i + 1])[0])) for one in (policy, agent)
        )
        rows += f"<tr><td>{html.escape(state)}</td>" + "".join(f"<td>{said}</td>" for said in actions) + "</tr>"
    return (
        f"<h2>Where do they differ most?</h2><table><tr><th>state</th><th>policy</th><th>agent</th></tr>{rows}</table>"
    )


def _kept(policy: PiecewisePolicy) -> str:
    """Return what is proved, if the task has a prover and it is done within a minute, and the policy as files."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.vsp"
        policy.save(path)
        saved = path.read_bytes()
        provable = isinstance(policy, VoronoiPolicy) and policy.task.name in PROVERS
        proof = _proof(path) if provable else ""
    files = {"policy.vsp": saved, "policy.c": policy.to_c().encode(), "policy.py": policy.to_python().encode()}
    links = []
    for name, content in files.items():
        data = base64.b64encode(content).decode()
        links.append(f'<a download="{name}" href="data:application/octet-stream;base64,{data}">{name}</a>')
    return f"{proof}<h2>The policy as a file</h2><p>{', '.join(links)}</p>"


def _proof(path: Path) -> str:
    try:  # in a process of its own, which can be stopped
        done = subprocess.run(
            [sys.executable, "-c", _PROVE, path], capture_output=True, text=True, timeout=PROOF_SECONDS
        )
        said = done.stdout or f"Nothing is proved: {done.stderr.strip().rpartition(': ')[2]}."
    except subprocess.TimeoutExpired:
        said = f"Nothing is proved within {PROOF_SECONDS} s; vsp_beyond.prove(policy) may take minutes."
    return f"<h2>What is certain?</h2><p>{html.escape(said)}</p>"
