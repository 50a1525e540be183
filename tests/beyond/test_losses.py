import numpy as np
import pytest
from support import PENDULUM

from vsp.rollouts import rollout
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import load_teacher
from vsp_beyond.optimum import best_policy
from vsp_beyond.optimum.losses import PENDULUM_REGIONS as REGIONS
from vsp_beyond.optimum.losses import held, losses, swung


def test_held_by_hand():
    angle = np.array([0.0, 0.4, 0.6, 0.0, np.pi])
    seen = np.column_stack([np.cos(angle), np.sin(angle), [0.0, 1.9, 0.0, 2.1, 0.0]])
    assert held(seen).tolist() == [True, True, False, False, False] == (~swung(seen)).tolist()


def test_losses_add_up_to_the_regret():
    task, teacher, best = get_task(PENDULUM), load_teacher(PENDULUM), best_policy(PENDULUM, finer=0.3)
    starts = task.start(np.random.default_rng(0), 60)
    found = losses(teacher, best, task, starts, REGIONS)
    regret = (rollout(best, task, starts).returns - rollout(teacher, task, starts).returns).mean()
    assert found.steps.sum() == pytest.approx(1) and found.steps["hold"] > 0.7
    assert found.lost.sum() == pytest.approx(regret, abs=1.0) and (found.lost > -0.5).all()
    assert found.lost["swing-up"] > found.lost["hold"]


def test_the_best_loses_nothing():
    task, best = get_task(PENDULUM), best_policy(PENDULUM, finer=0.5)
    starts = task.start(np.random.default_rng(0), 50)
    assert losses(best, best, task, starts, REGIONS).lost.sum() == pytest.approx(0, abs=1e-9)
