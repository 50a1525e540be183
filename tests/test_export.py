import ctypes
import dataclasses
import json
import re
import shutil
import subprocess
from functools import partial

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.export import symbol
from vsp.paper import printed
from vsp.policy import VoronoiPolicy
from vsp.subpolicies.registry import policy_class
from vsp.tasks.registry import get_task

TASKS = (SIMPLEGOAL, MOUNTAINCAR, PENDULUM, LUNARLANDER)


def some(task, metric="euclidean", k=7, seed=0):
    rng, task = np.random.default_rng(seed), get_task(task)
    d, m = len(task.low), len(task.action_low)
    scale = rng.uniform(0.5, 2, size=d)
    coefficients = rng.normal(size=(k, d + 1, m))
    return VoronoiPolicy(rng.uniform(task.low, task.high, (k, d)), coefficients, task=task, metric=metric, scale=scale)


def states_of(policy, n, seed=1):
    return np.random.default_rng(seed).uniform(policy.task.low, policy.task.high, size=(n, len(policy.task.low)))


CLASSES = [(form, task) for form in ("constant", "quadratic", "pid", "network") for task in (MOUNTAINCAR, PENDULUM)]
CLASSES += [("quadratic", LUNARLANDER), ("network", LUNARLANDER)]


def other(form, task):
    like, rng = some(task), np.random.default_rng(2)
    (k, _, m), shape = like.coefficients.shape, policy_class(form, like.task)
    coefficients = rng.normal(size=(k, len(shape.rows), m)) / shape.units
    return VoronoiPolicy(like.codewords, coefficients, task=task, scale=like.scale, sub_policy=form)


METRICS = ("manhattan", "euclidean", "chebyshev")
POLICIES = {f"{task}-{metric}": partial(some, task, metric) for task in TASKS for metric in METRICS}
POLICIES |= {f"{task}-{form}": partial(other, form, task) for form, task in CLASSES}
each_policy = pytest.mark.parametrize("make", POLICIES.values(), ids=POLICIES)


def compiled(policy, folder):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: `cc` is not there")
    (folder / "policy.c").write_text(policy.to_c(), encoding="utf-8")
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    library = folder / "policy.so"
    subprocess.run(["cc", *flags, "-o", library, folder / "policy.c", "-lm"], check=True, capture_output=True)
    return ctypes.CDLL(str(library))


@each_policy
def test_the_c_code_acts_as_the_policy_does(make, tmp_path):
    policy = make()
    check_c(policy, compiled(policy, tmp_path), 20_000)


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR])
def test_the_c_code_of_the_published_policies(task, tmp_path):
    policy = printed.published_policy(task)
    check_c(policy, compiled(policy, tmp_path), 20_000)


def check_c(policy, library, n):
    states = states_of(policy, n)
    library.vsp_act.argtypes, library.vsp_act.restype = [ctypes.c_void_p, ctypes.c_void_p], None
    library.vsp_cell.argtypes = [ctypes.c_void_p]
    expected, cells = policy.predict(states)[0], policy.cells(states)
    found = np.full_like(expected, np.nan)
    at, into = (array.ctypes.data + array.strides[0] * np.arange(n) for array in (states, found))
    for i, (state, action) in enumerate(zip(at.tolist(), into.tolist())):
        library.vsp_act(state, action)
        if i % 97 == 0:
            assert library.vsp_cell(state) == cells[i]
    assert np.abs(found - expected).max() <= 1e-12 and len(np.unique(cells)) > 1


def executed(policy):
    """The module that `to_python` writes."""
    module = {}
    exec(compile(policy.to_python(), "policy.py", "exec"), module)
    return module


@each_policy
def test_the_python_code_acts_as_the_policy_does(make):
    policy = make()
    module, states = executed(policy), states_of(policy, 1000)
    assert np.abs([module["act"](s.tolist()) for s in states] - policy.predict(states)[0]).max() <= 1e-12
    assert [module["cell"](s.tolist()) for s in states] == policy.cells(states).tolist()
    assert module["__doc__"].startswith(f"{policy.task.name}: 7 {policy.policy_class.name} policies")


