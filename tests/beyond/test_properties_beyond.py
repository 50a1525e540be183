"""What a user calls beyond the paper refuses what it cannot work with, as `test_properties` asks of `vsp`."""

import functools

import numpy as np
import pytest
from spoilt import STATES, TWO, Argument, actor, array, but_for_none, count, name, number, refuses, settings
from support import SIMPLEGOAL, CurvedTeacher, tiny

import vsp_beyond
from vsp_beyond.optimum import best_policy, best_returns
from vsp_beyond.proofs import largest_disturbance, steps_to_goal

TUNED = vsp_beyond.Tuned(
    n_cells=2, n_episodes=2, n_restarts=1, n_steps=4, n_corrections=1, n_correction_episodes=2, n_generations=1,
    n_tuning_episodes=2, n_validation=2,
)  # fmt: skip
FAITHFUL = vsp_beyond.Faithful(
    n_cells=2, tolerance=1.0, n_episodes=2, n_states=20, n_restarts=1, n_generations=1, n_tuning_episodes=2,
    n_validation=2,
)  # fmt: skip
task, seed, teacher = name(SIMPLEGOAL), count(0, least=0), actor(CurvedTeacher())
faithful = Argument(FAITHFUL, [3, "faithful", tiny(), TUNED, {}, np.nan])
tuned = Argument(TUNED, [3, "tuned", tiny(), FAITHFUL, {}, np.nan])
tolerance, finer, both = number(1.0, least=0), number(0.5, least=0.1, most=10.0), {"task": task, "seed": seed}
price, push = but_for_none(number(0.01, least=0.0)), number(0.01, least=0.0, most=1.0)

CASES = {
    "Tuned": (vsp_beyond.Tuned, settings(TUNED, from_zero=("n_corrections", "n_generations"))),
    "Faithful": (vsp_beyond.Faithful, settings(FAITHFUL, from_zero=("n_generations",), any_sign=("margin",))),
    "tuned_preset": (vsp_beyond.tuned_preset, {"task": task}),
    "faithful_preset": (vsp_beyond.faithful_preset, {"task": task, "n_cells": but_for_none(count(2))}),
    "faithful": (vsp_beyond.faithful, {"agent": teacher, "config": faithful} | both),
    "tuned": (vsp_beyond.tuned, {"agent": teacher, "config": tuned} | both),
    "simplify": (vsp_beyond.simplify, {"teacher": teacher, "config": tuned, "tolerance": tolerance} | both),
    "optimum.best_returns": (best_returns, {"starts": array(STATES)}),
    "optimum.best_policy": (best_policy, {"task": task, "finer": finer, "price": price}),
    "proofs.steps_to_goal": (functools.partial(steps_to_goal, TWO), {"disturbance": push, "n": count(20, most=4000)}),
    "proofs.largest_disturbance": (functools.partial(largest_disturbance, TWO), {"n": count(10, most=4000)}),
}


@pytest.mark.parametrize("case", CASES)
def test_what_a_function_cannot_work_with_is_one_clear_error(case):
    refuses(*CASES[case])


def test_the_limit_refuses_before_it_searches():
    good = {"task": SIMPLEGOAL, "config": TUNED, "seed": 0}
    for argument, value in {"task": task, "config": tuned, "seed": seed, "teacher": teacher}.items():
        for bad in value.bad if argument != "teacher" else value.bad[:-2]:
            if bad is not None:
                with pytest.raises(ValueError, match="expected|fails on"):
                    vsp_beyond.at_the_limit(**good | {argument: bad})
