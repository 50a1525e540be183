"""Every public function that a reader calls refuses what it cannot work with: an error of ours that says what was
expected, never a silent result. Numbers of another type are the same numbers.
"""

import dataclasses
import functools

import numpy as np
import pandas as pd
import pytest
from spoilt import STATES, TWO, Argument, actor, array, but_for_none, count, name, refuses, settings
from support import SIMPLEGOAL, CurvedTeacher, network_teacher, partition_of, tiny

import vsp
from vsp.paper import baselines, statistics
from vsp.rollouts import Episode, standard
from vsp.subpolicies import policy_class
from vsp.teachers.teacher import Teacher

# What good calls are made of

TEACHER = CurvedTeacher()
ACTIONS = (STATES - 0.5) * [1.0, -1.0]
SHORT = tiny(n_epochs=24, n_freeze=4)
HISTORY = vsp.distill(TEACHER, SIMPLEGOAL, SHORT, seed=0)[1]
NET = network_teacher(SIMPLEGOAL)


def weights(**tensors):
    """A teacher of one layer."""
    return Teacher({f"mu.0.{part}": tensor for part, tensor in tensors.items()}, SIMPLEGOAL)


def observe(states, actions):
    partition_of([[0.25, 0.5], [0.75, 0.5]]).observe(Episode(states, actions))


def episodes(**arguments):
    return list(vsp.teacher_episodes(task=vsp.get_task(SIMPLEGOAL), rng=np.random.default_rng(0), **arguments))


teacher_file = Argument(SIMPLEGOAL, ["", "SimpelGoal-v0", "agent.pth", "agent.zip", "agent"])
config = Argument(SHORT, [3, "paper", {}, np.nan])
states, wide = array(STATES), {"free": (1,), "nonempty": True}
pairs = {"states": array(STATES, free=(), nonempty=True), "actions": array(ACTIONS, free=(), nonempty=True)}
task, seed, teacher, n = name(SIMPLEGOAL), count(0, least=0), actor(TEACHER), count(3)
player, n_episodes = {"policy": teacher, "task": task}, {"n_episodes": n, "seed": seed}
starts = {"starts": array(STATES, also=[np.full((1, 2), 1.5), np.full((1, 2), -0.001)])}
codewords = {"codewords": array(STATES, free=(0, 1), nonempty=True, also=[np.vstack([STATES, STATES[3]])])}
cells_of_states = {"codewords": array(STATES, free=(0, 1), nonempty=True), "metric": name("manhattan")}
digits = {"digits": but_for_none(count(3, least=0))}  # None: as many as it takes
cell = {"cell": count(1, least=0, most=1)}
low, high = (array(end, free=(), also=other) for end, other in (
    (np.zeros(2), [np.ones(2), [0, 2]]), (np.ones(2), [-np.ones(2)])))  # fmt: skip
returns = {"returns": array(STATES, any_shape=True, nonempty=True)}

