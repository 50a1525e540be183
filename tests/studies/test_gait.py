from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from support import PENDULUM

from studies.robots import record_gait
from vsp import Task, VoronoiPolicy, get_task, visited_states


class Engine:
    """A pendulum as MuJoCo describes bodies: a floor and two capsules, one of them lying, whose foot is down."""

    def __init__(self, task: Task, start):
        names = ["floor", "torso", "bfoot"]
        upright, lying = np.eye(3), np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0]])
        self.model = SimpleNamespace(
            ngeom=3, geom=lambda i: SimpleNamespace(name=names[i]), geom_size=np.array([[0, 0], [0.1, 0.5], [0.1, 2.0]])
        )
        self.data = SimpleNamespace(
            geom_xmat=np.array([upright, upright, lying]).reshape(3, 9), contact=[SimpleNamespace(geom1=0, geom2=2)],
            geom_xpos=np.array([[0.0, 0, 0], [1, 9, 3], [4, 9, 5]]),
        )  # fmt: skip
        self.state, self.env, self.unwrapped = task.begin(np.array([start])), self, self


def test_a_gait_is_the_episode_from_the_same_start():
    task, starts = get_task(PENDULUM), np.array([[1.0, 0.5]])
    policy = VoronoiPolicy([[-1, 0, 0], [1, 0, 0]], np.ones((2, 4, 1)), task=PENDULUM, metric="euclidean")
    engine = Engine(task, starts[0])

    def step(states, actions):
        engine.state, rewards, outcomes = task.step(engine.state, actions)
        return states, rewards, outcomes

    walks = replace(task, begin=lambda start: [engine], step=step, see=lambda _: task.see(engine.state), max_steps=20)
    gait = record_gait(policy, walks, start=0, n_steps=30)
    states = visited_states(policy, task, starts)[:20]
    assert gait.step.tolist() == list(range(20)) and gait.cell.tolist() == policy.cells(states).tolist()
    assert np.allclose(gait[[f"input {name}" for name in task.inputs]], states, atol=1e-4)
    assert (gait["back"] == 1).all() and (gait["front"] == 0).all()
    assert gait.filter(like="torso").iloc[0].tolist() == [1, 2.5, 1, 3.5]  # x, z of both ends
    assert gait.filter(like="bfoot").iloc[0].tolist() == [2, 5, 6, 5] and not gait.filter(like="floor").size
