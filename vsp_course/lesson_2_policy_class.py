"""Check of lesson 2: a sub-policy class written by the student."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import approx_fprime

from vsp import Partition, Policy, PolicyClass, Task, preset, teacher_episodes
from vsp.export import SHARED
from vsp.rollouts import Episode, Episodes
from vsp.subpolicies import POLICY_CLASSES, policy_class
from vsp.subpolicies.base import PYTHON, linear_outputs

from .feedback import Exercise

OWN_CLASS = Exercise("2.7", "my_policy_class")
ENOUGH = 0.8  # of the error that constants have; arbitrary features, such as the sine of 50 x, save less


@OWN_CLASS.checks
def my_policy_class(function: Callable, teacher: Policy, task: Task) -> None:
    """2.7: `my_policy_class(task)` returns a `PolicyClass`: new, with a right gradient, better than constants."""
    own_class = OWN_CLASS.call(function, task)
    OWN_CLASS.refuse_if(not isinstance(own_class, PolicyClass), f"a {type(own_class).__name__}", "a PolicyClass", 1)
    states = np.random.default_rng(0).uniform(task.low, task.high, size=(50, len(task.low)))
    features = _features(own_class, states)
    _code(own_class, states, features)
    _gradient(own_class, features, len(task.outputs))
    theta = np.random.default_rng(2).normal(size=(len(own_class.rows), 1))
    plain = np.allclose(own_class.outputs(features, theta), linear_outputs(features, theta))  # weighted sums, no more
    for name in POLICY_CLASSES:
        known = policy_class(name, task).features(states)
        there = plain and _within(features, known) and _within(known, features)
        OWN_CLASS.refuse_if(there, f"the features of {name!r}", "a class that is not there yet", 1)
    sums = plain and _within(features, states)
    OWN_CLASS.refuse_if(sums, "features that are sums of the state's components", "at least one that is no such sum", 4)
    constant, error = _errors(policy_class("constant", task), teacher, task), _errors(own_class, teacher, task)
    share = f"{error / constant:.0%} of the error that constants have in the same cells"
    OWN_CLASS.refuse_if(error > ENOUGH * constant, share, f"at most {ENOUGH:.0%}", 4)
    linear = _errors(policy_class("linear", task), teacher, task)
    number = f"{len(own_class.rows)} coefficients per action"
    OWN_CLASS.passed(f"{number}, {share}; x and y alone have {linear / constant:.0%}.")


def _features(own_class: PolicyClass, states: np.ndarray) -> np.ndarray:
    for name in ("terms", "code"):
        single = 'a tuple with an entry per feature; one alone needs a comma: ("...",)'
        OWN_CLASS.refuse_if(isinstance(getattr(own_class, name), str), f"a string for `{name}`", single, 2)
    q, features = len(own_class.terms), []
    for batch, name in ((states, "50 states"), (states[0], "a single state"), (states.reshape(5, 10, -1), "5 x 10")):
        made = OWN_CLASS.call(own_class.features, batch)
        features.append(OWN_CLASS.array(made, (*batch.shape[:-1], q), f"features of {name}", 2))
    same = np.allclose(features[0][0], features[1])
    OWN_CLASS.refuse_if(not same, "other features for a single state than for the same one in a batch", "the same", 2)
    sizes, n = OWN_CLASS.array(own_class.sizes, (q,), "sizes", 2), len(own_class.code)
    wrong = (sizes <= 0).any() or n != q
    OWN_CLASS.refuse_if(wrong, f"{n} pieces of code and sizes {sizes}", f"{q} of both, sizes above 0", 2)
    ratio = np.abs(features[0]).max(axis=0) / sizes
    far = ratio[(ratio < 0.1) | (ratio > 10)]
    OWN_CLASS.refuse_if(far.size > 0, f"a feature of {far[:1]} times its size", "its largest absolute value, about", 2)
    return features[0]


def _within(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether features `a` are linear combinations of features `b` and a constant, up to a hundredth of their size."""
    alone, size = np.column_stack([b, np.ones(len(b))]), a.std(axis=0).max()
    return bool((np.abs(a - alone @ np.linalg.lstsq(alone, a, rcond=None)[0]) <= 0.01 * size).all())


def _code(own_class: PolicyClass, states: np.ndarray, features: np.ndarray) -> None:
    """Whether the exported code computes the same features."""
    names = {name: getattr(math, name) for name in SHARED}
    for j, text in enumerate(own_class.code):
        if python := PYTHON.search(text):
            raise OWN_CLASS.wrong(f"{python[0].strip()!r} in the code {text!r}", "what C has too, such as products", 3)
        try:
            values = [float(eval(text, {"__builtins__": {}}, {**names, "state": state})) for state in states]
        except Exception as error:
            failure = f"{type(error).__name__} ({error}) in the code {text!r}"
            expected = f"an expression of state[0], state[1], ... with no functions but {', '.join(SHARED)}"
            raise OWN_CLASS.wrong(failure, expected, 3) from None
        other = f"code {text!r} that gives other numbers than feature {own_class.terms[j]!r}"
        OWN_CLASS.refuse_if(not np.allclose(values, features[:, j]), other, "the same", 3)
    own_class.feature_code()


def _gradient(own_class: PolicyClass, features: np.ndarray, m: int) -> None:
    """Whether the gradient of the loss by the coefficients agrees with finite differences."""
    rng = np.random.default_rng(1)
    inputs = np.column_stack([features, np.ones(len(features))])[None]
    theta, actions = rng.normal(size=(1, len(own_class.rows), m)), rng.normal(size=(1, len(features), m))

    def loss(coefficients: np.ndarray) -> float:
        return float(np.square(own_class.batch(inputs, coefficients.reshape(theta.shape))[0] - actions).sum())

    outputs, pull_back = own_class.batch(inputs, theta)
    if not np.allclose(outputs[0], own_class.outputs(features, theta[0])):
        raise OWN_CLASS.wrong("other outputs in training (`batch`) than in use (`outputs`)", "the same", 3)
    off = pull_back(2 * (outputs - actions)).ravel() - (slopes := approx_fprime(theta.ravel(), loss, 1e-6))
    wrong = not (np.abs(off) <= 1e-2 + 1e-3 * np.abs(slopes)).all()
    OWN_CLASS.refuse_if(wrong, f"a gradient off by up to {np.abs(off).max():.4g}", "the slopes of the loss", 3)


def _errors(own_class: PolicyClass, teacher: Policy, task: Task) -> float:
    """Mean squared error after training, in the cells of eight codewords, on fresh states of the teacher."""
    rng = np.random.default_rng(7)
    seen, fresh = (Episodes(teacher_episodes(teacher, task, 300, rng)) for _ in range(2))
    config = replace(preset(task), sub_policy=lambda task: own_class, n_minibatches=400, batch_size=128)
    partition = Partition(task, config)
    for codeword in seen.states[rng.choice(len(seen.states), 8, replace=False)]:
        partition.add(codeword, rng)
    partition.observe(Episode(seen.states, seen.actions))
    for rate in (0.05, 0.01):
        partition.config = replace(config, learning_rate=rate)
        partition.train(rng)
    return float(np.square(partition.policy().linear(fresh.states) - fresh.actions).mean())
