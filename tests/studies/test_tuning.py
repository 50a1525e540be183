from dataclasses import replace

import numpy as np
import pytest
from support import SIMPLEGOAL, TASKS, TEACHERS, examples

from studies.comparison.tuning import TunableTree, tunable, tuned
from studies.rivals.small_network import SmallNetwork
from studies.rivals.trees import LinearTree, ObliqueLinearTree
from vsp import get_task, rollout
from vsp.paper.baselines import Tree, linear_map
from vsp_beyond import Tuned
from vsp_beyond.few_cells.units import Scaling

SMALL = Tuned(n_cells=2, n_episodes=20, n_generations=6, n_tuning_episodes=20, n_validation=100, failure_penalty=10.0)


@pytest.fixture(autouse=True)
def shorter(monkeypatch):
    monkeypatch.setattr(SmallNetwork, "ITERATIONS", 20)


KINDS = {
    "CART": lambda x, y, task: Tree(x, y, leaves=6),
    "linear tree": lambda x, y, task: LinearTree(x, y, leaves=6, task=task),
    "oblique tree": lambda x, y, task: ObliqueLinearTree(x, y, leaves=5, task=task, seed=0),
    "constant oblique tree": lambda x, y, task: ObliqueLinearTree(x, y, leaves=5, task=task, seed=0, constant=True),
    "one map": lambda x, y, task: linear_map(x, y, task),
    "network": lambda x, y, task: SmallNetwork(x, y, units=4, task=task, seed=0),
}


def fitted(kind, task):
    """The policy, and as it is tuned."""
    states, actions = examples(task)
    policy = KINDS[kind](states, actions, task)
    return policy, tunable(policy, Scaling.of(get_task(task), states))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_numbers_act_as_the_policy_they_are_of(kind, task):
    policy, numbers = fitted(kind, task)
    other = np.concatenate([examples(task, n=200, seed=1)[0], examples(task)[0]])  # these lie on the cuts
    expected = np.clip(policy.predict(other)[0], get_task(task).action_low, get_task(task).action_high)
    same = numbers.like(numbers.vector)
    assert np.allclose(same.predict(other)[0], expected, atol=1e-6)  # CART's borders are those of float32
    assert kind == "network" or len(same) == len(policy)


@pytest.mark.parametrize(
    ("kind", "n"),
    # 2 inputs, 2 actions; leaves with 2 or 6 numbers; cuts with 1 or 3; 4 units
    [("CART", 5 + 6 * 2), ("linear tree", 5 + 6 * 6), ("oblique tree", 4 * 3 + 5 * 6),
     ("constant oblique tree", 4 * 3 + 5 * 2), ("one map", 6), ("network", 4 * 3 + 5 * 2)],
)  # fmt: skip
def test_all_numbers_are_tuned_and_the_structure_is_not(kind, n):
    _, numbers = fitted(kind, SIMPLEGOAL)
    states = examples(SIMPLEGOAL, seed=1)[0]
    assert numbers.vector.shape == (n,)
    moved = numbers.like(numbers.vector + 0.3)
    assert np.allclose(moved.vector, numbers.vector + 0.3)
    assert not np.allclose(moved.predict(states)[0], numbers.predict(states)[0])
    if isinstance(numbers, TunableTree):
        assert np.array_equal(moved.sides, numbers.sides)
        assert np.array_equal(moved.directions, numbers.directions) != numbers.oblique
        assert not (numbers.constant and moved.maps[:, :-1].any())


@pytest.mark.parametrize("kind", ["linear tree", "one map"])
def test_tuning_raises_the_return_and_is_the_same_again(kind):
    task, teacher = get_task(SIMPLEGOAL), TEACHERS[SIMPLEGOAL]
    start = fitted(kind, SIMPLEGOAL)[0]
    one, again = (tuned(start, teacher, task, SMALL, seed=3) for _ in range(2))
    states = examples(SIMPLEGOAL, seed=1)[0]
    assert np.array_equal(one.predict(states)[0], again.predict(states)[0])
    fresh = task.start(np.random.default_rng(9), 500)
    assert rollout(one, task, fresh).returns.mean() > rollout(start, task, fresh).returns.mean() + 0.5
    untouched = tuned(start, teacher, task, replace(SMALL, n_generations=0), seed=3)
    assert np.allclose(untouched.predict(states)[0], start.predict(states)[0])
