import dataclasses

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher

from studies.comparison import measure as measure_module
from studies.comparison.measure import ERROR_SEED, REPORT_SEED, action_error, cost, measure
from studies.rivals import tdavq
from studies.rivals.dagger import dagger
from studies.rivals.hand_written import Heuristic
from studies.rivals.trees import LinearTree, ObliqueLinearTree
from vsp.evaluation import rollout_from_seed, start_states
from vsp.paper.baselines import Tree
from vsp.policy import VoronoiPolicy
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import load_teacher
from vsp_beyond.few_cells.config import Tuned
from vsp_beyond.few_cells.tuned import distill_tuned


def test_what_is_reported_by_hand(monkeypatch):
    monkeypatch.setattr(measure_module, "N_REPORTED", 30)
    monkeypatch.setattr(measure_module, "N_ERROR", 10)
    teacher, task = load_teacher(SIMPLEGOAL), get_task(SIMPLEGOAL)
    policy = VoronoiPolicy(np.zeros((1, 2)), [[[0, 0], [0, 0], [-1, -1]]], task=task)
    row, result = measure(policy, teacher, task), rollout_from_seed(policy, task, 30, seed=REPORT_SEED)
    assert row["mean"] == result.returns.mean() and row["failing"] == np.mean(result.outcomes != 1)
    starts = start_states(task, 10, ERROR_SEED)
    assert row["error_own"] == action_error(policy, teacher, task, starts, by=policy)
    assert row["error_teacher"] == action_error(policy, teacher, task, starts, by=teacher) != row["error_own"]
    assert (row["cells"], row["parameters"], row["operations"]) == (1, 6, 8)
    own = measure(teacher, teacher, task)
    assert (own["error_teacher"], own["error_own"], own["cells"]) == (0, 0, 0)


@pytest.mark.parametrize("seed", range(3))
def test_no_start_that_is_reported_was_chosen_on(seed):
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
    for own in (REPORT_SEED, ERROR_SEED):
        assert not seen & {tuple(row) for row in start_states(get_task(SIMPLEGOAL), 10_000, own)}
    assert len(seen) == 20 + 5 + 2 * 50 + 2 * 5  # both begin their episodes alike, and validate each for itself


def test_the_action_error_by_hand():
    constant = [VoronoiPolicy(np.zeros((1, 2)), [[[0.0], [0.0], [value]]], task=MOUNTAINCAR) for value in (0.5, 0.1)]
    starts = np.array([[-0.5, 0.0]])
    assert action_error(*constant, get_task(MOUNTAINCAR), starts, by=constant[0]) == pytest.approx(0.4)
    torque = VoronoiPolicy(np.zeros((1, 3)), [[[0.0], [0.0], [0.0], [1.0]]], task=PENDULUM)
    still = VoronoiPolicy(np.zeros((1, 3)), np.zeros((1, 4, 1)), task=PENDULUM)
    assert action_error(torque, still, get_task(PENDULUM), np.zeros((1, 2)), by=still) == pytest.approx(0.5)


def test_the_tail_is_the_mean_of_the_worst_hundredth():
    returns = np.arange(1000.0)[::-1]
    assert measure_module.worst(returns) == np.mean(range(10)) and measure_module.worst(returns[:3]) == 997.0


def test_costs_by_hand():
    assert cost(VoronoiPolicy(np.zeros((1, 2)), np.zeros((1, 3, 2)), task=SIMPLEGOAL)) == (6, 8)
    three = VoronoiPolicy(np.arange(6.0).reshape(3, 2), np.zeros((3, 3, 2)), task=SIMPLEGOAL)
    assert cost(three) == (18 + 6, 3 * 6 + 2 + 8)  # differences, sizes and sums per codeword; comparisons; two maps
    states = np.linspace(0, 1, 100)[:, None] * np.ones(2)
    tree = Tree(states, (states > 0.5).astype(float), leaves=2)
    assert cost(tree) == (2 * 2 + 2, 1.0)
    assert cost(LinearTree(states, (states > 0.5).astype(float), leaves=2, task=SIMPLEGOAL)) == (12 + 2, 1.0 + 8)
    both = ObliqueLinearTree(states, (states > 0.5).astype(float), leaves=2, task=SIMPLEGOAL, seed=0)
    assert cost(both) == (12 + 3, 4.0 + 8)
    assert cost(Heuristic()) == (12, 20)
    discrete = tdavq.DiscretePolicy(np.zeros((3, 2)), np.zeros((3, 9)), np.zeros((9, 2)))
    assert cost(discrete) == (3 * (2 + 2), 3 * 6 + 2)
    parameters, operations = cost(load_teacher(SIMPLEGOAL))
    assert parameters == 2 * 400 + 400 + 400 * 300 + 300 + 300 * 2 + 2
    assert operations == 2 * (2 * 400 + 400 * 300 + 300 * 2)
