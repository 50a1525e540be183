from dataclasses import replace

import numpy as np
import pytest
import torch
from support import PENDULUM

from studies.comparison.makers import robot_tree, trained_further
from studies.comparison.tuning import of_tree
from studies.rivals.trees import ObliqueLinearTree
from studies.robots.further_training import train_further
from studies.robots.imitation import LONGER
from studies.robots.settings import Walking
from studies.robots.soft_actor import CLIP_SLOPE, SoftActor
from vsp import get_task, load_teacher, rollout, visited_states
from vsp_beyond.few_cells.search import local_init
from vsp_beyond.few_cells.units import Scaling

TASK, TEACHER = get_task(PENDULUM), load_teacher(PENDULUM)
STATES = visited_states(TEACHER, TASK, TASK.start(np.random.default_rng(0), 20))
FRAME = Scaling.of(TASK, STATES)
FEW = Walking(n_cells=3, n_validation=5, n_steps=160, n_filling=60, gamma=0.98)
WAITS = replace(FEW, n_filling=FEW.n_steps)


def pieces(kind):
    """A frame, the numbers of three linear maps, and the policy they make."""
    if kind == "cells":
        cells = local_init(FRAME.labelled(STATES, TEACHER.predict(STATES)[0]), 3, np.random.default_rng(1))
        return FRAME, cells, FRAME.policy(cells)
    tree = ObliqueLinearTree(STATES, TEACHER.predict(STATES)[0].astype(float), leaves=3, task=PENDULUM, seed=0)
    numbers = of_tree(tree)
    return numbers.frame, numbers, tree


@pytest.mark.parametrize("kind", ["cells", "tree"])
def test_hard_it_acts_as_the_policy_and_cold_it_nearly_does(kind):
    frame, numbers, policy = pieces(kind)
    wanted = policy.predict(STATES)[0] / 2
    observations = torch.tensor(STATES, dtype=torch.float32)
    actor = SoftActor(frame, numbers, temperature=1e-4).eval()
    hard = actor(observations).detach().numpy()
    assert np.mean(np.abs(hard - wanted) > 1e-4) < 0.002  # a threshold of a tree is a state: in float32 it may go left
    cold = actor.train()(observations).detach().numpy()
    assert np.mean(np.abs(cold - wanted) > CLIP_SLOPE) < 0.02  # but at the borders
    warm = SoftActor(frame, numbers, temperature=10.0).train()(observations).detach().numpy()
    assert np.abs(warm - wanted).mean() > 0.05 and np.abs(warm).max() <= 1


@pytest.mark.parametrize("kind", ["cells", "tree"])
def test_every_number_learns_and_comes_back(kind):
    frame, numbers, _ = pieces(kind)
    actor = SoftActor(frame, numbers, temperature=1.0).train()
    assert np.allclose(actor.numbers.vector, numbers.vector, atol=1e-5)
    actor(torch.tensor(STATES, dtype=torch.float32)).square().mean().backward()
    assert (actor.vector.grad != 0).all()


def test_further_training_keeps_the_best_and_repeats():
    frame, numbers, policy = pieces("cells")
    one, again = (train_further(frame, numbers, TEACHER, FEW, seed=0) for _ in range(2))
    assert np.array_equal(one.coefficients, again.coefficients)
    assert np.abs(one.coefficients - policy.coefficients).max() > 1e-3  # one of the trained policies was chosen
    rng = np.random.default_rng(np.random.SeedSequence(0).spawn(2)[0])
    _, many = (TASK.start(rng, n) for n in (FEW.n_validation, LONGER * FEW.n_validation))
    before, after = (rollout(each, TASK, many).returns.mean() for each in (policy, one))
    assert after > before
    assert np.float32(1e-44) * np.float32(1) > 0  # denormal numbers are back


def test_nothing_learns_until_the_replay_buffer_is_filled():
    frame, numbers, policy = pieces("cells")
    assert np.allclose(train_further(frame, numbers, TEACHER, WAITS, seed=0).coefficients, policy.coefficients)


def test_a_single_cell_can_be_trained_further():
    one = FRAME.policy(local_init(FRAME.labelled(STATES, TEACHER.predict(STATES)[0]), 1, np.random.default_rng(1)))
    found = trained_further(TEACHER, TASK, WAITS, 0, imitation=lambda *about: one)
    assert len(found) == 1 and np.allclose(found.coefficients, one.coefficients, atol=1e-5)


def test_a_tree_is_fitted_like_cells_and_trained_further():
    waits = replace(WAITS, n_episodes=3, n_corrections=1, n_correction_episodes=2, n_states=500)
    tree = robot_tree(TEACHER, TASK, waits, 0)
    found = trained_further(TEACHER, TASK, waits, 0, imitation=lambda *about: tree)
    assert len(found) == 3 and np.allclose(found.predict(STATES)[0], tree.predict(STATES)[0], atol=1e-3)
