import dataclasses

import numpy as np
import pytest
from support import PENDULUM, SIMPLEGOAL, CurvedTeacher

from studies.comparison import measure as measure_module
from studies.comparison.makers import dagger
from studies.comparison.measure import action_error, common_states, fidelity, measure, sameness
from vsp import VoronoiPolicy, get_task, load_teacher, rollout_from_seed, start_states
from vsp.paper.baselines import Tree
from vsp_beyond import Tuned, distill_tuned


def test_what_is_reported_by_hand(monkeypatch):
    monkeypatch.setattr(measure_module, "N_REPORTED", 30)
    monkeypatch.setattr(measure_module, "N_ERROR", 10)
    teacher, task = load_teacher(SIMPLEGOAL), get_task(SIMPLEGOAL)
    policy = VoronoiPolicy(np.zeros((1, 2)), [[[0, 0], [0, 0], [-1, -1]]], task=task)
    row, result = measure(policy, teacher, task), rollout_from_seed(policy, task, 30, seed=measure_module.REPORT_SEED)
    assert row["mean"] == result.returns.mean() and row["failing"] == np.mean(result.outcomes != 1)
    starts = start_states(task, 10, measure_module.ERROR_SEED)
    assert row["error_own"] == action_error(policy, teacher, task, starts, by=policy)
    assert row["error_teacher"] == action_error(policy, teacher, task, starts, by=teacher) != row["error_own"]
    assert row["cells"] == 1
    own = measure(teacher, teacher, task)
    assert (own["error_teacher"], own["error_own"], own["cells"]) == (0, 0, 0)


def test_no_start_that_is_reported_was_chosen_on(seed=0):
    """Neither by our method nor by DAgger: no start that they draw is one of those."""
    drawn, start = [], get_task(SIMPLEGOAL).start

    def record(rng, n):
        drawn.append(start(rng, n))
        return drawn[-1]

    task = dataclasses.replace(get_task(SIMPLEGOAL), start=record)
    config = Tuned(n_cells=1, n_episodes=20, n_restarts=1, n_steps=5, n_corrections=1, n_correction_episodes=5,
                        n_generations=2, n_tuning_episodes=5, n_validation=50)  # fmt: skip
    distill_tuned(CurvedTeacher(), task, config, seed=seed)
    dagger([lambda states, actions: Tree(states, actions, leaves=2)], CurvedTeacher(), task, rounds=config, seed=seed)
    seen = {tuple(row) for rows in drawn for row in rows}
    for own in (measure_module.REPORT_SEED, measure_module.ERROR_SEED):
        assert not seen & {tuple(row) for row in start_states(get_task(SIMPLEGOAL), 10_000, own)}
    assert len(seen) == 20 + 5 + 2 * 50 + 2 * 5  # both begin their episodes alike, and validate each for itself


def test_the_action_error_by_hand():
    torque = VoronoiPolicy(np.zeros((1, 3)), [[[0.0], [0.0], [0.0], [1.0]]], task=PENDULUM)
    still = VoronoiPolicy(np.zeros((1, 3)), np.zeros((1, 4, 1)), task=PENDULUM)
    assert action_error(torque, still, get_task(PENDULUM), np.zeros((1, 2)), by=still) == pytest.approx(0.5)


# Likeness


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(measure_module, "N_REPORTED", 200)
    monkeypatch.setattr(measure_module, "N_COMMON", 500)


def constants(codewords, actions):
    """A policy with one action per cell."""
    return VoronoiPolicy(codewords, np.array(actions)[:, None], task=SIMPLEGOAL, sub_policy="constant")


def compared(one, other, teacher):
    task = get_task(SIMPLEGOAL)
    return sameness(one, other, teacher, task, common_states(teacher, task))


def test_the_same_cells_in_another_order_are_the_same(few):
    left, right = [0.2, 0.5], [0.8, 0.5]
    one, turned = constants([left, right], [[0, 0], [1, 1]]), constants([right, left], [[1, 1], [0, 0]])
    assert compared(one, turned, CurvedTeacher()) == {"index": 1.0, "ratio": 0.0}


def test_other_cells_and_actions_by_hand(few):
    left, right, below, above = [0.2, 0.5], [0.8, 0.5], [0.5, 0.2], [0.5, 0.8]
    one, other = constants([left, right], [[0, 0], [0, 0]]), constants([below, above], [[0, 0], [1, 0]])
    teacher = constants([[0.5, 0.5]], [[0.0, 1.0]])
    row = compared(one, other, teacher)
    upper = (common_states(teacher, get_task(SIMPLEGOAL))[:, 1] > 0.5).mean()
    # Squared differences, summed over both actions: 1 in the upper half between the two; 1, and 1 more there, to it
    assert row["ratio"] == pytest.approx(np.sqrt(upper) / (0.5 * (1 + np.sqrt(1 + upper)))) and row["index"] < 0.5


def test_one_cell_has_no_index(few):
    single, two = constants([[0.5, 0.5]], [[0, 0]]), constants([[0.2, 0.5], [0.8, 0.5]], [[0, 0], [1, 1]])
    rows = [compared(single, one, CurvedTeacher()) for one in (two, single)]
    assert np.isnan([row["index"] for row in rows]).all() and rows[1]["ratio"] == 0.0 < rows[0]["ratio"]


def test_fidelity_by_hand(few):
    teacher = constants([[0.2, 0.5], [0.8, 0.5]], [[0.5, 0.4], [-0.5, 0.4]])
    states = common_states(teacher, get_task(SIMPLEGOAL))
    wanted = teacher.predict(states)[0]
    assert fidelity(teacher, teacher, get_task(SIMPLEGOAL))["r2"] == 1.0 and states.shape == (500, 2)
    mean = constants([[0.5, 0.5]], [wanted.mean(axis=0)])
    found = fidelity(mean, teacher, get_task(SIMPLEGOAL))  # its second action never varies
    assert found["r2"] == pytest.approx(0.0) == found["r2_worst"] and found["off"] == 1.0


def test_the_worst_coordinate_is_told(few):
    teacher = constants([[0.2, 0.5], [0.8, 0.5]], [[0.8, 0.1], [-0.8, -0.1]])
    half = constants([[0.2, 0.5], [0.8, 0.5]], [[0.8, 0.0], [-0.8, 0.0]])
    found = fidelity(half, teacher, get_task(SIMPLEGOAL))
    assert found["r2"] > 0.9 and found["r2_worst"] < 0.2 and found["off"] == 0.0
