import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, CurvedTeacher

from vsp.policy import VoronoiPolicy
from vsp.tasks.registry import get_task
from vsp_beyond.explain import lime
from vsp_beyond.explain.lime import compare_maps, gradient_map, local_map

SCALE = np.array([0.2, 0.3])
STATE = np.array([0.6, 0.4])


def rng():
    return np.random.default_rng(0)


def test_lime_by_hand():
    """The same by normal equations: rows weighted by the kernel, all but the intercept penalised by 1."""
    moves = np.vstack([np.zeros(2), np.random.default_rng(3).normal(size=(199, 2))])
    kernel = np.exp(-(moves**2).sum(axis=1) / (0.75 * np.sqrt(2)) ** 2) ** 0.5
    inputs, actions = np.column_stack([moves, np.ones(200)]), CurvedTeacher().predict(STATE + moves * SCALE)[0]
    penalty = np.diag([1.0, 1.0, 0.0])
    wanted = np.linalg.solve((inputs.T * kernel) @ inputs + penalty, (inputs.T * kernel) @ actions)
    generator = np.random.default_rng(3)
    line = local_map(CurvedTeacher(), SIMPLEGOAL, STATE, scale=SCALE, rng=generator, n=200)
    assert np.allclose(line[:-1], wanted[:-1] / SCALE[:, None])
    assert np.allclose(np.append(STATE, 1.0) @ line, wanted[-1])


def test_the_gradient_by_hand():
    class Square:
        def predict(self, obs):
            return obs[:, :1] ** 2 + 3 * obs[:, :1] * obs[:, 1:], None

    line = gradient_map(Square(), STATE, scale=SCALE)
    assert np.allclose(line[:2, 0], [2 * 0.6 + 3 * 0.4, 3 * 0.6])
    assert np.append(STATE, 1.0) @ line == pytest.approx(0.6**2 + 3 * 0.6 * 0.4)


def test_the_table_by_hand():
    task, cells = get_task(SIMPLEGOAL), np.random.default_rng(1).normal(size=(2, 3, 2))
    policy = VoronoiPolicy([[0.2, 0.2], [0.8, 0.8]], cells, task=SIMPLEGOAL)
    states = np.array([[0.1, 0.1], [0.9, 0.7]])
    table = compare_maps(policy, CurvedTeacher(), states, scale=SCALE, rng=rng())
    assert table.columns.tolist() == ["state", "action", "map", "x", "y", "bias", "error"]
    assert len(table) == 2 * 3 * 2 and set(table["map"]) == {"gradient", "LIME", "cell"}
    of_cells = table[table["map"] == "cell"]
    assert np.allclose(of_cells[["x", "y", "bias"]], cells.transpose(0, 2, 1).reshape(4, 3))
    generator = rng()
    local_map(CurvedTeacher(), SIMPLEGOAL, states[0], scale=SCALE, rng=generator)
    around = np.clip(states[0] + lime.NEAR * SCALE * generator.normal(size=(1000, 2)), task.low, task.high)
    gaps = np.clip(around @ cells[0, :2] + cells[0, 2], -1, 1) - CurvedTeacher().predict(around)[0]
    assert np.allclose(of_cells["error"][:2], np.sqrt((gaps**2).mean(axis=0)))


def test_one_action_and_the_same_numbers_again():
    policy = VoronoiPolicy(np.zeros((1, 2)), np.ones((1, 3, 1)), task=MOUNTAINCAR)
    first, second = (compare_maps(policy, policy, [[-0.5, 0.01]], scale=SCALE / 10, rng=rng()) for _ in range(2))
    assert first.equals(second) and len(first) == 3
    assert first.loc[first["map"] == "cell", "error"].item() == pytest.approx(0.0, abs=1e-12)
