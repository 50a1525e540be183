"""What a user calls beyond the paper refuses what it cannot work with, as `test_properties` asks of `vsp`."""

import dataclasses

import numpy as np
import pytest
from spoilt import Argument, actor, but_for_none, count, name, number, refuses, settings
from support import MOUNTAINCAR, SIMPLEGOAL, Constant, CurvedTeacher, tiny

import vsp
import vsp_beyond

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
PID = vsp.VoronoiPolicy(np.zeros((1, 2)), np.zeros((1, 3, 1)), task=MOUNTAINCAR, sub_policy="pid")

CASES = {
    "Tuned": (vsp_beyond.Tuned, settings(TUNED, from_zero=("n_corrections", "n_generations"))),
    "Faithful": (vsp_beyond.Faithful, settings(FAITHFUL, from_zero=("n_generations",), any_sign=("margin",))),
    "tuned_preset": (vsp_beyond.tuned_preset, {"task": task}),
    "faithful_preset": (vsp_beyond.faithful_preset, {"task": task, "n_cells": but_for_none(count(2))}),
    "faithful": (vsp_beyond.faithful, {"agent": teacher, "task": task, "config": faithful, "seed": seed}),
    "tuned": (vsp_beyond.tuned, {"agent": teacher, "task": task, "config": tuned, "seed": seed}),
    "simplify": (
        vsp_beyond.simplify,
        {"teacher": teacher, "task": task, "config": tuned, "tolerance": number(1.0, least=0), "seed": seed},
    ),
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


@pytest.mark.parametrize("policy", [PID, None, CurvedTeacher()])
def test_only_linear_policies_are_proved(policy):
    """The PID class of MountainCar has as many parameters as the linear one: nothing else would notice."""
    with pytest.raises(ValueError, match="expected"):
        vsp_beyond.prove(policy)


def test_rewards_that_are_no_numbers_are_one_clear_error():
    plain = vsp.get_task(SIMPLEGOAL)

    def step(states, actions):
        moved, rewards, outcomes = plain.step(states, actions)
        return moved, np.full_like(rewards, np.nan), outcomes

    with pytest.raises(ValueError, match="rewards of Broken .*nan.*expected finite"):
        vsp_beyond.faithful(
            Constant(-1.0, -1.0), dataclasses.replace(plain, name="Broken", step=step), FAITHFUL, seed=0
        )