@pytest.mark.parametrize("form", ["constant", "linear", "network"])
def test_a_state_that_is_not_finite_gets_no_action(form, tmp_path):
    """Not full torque: fmax and fmin prefer a limit to NaN, and a constant does not look at the state."""
    policy = other(form, MOUNTAINCAR)
    library, module = compiled(policy, tmp_path), executed(policy)
    for bad in ([np.nan, 0.0], [0.0, np.nan], [np.inf, 0.0], [0.0, -np.inf]):
        state, action = (ctypes.c_double * 2)(*bad), (ctypes.c_double * 1)(0.5)
        library.vsp_act(state, action)
        assert library.vsp_cell(state) == module["cell"](bad) == -1
        assert np.isnan(action[0]) and np.isnan(module["act"](bad)).all()


def test_an_action_that_overflows_is_no_full_torque(tmp_path):
    policy = VoronoiPolicy([[0, 0]], [[[20], [-20], [0]]], task=MOUNTAINCAR)
    state, action = (ctypes.c_double * 2)(1e308, 1e308), (ctypes.c_double * 1)(0.5)
    compiled(policy, tmp_path).vsp_act(state, action)
    assert np.isnan(action[0]) and np.isnan(executed(policy)["act"]([1e308, 1e308])).all()


@pytest.mark.parametrize(
    "name",
    ['"""\nran = 1\n"""', "*/ int ran; /*", "\nran = 1", "\\", '\\"""+ran', "*\\\n/int ran;/*", "/*/"],
)  # fmt: skip
def test_names_are_no_code(name, tmp_path):
    task = dataclasses.replace(get_task(MOUNTAINCAR), name=name, inputs=(name, "v"), outputs=(name,))
    policy = VoronoiPolicy(np.eye(2), np.ones((2, 3, 1)), task=task)
    module, library = executed(policy), compiled(policy, tmp_path)
    assert "ran" not in module and not hasattr(library, "ran")
    assert module["act"]([0.1, 0.2]) == pytest.approx([1.0]) and module["__doc__"].endswith("is the nearest.")
    assert "*/" in name or "/*" in name or module["__doc__"].startswith(name)


@pytest.mark.parametrize(
    "code", ["print(1)", "state[0]; int ran", "__import__('os')", "1 if state[0] else 2", "x", "1\n"]
)
def test_signals_that_are_no_arithmetic_are_refused(code):
    signals = dataclasses.replace(get_task(MOUNTAINCAR).signals, code=(code, "state[1]"))
    task = dataclasses.replace(get_task(MOUNTAINCAR), signals=signals)
    policy = VoronoiPolicy([[0, 0]], np.ones((1, 3, 1)), task=task, sub_policy="pid")
    for export in (policy.to_c, policy.to_python):
        with pytest.raises(ValueError, match="expected arithmetic with state"):
            export()


@each_policy
def test_json_holds_the_same_numbers(make):
    policy = make()
    told = json.loads(policy.to_json())
    arrays = {name: np.array(told[name]) for name in ("codewords", "coefficients", "scale")}
    back = VoronoiPolicy(**arrays, task=told["task"], metric=told["metric"], sub_policy=told["sub_policy"])
    states = states_of(policy, 100)
    assert np.array_equal(back.predict(states)[0], policy.predict(states)[0])
    assert told["inputs"] == list(policy.task.inputs) and told["outputs"] == list(policy.task.outputs)
    assert told["rows"] == list(policy.policy_class.rows)
    assert told["action_low"] == policy.task.action_low.tolist() == [-high for high in told["action_high"]]


def test_latex_by_hand():
    policy = VoronoiPolicy(np.array([[1.0, 0.0, 0.5]]), np.array([[[1.0], [-2.5], [0.0], [0.125]]]), task=PENDULUM)
    assert policy.to_latex(2) == (
        "\\begin{tabular}{ll}\n\\toprule\ncodeword & $\\tau$ \\\\\n\\midrule\n"
        "$[1.00,\\ 0.00,\\ 0.50]$ & $1.00 \\cos \\theta - 2.50 \\sin \\theta + 0.00 \\omega + 0.12$ \\\\\n"
        "\\midrule\n\\multicolumn{2}{l}{One cell, wherever its codeword is} \\\\\n\\bottomrule\n\\end{tabular}\n"
    )


def rounded_policy():
    """As `simplify` leaves them: few digits, some zeros, scaled states."""
    coefficients = np.array([[[0.0], [20.0], [0.0]], [[0.014], [0.0], [-1.5]]])
    codewords = np.array([[-0.5, 0.0], [0.25, 0.013]])
    return VoronoiPolicy(codewords, coefficients, task=MOUNTAINCAR, metric="euclidean", scale=np.array([0.3, 0.02]))


