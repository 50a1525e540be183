"""Check of lesson 2: a class of sub-policy of one's own."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np

from .. import geometry
from ..config import preset
from ..distill import teacher_episodes
from ..envs import Task
from ..export import SHARED
from ..partition import Partition
from ..rollouts import Episode, Policy
from ..subpolicies import FORMS, Form, SubPolicies, form_of
from .feedback import Exercise

FORM = Exercise("2.7", "my_form")
ENOUGH = 0.8  # of the error that constants have; chance features, such as the sine of 50 x, save less


@FORM.checks
def my_form(function: Callable, teacher: Policy, task: Task) -> None:
    """2.7: `my_form(task)` returns a `Form` that is new, consistent, has a right gradient, and beats a constant."""
    form = FORM.call(function, task)
    if not isinstance(form, Form):
        raise FORM.wrong(f"a {type(form).__name__}", "a Form", 1)
    states = np.random.default_rng(0).uniform(task.low, task.high, size=(50, len(task.low)))
    features = _features(form, states)
    known = [name for name in FORMS if name != "pid" or task.signals]
    for name in known:
        if _alike(features, form_of(name, task).features(states)) and type(form) in (Form, type(form_of(name, task))):
            raise FORM.wrong(f"the features of {name!r}", "a class that is not there yet", 1)
    if type(form) is Form and _within(features, form_of("linear", task).features(states)):
        raise FORM.wrong("features that are sums of the state's components", "at least one that is no such sum", 4)
    _code(form, states, features)
    _gradient(form, features, len(task.outputs))
    constant, own = _errors(form_of("constant", task), teacher, task), _errors(form, teacher, task)
    if own > ENOUGH * constant:
        found = f"{own / constant:.0%} of the error that constants have in the same cells"
        raise FORM.wrong(found, f"at most {ENOUGH:.0%}", 4)
    FORM.passed(
        f"{len(form.rows)} parameters per action, {own / constant:.0%} of the error of constants in the same cells."
    )


def _features(form: Form, states: np.ndarray) -> np.ndarray:
    for name in ("terms", "code"):
        if isinstance(getattr(form, name), str):
            single = 'a tuple with an entry per feature; one alone needs a comma: ("...",)'
            raise FORM.wrong(f"a string for `{name}`", single, 2)
    (n, _), q = states.shape, len(form.terms)
    features = FORM.array(FORM.call(form.features, states), (n, q), "features of 50 states", 2)
    if not np.allclose(
        FORM.array(FORM.call(form.features, states[0]), (q,), "features of a single state", 2), features[0]
    ):
        raise FORM.wrong("other features for a single state than for the same one in a batch", "the same", 2)
    FORM.array(FORM.call(form.features, states.reshape(5, 10, -1)), (5, 10, q), "features of 5 x 10 states", 2)
    sizes = FORM.array(form.sizes, (q,), "sizes", 2)
    if (sizes <= 0).any() or len(form.code) != q:
        raise FORM.wrong(f"{len(form.code)} pieces of code and sizes {sizes}", f"{q} of both, sizes above 0", 2)
    return features


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two sets of features span the same functions, each with a constant."""
    return _within(a, b) and _within(b, a)


def _within(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether features `a` are sums of features `b` and a constant."""
    both, alone = (np.column_stack([*parts, np.ones(len(a))]) for parts in ((a, b), (b,)))
    return np.linalg.matrix_rank(both) == np.linalg.matrix_rank(alone)


def _code(form: Form, states: np.ndarray, features: np.ndarray) -> None:
    """Whether the code says what the features are."""
    names = {name: getattr(math, name) for name in SHARED}
    for j, text in enumerate(form.code):
        if found := re.search(r"\*\*|//| if ", text):
            raise FORM.wrong(f"{found[0].strip()!r} in the code {text!r}", "what C has too, such as products", 3)
        try:
            values = [float(eval(text, {"__builtins__": {}}, {**names, "state": state})) for state in states]
        except Exception as error:
            raise FORM.wrong(
                f"{type(error).__name__} ({error}) in the code {text!r}",
                f"an expression of state[0], state[1], ... with no functions but {', '.join(SHARED)}",
                3,
            ) from None
        if not np.allclose(values, features[:, j]):
            raise FORM.wrong(f"code {text!r} that gives other numbers than feature {form.terms[j]!r}", "the same", 3)


def _gradient(form: Form, features: np.ndarray, m: int) -> None:
    """Whether the gradient of the loss by the parameters agrees with finite differences."""
    rng = np.random.default_rng(1)
    inputs = np.column_stack([features, np.ones(len(features))])[None]
    theta, actions = rng.normal(size=(1, len(form.rows), m)), rng.normal(size=(1, len(features), m))

    def loss(parameters: np.ndarray) -> float:
        return float(np.square(form.batch(inputs, parameters)[0] - actions).sum())

    outputs, pull_back = form.batch(inputs, theta)
    if not np.allclose(outputs[0], form.outputs(features, theta[0])):
        raise FORM.wrong("other outputs in training (`batch`) than in use (`outputs`)", "the same", 3)
    own = pull_back(2 * (outputs - actions))
    for index in np.ndindex(theta.shape):
        step = np.zeros_like(theta)
        step[index] = 1e-6 * max(1.0, abs(theta[index]))
        slope = (loss(theta + step) - loss(theta - step)) / (2 * step[index])
        if not np.isclose(own[index], slope, rtol=1e-3, atol=1e-3):
            raise FORM.wrong(
                f"a gradient of {own[index]:.4g} by parameter {index[1]}", "the slope that finite differences have", 3
            )


def _errors(form: Form, teacher: Policy, task: Task) -> float:
    """Mean squared error after training, in the cells of eight codewords, on fresh states of the teacher."""
    rng = np.random.default_rng(7)
    seen, fresh = (list(teacher_episodes(teacher, task, 300, rng)) for _ in range(2))
    states, actions = (np.concatenate([getattr(e, part) for e in seen]) for part in ("states", "actions"))
    partition = Partition(task, preset(task.name))
    partition.models = SubPolicies(form, len(task.outputs), initial="uniform")
    partition.buffers = type(partition.buffers)(len(form.terms), len(task.outputs))
    for codeword in states[rng.choice(len(states), 8, replace=False)]:
        partition.add(codeword, rng)
    partition.observe(Episode(states, actions))
    cells = np.flatnonzero(partition.buffers.counts)
    for rate in (0.05,) * 400 + (0.01,) * 400:
        inputs, goals = partition.buffers.sample(cells, 128, rng)
        partition.models.train(cells, inputs, goals, learning_rate=rate)
    states, actions = (np.concatenate([getattr(e, part) for e in fresh]) for part in ("states", "actions"))
    own = partition.models.parameters[geometry.nearest(partition.codewords, states)]
    return float(np.square(form.outputs(form.features(states), own) - actions).mean())
