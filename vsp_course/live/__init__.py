"""The page `live.html`: parts of the lessons that live without Python. It uses the explorer's scripts."""

from pathlib import Path

import numpy as np

from vsp import get_task, load_teacher, start_states
from vsp.paper.results import read_results
from vsp.rollouts import collect_episodes
from vsp.show.explorer import STYLE, scene_of
from vsp.show.explorer.explorer import SECURITY
from vsp.show.explorer.scene import to_json

HERE = Path(__file__).parent
TASK = "SimpleGoal-v0"
N_EPISODES = 100  # of the teacher


def live() -> str:
    """Return the page as HTML, which opens from disk and needs no other file or host."""
    page, css, script = ((HERE / name).read_text("utf-8") for name in ("page.html", "live.css", "live.bundle.js"))
    task, teacher, reruns = get_task(TASK), load_teacher(TASK), read_results(TASK)
    episodes = collect_episodes(teacher, task, start_states(task, N_EPISODES, 0))
    data = {
        "scene": scene_of({}, task, teacher),
        "episodes": [{"states": _rounded(e.states), "actions": _rounded(e.actions)} for e in episodes],
        "reruns": {"means": reruns["mean"].tolist(), "sds": reruns["std"].tolist()},
    }
    texts = {"security": SECURITY, "style": STYLE + css, "script": script, "data": to_json(data)}
    return page.format(n_states=len(episodes.states), n_episodes=N_EPISODES, n_reruns=len(reruns), **texts)


def _rounded(numbers: np.ndarray) -> list:
    return numbers.astype(float).round(6).tolist()  # as float32 they would have many digits
