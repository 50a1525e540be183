import dataclasses
import functools
import importlib

import numpy as np
import pytest
from studies.comparison.method_tables import ABLATION, METHODS, OWN
from support import SIMPLEGOAL, CurvedTeacher

from studies.comparison import methods
from studies.comparison.methods import Budget, corrected, refined
from studies.rivals import tdavq
from studies.rivals.soft_tree import SoftTree
from vsp.paper import printed
from vsp.tasks.registry import get_task
from vsp_beyond.few_cells.config import Tuned

SMALL = Tuned(
    n_cells=2, n_episodes=20, n_restarts=2, n_steps=100, batch_size=64, n_corrections=2, n_correction_episodes=10,
    n_generations=1, n_tuning_episodes=10, failure_penalty=100.0, n_validation=30,
)  # fmt: skip
SIZED = [name for name, method in METHODS.items() if method.sizes != OWN]
GAMES = [name for name, method in METHODS.items() if method.tasks is None or SIMPLEGOAL in method.tasks]


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(tdavq, "learn", functools.partial(tdavq.learn, n_steps=100))
    monkeypatch.setattr(
        methods, "distill", lambda teacher, task, config, *, seed: (printed.published_policy(task.name), None)
    )
    monkeypatch.setattr(SoftTree, "N_STEPS", 50)
    monkeypatch.setattr(importlib.import_module("studies.comparison.imitate"), "N_MOVES", 1)  # no function
    short = METHODS["refined, faithful"].settings | {"n_generations": 1, "n_tuning_episodes": 10}
    monkeypatch.setitem(METHODS, "refined, faithful", dataclasses.replace(METHODS["refined, faithful"], settings=short))
    return monkeypatch


def make(name, size=3, seed=0, task=None):
    method = METHODS[name]
    return method.make(Budget(CurvedTeacher(), task or get_task(SIMPLEGOAL), SMALL), size, seed, **method.settings)


@pytest.mark.parametrize("name", GAMES)
def test_every_method_gives_a_policy_of_its_size(quick, name):
    policy = make(name)
    actions, _ = policy.predict(np.random.default_rng(0).random((5, 2)))
    assert actions.shape == (5, 2) and np.abs(actions).max() <= 1
    if name in SIZED:
        assert len(policy) == (2 if name.startswith("soft tree") else 3)  # a power of two


@pytest.mark.parametrize("name", ["refined", "CART", "oblique tree, linear leaves, DAgger", "TD-AVQ"])
def test_seeds_matter_where_there_is_chance(quick, name):
    states = np.random.default_rng(0).random((200, 2))
    one, again, other = (make(name, seed=seed).predict(states)[0] for seed in (1, 1, 2))
    assert METHODS[name].chance and np.array_equal(one, again) and not np.array_equal(one, other)


@pytest.mark.parametrize("name", SIZED)
def test_every_method_has_the_same_budget_of_teacher_episodes(quick, name):
    """The teacher plays 20 episodes and labels 20 of the policy's; who asks for no labels has 40 of the teacher's."""
    played, start = [], get_task(SIMPLEGOAL).start
    task = dataclasses.replace(get_task(SIMPLEGOAL), start=lambda rng, n: played.append(n) or start(rng, n))
    make(name, task=task)
    training = list(played)
    if name != "refined, closest":  # which is chosen on the episodes that it was fitted to
        training.remove(SMALL.n_validation)  # whose states nobody is fitted to
    if name in ("refined", "refined, no teacher", "refined, faithful"):
        training.remove(SMALL.n_tuning_episodes)  # where no teacher is asked; as many as those of a round
    assert sum(training) == 40


@pytest.mark.parametrize(("by_chance", "seeds"), [(True, [10, 11, 10, 10]), (False, [5, 5, 5])])
def test_a_fit_by_chance_gets_the_restarts_of_the_budget_and_the_best_is_corrected(quick, by_chance, seeds):
    asked = []

    def fit(states, actions, *, size, task, seed):
        asked.append((seed, len(states)))
        return printed.published_policy(SIMPLEGOAL)

    budget = Budget(CurvedTeacher(), get_task(SIMPLEGOAL), SMALL)
    corrected(budget, 3, 5, fit=fit, rounds=2, by_chance=by_chance)
    assert [seed for seed, _ in asked] == seeds
    *first, second, third = [size for _, size in asked]
    assert len(set(first)) == 1 and first[0] < second < third


def test_an_ablation_changes_settings_of_the_refinement(monkeypatch):
    asked = []
    monkeypatch.setattr(
        methods, "distill_tuned", lambda teacher, task, config, *, seed: (asked.append((config, seed)), None)
    )
    budget = Budget(CurvedTeacher(), get_task(SIMPLEGOAL), SMALL)
    for changes in ABLATION.values():
        refined(budget, 3, 7, **changes)
        assert all(getattr(SMALL, name) != value for name, value in changes.items())
    assert asked == [(dataclasses.replace(SMALL, n_cells=3, **changes), 7) for changes in ABLATION.values()]