def test_a_policy_in_words_by_hand():
    assert rounded_policy().to_text(None) == (
        "MountainCarContinuous-v0: 2 linear policies, each valid where its codeword is the nearest.\n"
        "Euclidean distances of states divided, x by 0.3, v by 0.02.\n"
        "nearest to x -0.5, v 0:\n  F = 20 v\n"
        "nearest to x 0.25, v 0.013:\n  F = 0.014 x - 1.5\n"
        "limited to F from -1 to 1\n"
    )
    plain = VoronoiPolicy(np.zeros((1, 2)), np.zeros((1, 3, 2)), task=SIMPLEGOAL)
    assert plain.to_text(1).splitlines() == [
        "SimpleGoal-v0: one linear policy.",
        "  Δx = 0.0 x + 0.0 y + 0.0",
        "  Δy = 0.0 x + 0.0 y + 0.0",
        "limited to Δx from -1 to 1, Δy from -1 to 1",
    ]
    two = VoronoiPolicy(np.eye(2), np.zeros((2, 3, 1)), task=MOUNTAINCAR)
    assert two.to_text().splitlines()[1] == "Manhattan distances." and "{Manhattan distances}" in two.to_latex()


def test_latex_of_exact_numbers_says_what_states_are_divided_by():
    code = rounded_policy().to_latex(None)
    assert "$[0.25,\\ 0.013]$ & $0.014 x - 1.5$ " in code and "$20 v$" in code
    assert "{Euclidean distances of states divided by $[0.3,\\ 0.02]$}" in code


@pytest.mark.parametrize("seed", range(5))
def test_what_is_printed_exactly_reads_back_as_the_same_policy(seed):
    rng = np.random.default_rng(seed)
    policy = VoronoiPolicy(rng.normal(size=(3, 2)), rng.normal(size=(3, 3, 1)) * 1e-6, task=MOUNTAINCAR)
    numbers = np.array(re.findall(r"-?\d+\.\d+", policy.to_text(None).replace("- ", "-")), dtype=float)
    assert np.array_equal(numbers, np.concatenate([policy.codewords, policy.coefficients[..., 0]], axis=1).ravel())


@pytest.mark.parametrize(
    ("name", "code"),
    [("x", "x"), ("Δx", r"\Delta x"), ("vx", "v_x"), ("main", r"\mathrm{main}"), ("ω", r"\omega"), ("F", "F"),
     ("cos θ", r"\cos \theta"), ("s0", "s0"), ("ė", r"\dot e"), ("x²", "x^2"), ("vx·vy", "v_x v_y"),
     ("(sin θ)²", r"(\sin \theta)^2"), ("tanh", r"\tanh"), ("load_%", r"load\_\%"), ("v east", r"\mathrm{v\ east}"),
     ("a & b", r"\mathrm{a\ \&\ b}"), ("#1", r"\#1"), ("$x$", r"\$x\$"), ("\\x", r"\backslash x")],
)  # fmt: skip
def test_symbols_by_hand(name, code):
    assert symbol(name) == code


@pytest.mark.parametrize(
    ("form", "column", "equation"),
    [
        ("constant", [0.5], "$0.50$"),
        ("pid", [-2, 1, 0.25], r"$-2.00 e + 1.00 \dot e + 0.25$"),
        ("quadratic", [1, 2, 3, 4, 5, -6], "$1.00 x + 2.00 v + 3.00 x^2 + 4.00 x v + 5.00 v^2 - 6.00$"),
        ("network", [0] * 12 + [1, 2, -3, 4, 5],
         "$" + " ".join(rf"{factor} \tanh(0.00 x + 0.00 v + 0.00)" for factor in ("1.00", "+ 2.00", "- 3.00", "+ 4.00"))
         + " + 5.00$"),
    ],
)  # fmt: skip
def test_equations_of_other_classes_in_latex(form, column, equation):
    policy = VoronoiPolicy([[0, 0]], np.array(column, dtype=float)[None, :, None], task=MOUNTAINCAR, sub_policy=form)
    assert rf"$[0.00,\ 0.00]$ & {equation} \\" in policy.to_latex(2)
