from dataclasses import replace

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher

import vsp
import vsp_beyond
from vsp.rollouts import rollout
from vsp.tasks import GOAL, get_task
from vsp_beyond.few_cells import limit
from vsp_beyond.optimum import best_returns

FEW = replace(
    vsp_beyond.limit_preset(SIMPLEGOAL), n_episodes=100, n_restarts=1, n_steps=300, n_correction_episodes=50,
    n_generations=30, n_tuning_episodes=100, n_validation=300,
)  # fmt: skip


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(limit, "N_STARTS", 2)
    monkeypatch.setattr(limit, "N_SLOW", 1)
    few = vsp_beyond.Faithful(n_cells=4, n_episodes=100, n_restarts=2, n_validation=20)
    monkeypatch.setattr(limit, "faithful_preset", lambda task, n_cells: replace(few, n_cells=n_cells))


def test_a_short_search_comes_near_the_best():
    policy = vsp_beyond.at_the_limit(SIMPLEGOAL, FEW, seed=0)
    starts = vsp.start_states(SIMPLEGOAL, 500, 7)
    result = rollout(policy, SIMPLEGOAL, starts)
    regret = (best_returns(starts) - result.returns)[result.outcomes == GOAL].mean()
    assert len(policy) <= 4 and 0 < regret < 0.3 and (result.outcomes == GOAL).mean() > 0.95


class Recorded:
    """Stands in for the searches, which it notes: teacher, generations, and whether it starts from a policy."""

    def __init__(self, monkeypatch, task):
        self.calls, d, m = [], len(get_task(task).low), len(get_task(task).action_low)
        self.policy = vsp.VoronoiPolicy(np.zeros((1, d)), np.zeros((1, d + 1, m)), task=task)
        for name in ("distill_tuned", "distill_faithfully"):
            monkeypatch.setattr(limit, name, self)

    def __call__(self, teacher, task, config, *, seed, start=None):
        self.calls.append((teacher, config.n_generations, start is not None, seed))
        return self.policy, None


@pytest.mark.parametrize(
    ("task", "searches"),
    [(SIMPLEGOAL, [(0, False), (2, True), (2, False), (10, True)]),
     (LUNARLANDER, [(0, False), (2, True), (10, True), (4, True), (4, True)])],  # two more from the best
)  # fmt: skip
def test_each_start_is_tuned_briefly_and_the_best_to_the_end(monkeypatch, task, searches):
    recorded = Recorded(monkeypatch, task)
    config = replace(vsp_beyond.limit_preset(task), n_generations=10, n_validation=1)
    assert vsp_beyond.at_the_limit(task, config, seed=0, teacher=CurvedTeacher()) is recorded.policy
    assert [call[1:3] for call in recorded.calls] == searches
    assert len({seed for *_, seed in recorded.calls}) == len(searches) - 1  # the first two share theirs


@pytest.mark.parametrize(
    ("task", "teacher"),
    [(MOUNTAINCAR, ("best", MOUNTAINCAR, 3e-3)), (PENDULUM, ("best", PENDULUM, None)), (LUNARLANDER, "shipped")],
)
def test_the_teacher_is_the_best_policy_where_it_is_known_else_the_shipped_one(monkeypatch, task, teacher):
    monkeypatch.setattr(limit, "best_policy", lambda task, price: ("best", task.name, price))
    monkeypatch.setattr(limit, "load_teacher", lambda task: "shipped")
    recorded = Recorded(monkeypatch, task)
    vsp_beyond.at_the_limit(task, replace(vsp_beyond.limit_preset(task), n_validation=1), seed=0)
    assert {call[0] for call in recorded.calls} == {teacher}


def test_without_a_known_teacher_one_is_needed():
    with pytest.raises(ValueError, match="no teacher is known for My-v0: pass one as `teacher`"):
        vsp_beyond.at_the_limit(replace(vsp.get_task(PENDULUM), name="My-v0"), seed=0)
