import dataclasses

import numpy as np
import pytest
import small
from support import SIMPLEGOAL, CurvedTeacher

from studies.comparison import makers
from studies.comparison.methods import FOUND, METHODS, methods_of
from vsp import get_task, load_teacher
from vsp.paper import printed

SMALL = dataclasses.replace(small.SMALL, failure_penalty=100.0, n_validation=30)
SIZED = [name for name, method in methods_of(SIMPLEGOAL, "methods").items() if method.sizes != FOUND]


def make(name, size=3, seed=0, task=None):
    method = METHODS[name]
    config = dataclasses.replace(SMALL, n_cells=size)
    return method.make(load_teacher(SIMPLEGOAL), task or get_task(SIMPLEGOAL), config, seed, **method.settings)


@pytest.mark.parametrize("name", SIZED)
def test_every_method_gives_a_policy_of_its_size_for_the_same_episodes_of_the_teacher(name):
    """The teacher plays 20 episodes and labels 20 of the policy's; who asks for no labels has 40 of the teacher's."""
    played, start = [], get_task(SIMPLEGOAL).start
    task = dataclasses.replace(get_task(SIMPLEGOAL), start=lambda rng, n: played.append(n) or start(rng, n))
    policy = make(name, task=task)
    assert len(policy) == 3
    played.remove(SMALL.n_validation)  # whose states nobody is fitted to
    if name.startswith("our cells") and name != "our cells":
        played.remove(SMALL.n_tuning_episodes)  # where no teacher is asked
    corrections = name != "our cells, no correction"
    assert sum(played) == (40 if corrections else 20)


@pytest.mark.parametrize(("by_chance", "seeds"), [(True, [10, 11, 10, 10]), (False, [5, 5, 5])])
def test_a_fit_by_chance_gets_the_restarts_of_the_budget_and_the_best_is_corrected(monkeypatch, by_chance, seeds):
    asked = []

    def fit(states, actions, *, size, task, seed):
        asked.append((seed, len(states)))
        return printed.published_policy(SIMPLEGOAL)

    monkeypatch.setitem(makers.FITS, "published", fit)
    makers.corrected(CurvedTeacher(), get_task(SIMPLEGOAL), SMALL, 5, fit="published", rounds=2, by_chance=by_chance)
    assert [seed for seed, _ in asked] == seeds
    *first, second, third = [size for _, size in asked]
    assert len(set(first)) == 1 and first[0] < second < third


@pytest.mark.parametrize("name", ["our cells", "faithful", "at the limit", "CART"])
def test_the_seed_is_passed_on(monkeypatch, name):
    for where in ("distill_tuned", "distill_faithfully", "search_limit", "dagger"):
        monkeypatch.setattr(f"studies.comparison.makers.{where}", lambda *given, seed, **how: [seed])
    assert np.ravel(make(name, seed=7)).tolist() == [7]


def test_an_ablation_changes_one_setting(monkeypatch):
    asked = []
    monkeypatch.setattr(makers, "distill_tuned", lambda teacher, task, config, *, seed: (asked.append(config), seed))
    changed = [how for name, how in METHODS.items() if how.make is makers.our_cells and how.tasks]
    for how in changed:
        how.make(CurvedTeacher(), get_task(SIMPLEGOAL), SMALL, 7, **how.settings)
    assert asked == [dataclasses.replace(SMALL, **how.settings) for how in changed] and len(asked) == 7
