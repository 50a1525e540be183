import dataclasses
import re

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.subpolicies import POLICY_CLASSES, SubPolicies, policy_class
from vsp.tasks import get_task


def linear(d):
    """The paper's class for any number of inputs."""
    box = {"inputs": tuple(f"s{i}" for i in range(d)), "low": -np.ones(d), "high": np.ones(d)}
    return policy_class("linear", dataclasses.replace(get_task(SIMPLEGOAL), **box))


def models_of(k, d=2, m=2, *, form=None, seed=0, **options):
    """Untrained sub-policies of k cells."""
    models, rng = SubPolicies(form or linear(d), m, **options), np.random.default_rng(seed)
    for _ in range(k):
        models.add(rng)
    return models


def minibatch(rng, c, size, d=2, m=2):
    inputs = np.concatenate([rng.normal(size=(c, size, d)), np.ones((c, size, 1))], axis=2)
    return inputs, rng.normal(size=(c, size, m))


# Training


@pytest.mark.parametrize("d", [1, 9])
def test_first_parameters_are_uniform_as_in_torch_linear(d):
    coefficients, bound = models_of(400, d=d).coefficients, 1 / np.sqrt(d)
    assert 0.98 * bound < np.abs(coefficients).max() <= bound
    assert abs(coefficients.mean()) < 0.1 * bound and coefficients.var() == pytest.approx(bound**2 / 3, rel=0.1)


def test_zeros_draws_as_many_random_numbers_as_uniform():
    rngs = [np.random.default_rng(0), np.random.default_rng(0)]
    for rng, initial in zip(rngs, ("zeros", "uniform")):
        SubPolicies(linear(2), 2, initial=initial).add(rng)
    assert rngs[0].random() == rngs[1].random()
    assert not models_of(3, initial="zeros").coefficients.any()


def test_restart_makes_adam_as_new_and_leaves_the_map():
    inputs, actions = minibatch(np.random.default_rng(0), 2, 8)
    models, fresh = models_of(2), models_of(2)
    for _ in range(3):
        models.train(np.arange(2), inputs, actions, learning_rate=0.1)
    fresh.coefficients = models.coefficients.copy()
    models.restart_adam(np.array([True, False]))
    assert np.array_equal(models.coefficients, fresh.coefficients)
    for each in (models, fresh):
        each.train(np.arange(2), inputs, actions, learning_rate=0.1)
    assert np.array_equal(models.coefficients[0], fresh.coefficients[0])
    assert not np.array_equal(models.coefficients[1], fresh.coefficients[1])


# Classes

CASES = [(name, MOUNTAINCAR) for name in POLICY_CLASSES] + [("quadratic", PENDULUM), ("quadratic", LUNARLANDER)]
each_class = pytest.mark.parametrize(("name", "task"), CASES)


def some_states(task, n=50, seed=0):
    return np.random.default_rng(seed).uniform(task.low, task.high, size=(n, len(task.low)))


@each_class
def test_no_feature_is_larger_than_its_size_and_raw_ones_have_size_1(name, task):
    task = get_task(task)
    form = policy_class(name, task)
    largest = np.abs(form.features(some_states(task, 20_000))).max(axis=0)
    if name == "linear":
        assert (form.sizes == 1).all() and (form.units == 1).all()  # the paper's maps are trained on raw states
    else:
        assert (largest <= form.sizes).all() and (largest > 0.8 * form.sizes).all()
    assert len(form.terms) == len(form.code) == len(form.sizes) and form.units.shape == (len(form.rows), 1)


def test_an_input_without_limits_keeps_its_unit():
    task = dataclasses.replace(get_task(SIMPLEGOAL), low=np.array([-np.inf, 0]), high=np.array([np.inf, 0]))
    assert policy_class("quadratic", task).sizes.tolist() == [1, 1, 1, 1, 1]


