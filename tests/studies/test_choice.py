import numpy as np
from support import MOUNTAINCAR

from studies.robots import imitation as choice
from vsp import get_task


def test_the_best_are_compared_again_over_more_episodes(monkeypatch):
    """One that is lucky in the first episodes does not win."""
    returns = {"lucky": {2: 9.0, 10: 1.0}, "steady": {2: 5.0, 10: 5.0}, "third": {2: 4.0, 10: 99.0}, "bad": {2: 0.0}}
    asked = []

    def rollout(policy, task, starts):
        asked.append((policy, len(starts)))
        return type("Result", (), {"returns": np.array([returns[policy][len(starts)]])})

    monkeypatch.setattr(choice, "rollout", rollout)
    monkeypatch.setattr(choice, "N_FINALISTS", 2)
    found = choice.most_rewarding(list(returns), get_task(MOUNTAINCAR), 2, np.random.default_rng(0))
    assert found == "steady" and asked[-2:] == [("lucky", 10), ("steady", 10)] and len(asked) == 6
