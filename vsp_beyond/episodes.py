"""Episodes to look at, moment by moment, on the page of any task: what an explorer is for two dimensions."""

import io
from contextlib import suppress
from typing import Any

import gymnasium
import numpy as np
from PIL import Image

from vsp import Policy, Task, VoronoiPolicy, start_states
from vsp.evaluation import Likeness
from vsp.rollouts import record
from vsp.show.explorer.scene import numbers_of, task_of, to_json
from vsp.show.style import embedded

MOMENTS = 400  # of an episode, evenly spaced if it has more steps
WORST = 3  # episodes with the lowest returns
CURVES = 4  # inputs that are drawn
FRAMES, PIXELS = 6, 160  # of the strip, and its width of one


def episodes(policy: VoronoiPolicy, agent: Policy, alike: Likeness) -> str:
    """Return an element with the episode of median return and the worst ones, which the page's script shows.

    The maps are linear, and the distance is Minkowski's: others the script cannot compute."""
    task, returns = policy.task, alike.returns["policy"]
    order = np.argsort(returns, kind="stable")
    chosen = [order[len(order) // 2], *order[:WORST]]
    starts = start_states(task, len(returns), 7)[chosen]
    played, moves = record(policy, task, starts)
    shown = []
    for i, (start, episode) in enumerate(zip(starts, moves)):
        every = -(-len(episode.states) // MOMENTS)
        states = episode.states[::every]
        begun = f"seed {start[0]:.0f}" if task.one_by_one else "start " + ", ".join(f"{x:.3g}" for x in start)
        name = f"{f'{i}. of the worst' if i else 'median'}: return {played.returns[i]:.5g} "
        name += f"(agent: {alike.returns['agent'][chosen[i]]:.5g}), {begun}{f', one moment in {every}' * (every > 1)}"
        theirs = np.asarray(agent.predict(states)[0], np.float64)
        shown.append({"name": name, "every": every, "states": _short(states), "agent": _short(theirs)})
    weights = np.abs(policy.coefficients[:, :-1]).max(axis=(0, 2))
    curves = np.sort(np.argsort(-weights * alike.states.std(axis=0), kind="stable")[:CURVES])
    scene = {"task": task_of(task), "policies": [numbers_of(policy, "policy")], "episodes": shown}
    text = to_json(scene | {"curves": curves.tolist()}).replace("<", "\\u003c")  # no tag ends here
    words = "The policy plays. The strip has the colours of the cells that act. Of the actions, the thin curve is the "
    words += "policy's, the blue one the agent's in the same states. Touch a moment to ask why. A change is of one "
    words += "input alone, within its range in these episodes, so the state need not be possible."
    element = f'<div class="vsp-episodes"><script type="application/json">{text}</script></div>'
    strip = frames(policy, task, starts[0], played.lengths[0])
    return f"<h2>Episodes</h2><p>{words}</p>{element}{strip and f'<p>Frames of the median episode:</p>{strip}'}"


def _short(values: np.ndarray) -> list:
    return [[float(f"{value:.5g}") for value in row] for row in values.tolist()]


def frames(policy: Policy, task: Task, start: np.ndarray, length: int) -> str:
    """Return a strip of frames of the episode from `start`, if the task is an environment that renders."""
    if not task.one_by_one:
        return ""
    images, file, moments = [], io.BytesIO(), set(np.linspace(0, length - 1, FRAMES, dtype=int).tolist())
    with suppress(Exception):  # a renderer that fails never stops a page
        env = gymnasium.make(task.name, render_mode="rgb_array")
        seen = env.reset(seed=int(start[0]))[0]
        for t in range(length):
            if t in moments:
                frame: Any = env.render()
                images.append(frame[:: -(-frame.shape[1] // PIXELS), :: -(-frame.shape[1] // PIXELS)])
            seen = env.step(policy.predict(seen)[0].astype(env.action_space.dtype))[0]
        env.close()
        Image.fromarray(np.concatenate(images, axis=1)).save(file, "PNG")
        return embedded(file.getvalue(), "Frames of the median episode, evenly spaced in time.", width=FRAMES * PIXELS)
    return ""
