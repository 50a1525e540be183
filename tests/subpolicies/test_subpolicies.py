import dataclasses
import re

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.subpolicies.network import HIDDEN, Network
from vsp.subpolicies.registry import POLICY_CLASSES, policy_class
from vsp.subpolicies.stacked import SubPolicies
from vsp.tasks.registry import get_task


def linear(d):
    """The paper's class for any number of inputs."""
    box = {"inputs": tuple(f"s{i}" for i in range(d)), "low": -np.ones(d), "high": np.ones(d)}
    return policy_class("linear", dataclasses.replace(get_task(SIMPLEGOAL), **box))


def cells_of(k, d=2, m=2, seed=0, **options):
    models, rng = SubPolicies(linear(d), m, **options), np.random.default_rng(seed)
    for _ in range(k):
        models.add(rng)
    return models


def minibatch(rng, c, size, d=2, m=2):
    inputs = np.concatenate([rng.normal(size=(c, size, d)), np.ones((c, size, 1))], axis=2)
    return inputs, rng.normal(size=(c, size, m))


def test_one_step_by_hand():
    """Map 0, one state x = 2 with action 1: error -1, gradient (-4, -2); Adam's first step moves by the rate."""
    models = cells_of(1, d=1, m=1, initial="zeros")
    loss = models.train(np.array([0]), np.array([[[2.0, 1.0]]]), np.array([[[1.0]]]), learning_rate=0.125)
    assert loss.tolist() == [1.0]
    assert models.parameters[0, :, 0] == pytest.approx([0.125, 0.125], abs=1e-9)


