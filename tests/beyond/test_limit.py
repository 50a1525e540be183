from dataclasses import replace

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.evaluation import start_states
from vsp.rollouts import rollout
from vsp.tasks.base import GOAL
from vsp.teachers.teacher import load_teacher
from vsp_beyond.few_cells import limit
from vsp_beyond.few_cells.config import Faithful, faithful_preset, tuned_preset
from vsp_beyond.few_cells.limit import at_the_limit, limit_preset
from vsp_beyond.optimum import best_returns

FEW = replace(
    limit_preset(SIMPLEGOAL), n_episodes=100, n_restarts=1, n_steps=300, n_correction_episodes=50, n_generations=30,
    n_tuning_episodes=100, n_validation=300,
)  # fmt: skip


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(limit, "N_STARTS", 2)
    few = Faithful(n_cells=4, n_episodes=100, n_restarts=2, n_validation=20)
    monkeypatch.setattr(limit, "faithful_preset", lambda task, n_cells: replace(few, n_cells=n_cells))


def test_a_short_search_comes_near_the_best():
    policy = at_the_limit(SIMPLEGOAL, FEW, seed=0)
    starts = start_states(SIMPLEGOAL, 500, 7)
    result = rollout(policy, SIMPLEGOAL, starts)
    regret = (best_returns(starts) - result.returns)[result.outcomes == GOAL].mean()
    assert len(policy) <= 4 and 0 < regret < 0.3 and (result.outcomes == GOAL).mean() > 0.95


def test_the_same_seed_gives_the_same_policy():
    few = replace(FEW, n_steps=20, n_generations=5)
    one, again, other = (at_the_limit(SIMPLEGOAL, few, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(one.codewords, again.codewords) and np.array_equal(one.coefficients, again.coefficients)
    assert not np.array_equal(one.coefficients, other.coefficients)


def test_each_start_is_tuned_briefly_and_the_best_to_the_end(monkeypatch):
    called, tuned, close = [], limit.distill_tuned, limit.distill_faithfully

    def recorded(teacher, task, config, *, seed, start=None):
        called.append((config.n_generations, start is None))
        return tuned(teacher, task, config, seed=seed, start=start)

    monkeypatch.setattr(limit, "distill_tuned", recorded)
    monkeypatch.setattr(
        limit, "distill_faithfully", lambda *some, **more: called.append("close") or close(*some, **more)
    )
    at_the_limit(SIMPLEGOAL, replace(FEW, n_generations=10), seed=1)
    assert called == ["close", (2, False), (2, True), (10, False)]


def test_the_teacher_is_the_best_policy_where_it_is_known_else_the_shipped_one_or_any(monkeypatch):
    taught, shipped = [], load_teacher(SIMPLEGOAL)
    monkeypatch.setattr(limit, "best_policy", lambda task, price: ("best", task.name, price))
    monkeypatch.setattr(limit, "load_teacher", lambda task: ("shipped", task))
    monkeypatch.setattr(limit, "_screened", lambda teacher, *rest, closest: taught.append(teacher) or 1 / 0)
    for task, teacher in ((MOUNTAINCAR, None), (PENDULUM, None), (LUNARLANDER, None), (SIMPLEGOAL, shipped)):
        with pytest.raises(ZeroDivisionError):
            at_the_limit(task, seed=0, teacher=teacher)
    assert taught == [("best", MOUNTAINCAR, 3e-3), ("best", PENDULUM, None), ("shipped", LUNARLANDER), shipped]


def test_where_a_physics_engine_is_slow_fewer_starts_are_tuned_and_the_best_again(monkeypatch):
    screened, tuned = [], []
    monkeypatch.setattr(limit, "N_SLOW", 1)
    monkeypatch.setattr(limit, "_screened", lambda *some, closest: screened.append(closest) or "policy")
    monkeypatch.setattr(limit, "rollout", lambda *some: None)
    monkeypatch.setattr(limit, "score", lambda *some: 0.0)
    monkeypatch.setattr(limit, "_tuned", lambda policy, *rest: tuned.append(rest[-2:]) or policy)
    assert at_the_limit(LUNARLANDER, seed=0) == "policy" and screened == [True]
    whole = limit_preset(LUNARLANDER).n_generations
    assert [config.n_generations for config, _ in tuned] == [whole, 0.4 * whole, 0.4 * whole]
    assert len({seed for _, seed in tuned}) == 3


def test_what_cannot_be_searched_is_refused():
    with pytest.raises(ValueError, match="expected a Tuned"):
        at_the_limit(SIMPLEGOAL, faithful_preset(SIMPLEGOAL), seed=0)
    with pytest.raises(ValueError, match="seed is -1"):
        at_the_limit(SIMPLEGOAL, seed=-1)
    assert limit_preset(PENDULUM).n_generations > tuned_preset(PENDULUM).n_generations
