import dataclasses
import functools
import json
import re

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, acted, compiled, random_policy

from studies import zoo as agents
from vsp import VoronoiPolicy, get_task
from vsp.export import symbol
from vsp.paper import published_policy


def states_of(policy, n):
    return np.random.default_rng(1).uniform(policy.task.low, policy.task.high, size=(n, len(policy.task.low)))


SCALED = functools.partial(random_policy, metric="euclidean", scaled=True)
OF_NORMALISED = agents.policy_of("ars", MOUNTAINCAR)  # its agent was trained on normalised observations

each_policy = pytest.mark.parametrize(
    "policy",
    [
        OF_NORMALISED, published_policy(SIMPLEGOAL), SCALED(task=SIMPLEGOAL, metric="manhattan"),
        SCALED(task=MOUNTAINCAR), SCALED(task=PENDULUM, metric="chebyshev"),
        SCALED(task=MOUNTAINCAR, form="constant"), SCALED(task=SIMPLEGOAL, form="quadratic"),
    ],
    ids=lambda policy: f"{policy.task.name}-{policy.metric}-{policy.policy_class.name}",
)  # fmt: skip


def executed(policy):
    """The module that `to_python` writes."""
    module = {}
    exec(compile(policy.to_python(), "policy.py", "exec"), module)
    return module


@each_policy
def test_the_c_code_acts_as_the_policy_does(policy, tmp_path):
    library, states = compiled(policy, tmp_path), states_of(policy, 2000)
    cells, actions = zip(*(acted(library, state, len(policy.task.outputs)) for state in states.tolist()))
    assert np.abs(np.array(actions) - policy.predict(states)[0]).max() <= 1e-12
    assert list(cells) == policy.cells(states).tolist() and len(set(cells)) > 1


@each_policy
def test_the_python_code_acts_as_the_policy_does(policy):
    module, states = executed(policy), states_of(policy, 500)
    assert np.abs([module["act"](s.tolist()) for s in states] - policy.predict(states)[0]).max() <= 1e-12
    assert [module["cell"](s.tolist()) for s in states] == policy.cells(states).tolist()
    assert module["__doc__"].startswith(f"{policy.task.name}: {len(policy)} {policy.policy_class.name} policies")


@pytest.mark.parametrize("form", ["constant", "linear"])
def test_a_state_that_is_not_finite_gets_no_action(form, tmp_path):
    """Not full torque: fmax and fmin prefer a limit to NaN, and a constant does not look at the state."""
    policy = SCALED(task=MOUNTAINCAR, form=form)
    library, module = compiled(policy, tmp_path), executed(policy)
    for bad in ([np.nan, 0.0], [0.0, np.nan], [np.inf, 0.0], [0.0, -np.inf]):
        cell, action = acted(library, bad, 1)
        assert cell == module["cell"](bad) == -1
        assert np.isnan(action).all() and np.isnan(module["act"](bad)).all()


def test_an_action_that_overflows_is_no_full_torque(tmp_path):
    policy = VoronoiPolicy([[0, 0]], [[[20], [-20], [0]]], task=MOUNTAINCAR)
    action = acted(compiled(policy, tmp_path), [1e308, 1e308], 1)[1]
    assert np.isnan(action).all() and np.isnan(executed(policy)["act"]([1e308, 1e308])).all()


@pytest.mark.parametrize("name", ['"""\nran = 1\n"""', "*/ int ran; /*", "\\", "*\\\n/int ran;/*", "/*/"])
def test_names_are_no_code(name, tmp_path):
    task = dataclasses.replace(get_task(MOUNTAINCAR), name=name, inputs=(name, "v"), outputs=(name,))
    policy = VoronoiPolicy(np.eye(2), np.ones((2, 3, 1)), task=task)
    module, library = executed(policy), compiled(policy, tmp_path)
    assert "ran" not in module and not hasattr(library, "ran")
    assert module["act"]([0.1, 0.2]) == pytest.approx([1.0]) and module["__doc__"].endswith("is the nearest.")


@pytest.mark.parametrize("code", ["print(1)", "state[0]; int ran", "1\n"])
def test_features_that_are_no_arithmetic_are_refused(code):
    policy = VoronoiPolicy([[0, 0]], np.ones((1, 3, 1)), task=MOUNTAINCAR)
    policy.policy_class = dataclasses.replace(policy.policy_class, code=(code, "state[1]"))
    for export in (policy.to_c, policy.to_python):
        with pytest.raises(ValueError, match="expected arithmetic with state"):
            export()


@each_policy
def test_json_holds_the_same_numbers(policy):
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


def test_what_is_printed_exactly_reads_back_as_the_same_policy():
    rng = np.random.default_rng(0)
    policy = VoronoiPolicy(rng.normal(size=(9, 2)), rng.normal(size=(9, 3, 1)) * 1e-6, task=MOUNTAINCAR)
    numbers = np.array(re.findall(r"-?\d+\.\d+", policy.to_text(None).replace("- ", "-")), dtype=float)
    assert np.array_equal(numbers, np.concatenate([policy.codewords, policy.coefficients[..., 0]], axis=1).ravel())


def test_latex_of_a_normalised_agents_policy_is_of_raw_observations():
    """The numbers of its lines, acted out by hand, are the actions of the policy and nearly those of the agent."""
    row = r"\$\[(.*?),\\ (.*?)\]\$ & \$(.*?) x ([+-] .*?) v ([+-] .*?)\$"
    lines = re.findall(row, OF_NORMALISED.to_latex(None))
    numbers = np.array([[part.replace(" ", "") for part in line] for line in lines], dtype=float)
    x, y, states = agents.plane(MOUNTAINCAR)
    nearest = np.square((states[:, None] - numbers[:, :2]) / OF_NORMALISED.scale).sum(axis=2).argmin(axis=1)
    forces = np.clip((numbers[nearest, 2:4] * states).sum(axis=1) + numbers[nearest, 4], -1, 1)
    assert np.abs(forces - OF_NORMALISED.predict(states)[0][:, 0]).max() <= 1e-12
    assert np.corrcoef(forces, agents.actions_of("ars", MOUNTAINCAR)[:, 0])[0, 1] > 0.9


@pytest.mark.parametrize(
    ("name", "code"),
    [("x", "x"), ("Δx", r"\Delta x"), ("vx", "v_x"), ("main", r"\mathrm{main}"), ("ω", r"\omega"), ("F", "F"),
     ("cos θ", r"\cos \theta"), ("s0", "s0"), ("x²", "x^2"), ("vx·vy", "v_x v_y"),
     ("(sin θ)²", r"(\sin \theta)^2"), ("load_%", r"load\_\%"), ("v east", r"\mathrm{v\ east}"),
     ("a & b", r"\mathrm{a\ \&\ b}"), ("#1", r"\#1"), ("$x$", r"\$x\$"), ("\\x", r"\backslash x")],
)  # fmt: skip
def test_symbols_by_hand(name, code):
    assert symbol(name) == code