def test_predict_by_hand():
    models = cells_of(1)
    models.parameters[0] = [[1, 2], [3, 4], [5, 6]]
    assert models.predict(0, np.array([10.0, 100.0])).tolist() == [315, 426]


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("steps", [1, 200])
def test_training_equals_torch_cell_by_cell(m, steps):
    torch = pytest.importorskip("torch")
    models, rng = cells_of(3, m=m), np.random.default_rng(1)
    twins = [torch.nn.Linear(2, m, dtype=torch.float64) for _ in range(3)]
    for twin, start in zip(twins, models.parameters):
        twin.weight.data, twin.bias.data = torch.tensor(start[:-1].T), torch.tensor(start[-1])
    optimisers = [torch.optim.Adam(twin.parameters(), lr=0.01) for twin in twins]
    for step in range(steps):
        chosen = np.array([0, 1, 2]) if step % 3 else np.array([0, 2])  # cells without data skip the step
        inputs, actions = minibatch(rng, len(chosen), 16, m=m)
        losses = models.train(chosen, inputs, actions, learning_rate=0.01)
        for c, x, a, loss in zip(chosen, inputs, actions, losses):
            optimisers[c].zero_grad()
            found = torch.nn.functional.mse_loss(twins[c](torch.tensor(x[:, :-1])), torch.tensor(a))
            found.backward()
            optimisers[c].step()
            assert found.item() == pytest.approx(loss, rel=1e-12)
    for twin, parameters in zip(twins, models.parameters):
        theirs = np.vstack([twin.weight.detach().numpy().T, twin.bias.detach().numpy()])
        assert np.allclose(parameters, theirs, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("d", [1, 2, 9])
def test_first_parameters_are_those_of_torch_linear(d):
    torch = pytest.importorskip("torch")
    parameters = cells_of(400, d=d).parameters
    bound = 1 / np.sqrt(d)
    torch.manual_seed(0)
    linears = [torch.nn.Linear(d, 2) for _ in range(400)]
    theirs = max(float(p.detach().abs().max()) for linear in linears for p in linear.parameters())
    assert theirs <= bound + 1e-7 and theirs > 0.98 * bound
    assert 0.98 * bound < np.abs(parameters).max() <= bound
    assert abs(parameters.mean()) < 0.1 * bound and parameters.var() == pytest.approx(bound**2 / 3, rel=0.1)


def test_zeros_draws_as_many_random_numbers_as_uniform():
    rngs = [np.random.default_rng(0), np.random.default_rng(0)]
    for rng, initial in zip(rngs, ("zeros", "uniform")):
        SubPolicies(linear(2), 2, initial=initial).add(rng)
    assert rngs[0].random() == rngs[1].random()
    assert not cells_of(3, initial="zeros").parameters.any()


def test_dropping_cells_takes_their_moments_along():
    rng = np.random.default_rng(0)
    inputs, actions = minibatch(rng, 3, 8)
    models, alone = cells_of(3), cells_of(3)
    for _ in range(5):
        models.train(np.arange(3), inputs, actions, learning_rate=0.1)
        alone.train(np.array([2]), inputs[2:], actions[2:], learning_rate=0.1)
    models.keep(np.array([False, False, True]))
    models.train(np.array([0]), inputs[2:], actions[2:], learning_rate=0.1)
    alone.train(np.array([2]), inputs[2:], actions[2:], learning_rate=0.1)
    assert np.allclose(models.parameters[0], alone.parameters[2], rtol=1e-13)


@pytest.mark.parametrize("cells", [np.array([True, False]), np.array([0])])
def test_restart_makes_adam_as_new_and_leaves_the_map(cells):
    inputs, actions = minibatch(np.random.default_rng(0), 2, 8)
    models = cells_of(2)
    for _ in range(3):
        models.train(np.arange(2), inputs, actions, learning_rate=0.1)
    fresh = cells_of(2)
    fresh.parameters = models.parameters.copy()
    models.restart_adam(cells)
    before = models.parameters.copy()
    assert np.array_equal(before, fresh.parameters)
    for each in (models, fresh):
        each.train(np.arange(2), inputs, actions, learning_rate=0.1)
    assert np.array_equal(models.parameters[0], fresh.parameters[0])
    assert not np.array_equal(models.parameters[1], fresh.parameters[1])


# Classes


CASES = [(name, task) for name in POLICY_CLASSES for task in (SIMPLEGOAL, MOUNTAINCAR, PENDULUM, LUNARLANDER)]
CASES = [(name, task) for name, task in CASES if name != "pid" or task in (MOUNTAINCAR, PENDULUM)]


def some_states(task, n=50, seed=0):
    return np.random.default_rng(seed).uniform(task.low, task.high, size=(n, len(task.low)))


@pytest.mark.parametrize(
    ("name", "task", "state", "features", "rows"),
    [
        ("constant", MOUNTAINCAR, [0.25, 0.5], [], ["bias"]),
        ("linear", MOUNTAINCAR, [0.25, 0.5], [0.25, 0.5], ["x", "v", "bias"]),
        ("quadratic", MOUNTAINCAR, [-0.5, 3], [-0.5, 3, 0.25, -1.5, 9], ["x", "v", "x²", "x·v", "v²", "bias"]),
        ("pid", MOUNTAINCAR, [0.25, 0.5], [0.45 - 0.25, -0.5], ["e", "ė", "bias"]),
        ("pid", PENDULUM, [0, 1, 3], [-np.pi / 2, -3], ["e", "ė", "bias"]),
        ("network", SIMPLEGOAL, [0.25, 0.5], [0.25, 0.5], [*(f"{name}_{h}" for name in ("x", "y", "bias", "unit")
                                                            for h in range(1, HIDDEN + 1)), "bias"]),
    ],
)  # fmt: skip
def test_features_by_hand(name, task, state, features, rows):
    form, state = policy_class(name, get_task(task)), np.array(state, dtype=float)
    assert form.features(state).tolist() == features and list(form.rows) == rows
    assert form.features(np.stack([state] * 3)).tolist() == [features] * 3
    assert form.features(np.zeros((4, 5, len(state)))).shape == (4, 5, len(features))


@pytest.mark.parametrize(("name", "task"), CASES)
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


@pytest.mark.parametrize(("name", "task"), CASES)
def test_one_state_a_batch_and_the_training_see_the_same_outputs(name, task):
    task = get_task(task)
    form, states, rng = policy_class(name, task), some_states(task).reshape(5, 10, -1), np.random.default_rng(1)
    parameters = rng.normal(size=(5, len(form.rows), 2)) / form.units
    features = form.features(states)
    outputs, _ = form.batch(np.concatenate([features, np.ones((5, 10, 1))], axis=2), parameters)
    for cell, (own, theirs) in enumerate(zip(features, outputs)):
        assert np.allclose(form.outputs(own, np.tile(parameters[cell], (10, 1, 1))), theirs, rtol=1e-12, atol=1e-12)
        assert np.allclose([form.outputs(one, parameters[cell]) for one in own], theirs, rtol=1e-12, atol=1e-12)


def twin_of(parameters, d):
    """A network of torch's with the parameters (p,) of one action."""
    import torch

    first, last = torch.nn.Linear(d, HIDDEN, dtype=torch.float64), torch.nn.Linear(HIDDEN, 1, dtype=torch.float64)
    hidden = parameters[: (d + 1) * HIDDEN].reshape(d + 1, HIDDEN)
    first.weight.data, first.bias.data = torch.tensor(hidden[:-1].T), torch.tensor(hidden[-1])
    last.weight.data, last.bias.data = torch.tensor(parameters[None, -HIDDEN - 1 : -1]), torch.tensor(parameters[-1:])
    return torch.nn.Sequential(first, torch.nn.Tanh(), last)


def flat(twin, what):
    """Parameters or gradients of such a network, in our order."""
    first, last = twin[0], twin[2]
    parts = what(first.weight).T, what(first.bias), what(last.weight), what(last.bias)
    return np.concatenate([part.detach().numpy().ravel() for part in parts])


@pytest.mark.parametrize(("d", "m"), [(2, 2), (3, 1), (8, 2)])
def test_the_gradient_of_a_network_is_that_of_torch(d, m):
    torch = pytest.importorskip("torch")
    rng, form = np.random.default_rng(d), Network("network", ("s",) * d, (), np.ones(d), lambda states: states)
    parameters = rng.normal(size=(3, len(form.rows), m))
    inputs, actions = minibatch(rng, 3, 16, d, m)
    outputs, pull_back = form.batch(inputs, parameters)
    found = pull_back(outputs - actions)
    for cell in range(3):
        for j in range(m):
            twin = twin_of(parameters[cell, :, j], d)
            theirs = twin(torch.tensor(inputs[cell, :, :-1]))[:, 0]
            assert np.allclose(theirs.detach(), outputs[cell, :, j], rtol=1e-12)
            (0.5 * (theirs - torch.tensor(actions[cell, :, j])) ** 2).sum().backward()
            assert np.allclose(found[cell, :, j], flat(twin, lambda p: p.grad), rtol=1e-10, atol=1e-12)


def test_networks_train_as_torch_does_on_inputs_divided_by_the_box():
    torch = pytest.importorskip("torch")
    task, rng = get_task(MOUNTAINCAR), np.random.default_rng(0)
    models = SubPolicies(policy_class("network", task), 1)
    models.add(rng)
    reach = np.array([1.2, 0.07])
    start = models.parameters[0, :, 0] * np.concatenate([np.repeat(reach, HIDDEN), np.ones(2 * HIDDEN + 1)])
    assert np.array_equal(models.comparable()[0, :, 0], start)
    twin = twin_of(start, 2)
    optimiser = torch.optim.Adam(twin.parameters(), lr=0.01)
    for _ in range(100):
        states, actions = some_states(task, 16, rng.integers(100)), rng.normal(size=(16, 1))
        inputs = np.column_stack([states, np.ones(16)])
        loss = models.train(np.array([0]), inputs[None], actions[None], learning_rate=0.01)
        optimiser.zero_grad()
        found = torch.nn.functional.mse_loss(twin(torch.tensor(states / reach)), torch.tensor(actions))
        found.backward()
        optimiser.step()
        assert found.item() == pytest.approx(loss[0], rel=1e-5)  # Adam's epsilon is not scaled
    assert np.allclose(models.comparable()[0, :, 0], flat(twin, lambda p: p), atol=1e-4)


def test_a_quadratic_map_trains_as_a_linear_one_of_scaled_features():
    task, rng = get_task(MOUNTAINCAR), np.random.default_rng(0)
    own = SubPolicies(policy_class("quadratic", task), 1, initial="zeros")
    other = SubPolicies(linear(5), 1, initial="zeros")
    for models in (own, other):
        models.add(rng)
    for _ in range(50):
        features = own.policy_class.features(some_states(task, 16, rng.integers(100)))
        actions = rng.normal(size=(1, 16, 1))
        for models, sizes in ((own, 1.0), (other, own.policy_class.sizes)):
            inputs = np.column_stack([features / sizes, np.ones(16)])
            models.train(np.array([0]), inputs[None], actions, learning_rate=0.01)
    assert np.allclose(own.comparable(), other.parameters, atol=1e-6) and np.abs(other.parameters).max() > 0.05


@pytest.mark.parametrize(("name", "task"), CASES)
def test_first_parameters_stay_within_their_bounds(name, task):
    form = policy_class(name, get_task(task))
    models, rng = SubPolicies(form, 2), np.random.default_rng(0)
    for _ in range(200):
        models.add(rng)
    largest = np.abs(models.comparable()).max(axis=(0, 2))
    assert (largest <= form.bounds[:, 0] * (1 + 1e-12)).all() and (largest > 0.9 * form.bounds[:, 0]).all()


@pytest.mark.parametrize(("name", "task"), CASES)
def test_contributions_add_up(name, task):
    task = get_task(task)
    form = policy_class(name, task)
    parameters = np.random.default_rng(2).normal(size=(len(form.rows), 2))
    for state in some_states(task, 5):
        told = form.contributions(state, parameters)
        assert np.allclose(told.sum(axis=1), form.outputs(form.features(state), parameters), rtol=1e-10, atol=1e-10)
        assert told.columns.tolist() == [*form.terms, "rest" if name == "network" else "bias"] and len(told) == 2


def test_contributions_of_a_network_are_inputs_times_slopes():
    form, parameters = policy_class("network", get_task(SIMPLEGOAL)), np.random.default_rng(3).normal(size=(17, 2))
    state, step = np.array([0.3, 0.8]), 1e-6
    for axis, name in enumerate("xy"):
        ends = [form.outputs(state + way * step * np.eye(2)[axis], parameters) for way in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.allclose(form.contributions(state, parameters)[name], state[axis] * slope, atol=1e-8)


@pytest.mark.parametrize("name", ["constant", "linear", "quadratic", "network"])
def test_an_expression_read_as_a_formula_gives_the_output(name):
    form = policy_class(name, get_task(SIMPLEGOAL))
    column = np.random.default_rng(4).normal(size=len(form.rows))
    text = form.expression(column, 12).replace("²", "**2").replace("·", "*")
    formula = re.sub(r"(\d) ([xyt])", r"\1*\2", text)
    for x, y in some_states(get_task(SIMPLEGOAL), 5):
        found = eval(formula, {"x": x, "y": y, "tanh": np.tanh})
        assert found == pytest.approx(form.outputs(form.features(np.array([x, y])), column[:, None])[0], abs=1e-10)


# Least squares


def sums_of(inputs, actions):
    return inputs.transpose(0, 2, 1) @ inputs, inputs.transpose(0, 2, 1) @ actions


def test_solving_one_state_by_hand():
    """Map 0, one state x = 2 with action 5: the least change that answers 5 is (2, 1)."""
    models = cells_of(1, d=1, m=1, initial="zeros")
    models.solve(np.array([0]), *sums_of(np.array([[[2.0, 1.0]]]), np.array([[[5.0]]])))
    assert models.parameters[0, :, 0] == pytest.approx([2, 1], abs=1e-5)


@pytest.mark.parametrize("name", ["constant", "linear", "quadratic", "pid"])
def test_solving_is_least_squares(name):
    task, rng = get_task(MOUNTAINCAR), np.random.default_rng(0)
    models = SubPolicies(policy_class(name, task), 2)
    for _ in range(3):
        models.add(rng)
    features = models.policy_class.features(some_states(task, 120).reshape(3, 40, 2))
    inputs, actions = np.concatenate([features, np.ones((3, 40, 1))], axis=2), rng.normal(size=(3, 40, 2))
    untouched, units = models.parameters[1].copy(), models.policy_class.units
    for _ in range(3):
        models.solve(np.array([0, 2]), *sums_of(inputs[[0, 2]], actions[[0, 2]]))
    for cell in (0, 2):
        expected = np.linalg.lstsq(inputs[cell], actions[cell], rcond=None)[0]
        assert np.allclose(models.parameters[cell] * units, expected * units, atol=1e-8)
    assert np.array_equal(models.parameters[1], untouched)


def test_what_the_states_leave_open_stays_as_it_was():
    models = cells_of(1, d=2, m=1)
    before = models.parameters[0, :, 0].copy()
    x = np.linspace(-1, 1, 9)
    inputs = np.stack([x, np.zeros(9), np.ones(9)], axis=1)[None]  # y never varies
    models.solve(np.array([0]), *sums_of(inputs, (3 * x - 1)[None, :, None]))
    assert models.parameters[0, :, 0] == pytest.approx([3, before[1], -1], abs=1e-5)