CASES = {
    "agent": (vsp.agent, {"source": Argument(TEACHER, [None, 3, "TD3", np.zeros(2), np.nan])}),
    "load_teacher": (vsp.load_teacher, {"source": teacher_file}),
    "Teacher": (weights, {"weight": array(np.eye(2), free=()), "bias": array(np.zeros(2), free=())}),
    "Teacher.predict": (NET.predict, {"obs": states}),
    "get_task": (vsp.get_task, {"name": task}),
    "preset": (vsp.preset, {"task": task}),
    "Config": (vsp.Config, settings(SHORT)),
    "distill": (vsp.distill, {"teacher": teacher, "task": task, "config": config, "seed": seed}),
    "teacher_episodes": (episodes, {"teacher": teacher, "n": count(2, least=0)}),
    "start_states": (vsp.start_states, {"task": task} | n_episodes),
    "evaluate": (vsp.evaluate, player | n_episodes),
    "rollout_from_seed": (vsp.rollout_from_seed, player | n_episodes),
    "rollout": (vsp.rollout, player | starts),
    "collect_episodes": (vsp.collect_episodes, player | starts),
    "visited_states": (vsp.visited_states, player | {"starts": array(STATES, nonempty=True)}),
    "Episode": (Episode, {"states": array(STATES, **wide), "actions": array(ACTIONS, **wide)}),
    "standard": (standard, {"states": array(STATES, free=(0, 1), nonempty=True)}),
    # Cells
    "nearest": (vsp.nearest, cells_of_states | {"states": states}),
    "geometry.distances": (vsp.geometry.distances, cells_of_states | {"states": states}),
    "geometry.delaunay_neighbours": (vsp.geometry.delaunay_neighbours, codewords),
    "geometry.lookup_neighbours": (vsp.geometry.lookup_neighbours, cells_of_states | {"low": low, "high": high}),
    "Partition.observe": (observe, pairs),
    "History.policy_at": (HISTORY.policy_at, {"n": count(3, least=0, most=23)}),
    "policy_class": (functools.partial(policy_class, task=vsp.get_task(SIMPLEGOAL)), {"sub_policy": name("linear")}),
    # The policy
    "VoronoiPolicy": (
        vsp.VoronoiPolicy,
        {
            "codewords": array(TWO.codewords, free=(), nonempty=True, also=[np.ones((2, 2))]),
            "coefficients": array(TWO.coefficients, free=(), nonempty=True),
            "task": task,
            "metric": name("euclidean"),
            "scale": but_for_none(array(np.ones(2), free=(), also=[np.zeros(2), np.array([1.0, -1.0])])),
            "sub_policy": name("linear"),
        },
    ),
    "VoronoiPolicy.cells": (TWO.cells, {"obs": states}),
    "VoronoiPolicy.linear": (TWO.linear, {"obs": states}),
    "VoronoiPolicy.predict": (TWO.predict, {"obs": states}),
    "VoronoiPolicy.explain": (TWO.explain, {"obs": array(STATES[0], free=())}),
    "VoronoiPolicy.equations": (TWO.equations, cell | digits),
    "VoronoiPolicy.to_latex": (TWO.to_latex, digits),
    "VoronoiPolicy.to_text": (TWO.to_text, digits),
    # The paper
    "paper.published_policy": (vsp.paper.published_policy, {"task": task}),
    "paper.printed_value": (vsp.paper.printed_value, {"id": name("sg_drl_mean")}),
    "paper.hyperparameter_table": (lambda task: vsp.paper.hyperparameter_table([task]), {"task": task}),
    "paper.interpretation_table": (vsp.paper.interpretation_table, {"task": task}),
    "paper.equation_table": (functools.partial(vsp.paper.equation_table, TWO), digits),
    "paper.baselines.linear_map": (baselines.linear_map, pairs | {"task": task}),
    "paper.baselines.kmeans_cells": (
        baselines.kmeans_cells, pairs | {"cells": count(2, most=len(STATES)), "task": task, "seed": seed},
    ),
    "paper.baselines.refit": (functools.partial(baselines.refit, TWO), pairs),
    "paper.baselines.rule_of_thumb": (baselines.rule_of_thumb, {"task": task}),
    "paper.baselines.Tree.predict": (baselines.Tree(STATES, ACTIONS, leaves=3).predict, {"obs": states}),
    "paper.spread": (vsp.paper.spread, returns),
    "paper.interval": (
        functools.partial(vsp.paper.interval, statistic=np.mean), returns | {"n_resamples": count(5), "seed": seed},
    ),
    "paper.statistics.outlier_numbers": (statistics.outlier_numbers, returns),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_a_function_cannot_work_with_is_one_clear_error(case):
    refuses(*CASES[case])


# Numbers of another type are the same numbers: whole ones, float32, a list


def plain(result):
    """What a function returned, as something that NumPy can compare."""
    if isinstance(result, vsp.VoronoiPolicy):
        return result.to_json()
    if isinstance(result, pd.DataFrame):
        return result.to_csv()
    if dataclasses.is_dataclass(result):
        return [plain(getattr(result, field.name)) for field in dataclasses.fields(result)]
    if isinstance(result, list | tuple):
        return [plain(part) for part in result]
    known = (np.ndarray, str, dict, int, float, np.number)
    return result if isinstance(result, known) else type(result).__name__


@pytest.mark.parametrize("case", CASES)
def test_numbers_of_another_type_are_the_same_numbers(case):
    function, arguments = CASES[case]
    good = {argument: value.good for argument, value in arguments.items()}
    arrays = {argument: value for argument, value in good.items() if isinstance(value, np.ndarray)}
    for change in (np.ndarray.tolist, *(lambda a, kind=kind: a.astype(kind) for kind in (np.float32, np.longdouble))):
        if arrays:
            changed = {argument: change(value) for argument, value in arrays.items()}
            np.testing.assert_equal(plain(function(**good | changed)), plain(function(**good)))