@each_class
def test_one_state_a_batch_and_the_training_see_the_same_outputs(name, task):
    task = get_task(task)
    form, states, rng = policy_class(name, task), some_states(task).reshape(5, 10, -1), np.random.default_rng(1)
    coefficients = rng.normal(size=(5, len(form.rows), 2)) / form.units
    features = form.features(states)
    outputs, _ = form.batch(np.concatenate([features, np.ones((5, 10, 1))], axis=2), coefficients)
    for cell in range(5):
        batch = form.outputs(features[cell], np.tile(coefficients[cell], (10, 1, 1)))
        singles = [form.outputs(row, coefficients[cell]) for row in features[cell]]
        assert np.allclose(batch, outputs[cell], rtol=1e-12, atol=1e-12) and np.allclose(singles, batch, atol=1e-12)


def test_a_quadratic_map_trains_as_a_linear_one_of_scaled_features():
    task, rng = get_task(MOUNTAINCAR), np.random.default_rng(0)
    form = policy_class("quadratic", task)
    quadratic, scaled = models_of(1, m=1, form=form, initial="zeros"), models_of(1, d=5, m=1, initial="zeros")
    for _ in range(50):
        features = form.features(some_states(task, 16, rng.integers(100)))
        actions = rng.normal(size=(1, 16, 1))
        for models, sizes in ((quadratic, 1.0), (scaled, form.sizes)):
            inputs = np.column_stack([features / sizes, np.ones(16)])
            models.train(np.array([0]), inputs[None], actions, learning_rate=0.01)
    assert np.allclose(quadratic.comparable(), scaled.coefficients, atol=1e-6)
    assert np.abs(scaled.coefficients).max() > 0.05


@each_class
def test_first_parameters_stay_within_their_bounds(name, task):
    form = policy_class(name, get_task(task))
    largest = np.abs(models_of(200, form=form).comparable()).max(axis=(0, 2))
    assert (largest <= form.bounds[:, 0] * (1 + 1e-12)).all() and (largest > 0.9 * form.bounds[:, 0]).all()


@pytest.mark.parametrize("name", ["constant", "linear", "quadratic"])
def test_an_expression_read_as_a_formula_gives_the_output(name):
    form = policy_class(name, get_task(SIMPLEGOAL))
    column = np.random.default_rng(4).normal(size=len(form.rows))
    formula = re.sub(r"(\d) ([xy])", r"\1*\2", form.expression(column, 12).replace("²", "**2").replace("·", "*"))
    for x, y in some_states(get_task(SIMPLEGOAL), 5):
        expected = form.outputs(form.features(np.array([x, y])), column[:, None])[0]
        assert eval(formula, {"x": x, "y": y}) == pytest.approx(expected, abs=1e-10)


# Least squares


def solve(models, cells, inputs, actions):
    models.solve(np.array(cells), inputs.transpose(0, 2, 1) @ inputs, inputs.transpose(0, 2, 1) @ actions)


@pytest.mark.parametrize("name", POLICY_CLASSES)
def test_solving_is_least_squares(name):
    task = get_task(MOUNTAINCAR)
    models = models_of(3, form=policy_class(name, task))
    features = models.policy_class.features(some_states(task, 80).reshape(2, 40, 2))
    inputs = np.concatenate([features, np.ones((2, 40, 1))], axis=2)
    actions = np.random.default_rng(0).normal(size=(2, 40, 2))
    untouched, units = models.coefficients[1].copy(), models.policy_class.units
    for _ in range(3):
        solve(models, [0, 2], inputs, actions)
    for cell, x, a in zip((0, 2), inputs, actions):
        expected = np.linalg.lstsq(x, a, rcond=None)[0]
        assert np.allclose(models.coefficients[cell] * units, expected * units, atol=1e-8)
    assert np.array_equal(models.coefficients[1], untouched)


def test_what_the_states_leave_open_stays_as_it_was():
    models = models_of(1, d=2, m=1)
    before = models.coefficients[0, :, 0].copy()
    x = np.linspace(-1, 1, 9)
    inputs = np.stack([x, np.zeros(9), np.ones(9)], axis=1)[None]  # y never varies
    solve(models, [0], inputs, (3 * x - 1)[None, :, None])
    assert models.coefficients[0, :, 0] == pytest.approx([3, before[1], -1], abs=1e-5)
