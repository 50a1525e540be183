"""Every public function that a reader calls refuses what it cannot work with: an error of ours that says what was
expected, never a silent result. How many cases each, the Hypothesis profile says: few in `make test`, 200 in `make
torture`.
"""

import dataclasses
import functools
import importlib.util
import inspect
import math
import traceback
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import SIMPLEGOAL, Constant, CurvedTeacher, network_teacher, partition_of, tiny

import vsp
from vsp import (
    agents,
    baselines,
    config,
    envs,
    export,
    figures,
    geometry,
    lime,
    moments,
    moves,
    paper,
    policy,
    refine,
    regions,
    rollouts,
    subpolicies,
    tables,
    tdavq,
    teachers,
    trees,
)

distill, evaluate, simplify = map(importlib.import_module, ("vsp.distill", "vsp.evaluate", "vsp.simplify"))
OUTSIDE = {
    "commands and studies, and what reads the tables that they write: their arguments are ours": """
        audit beyond comparison crowd experiments ledger lookup_study measure methods race readings_study scale_study
        scaling study summaries teachers_study training""",
    "draw such tables, and histories, with tests of what they refuse": """
        animation explorer figures_beyond figures_explorer figures_trust""",
    "machinery around the method, each with tests of its own faults": """
        environment machine manifest notebook progress runner store workers""",
    "what the others check with": "checks",
}
MODULES = sorted(
    {path.stem for path in Path(vsp.__file__).parent.glob("[!_]*.py")} - set(" ".join(OUTSIDE.values()).split())
)
NOWHERE = (np.nan, np.inf, -np.inf)


@dataclasses.dataclass(frozen=True)
class Argument:
    """A value that is good, and a strategy for some that are not."""

    good: object
    bad: st.SearchStrategy


def numbers(good, *, free=(0,), some=False, any_shape=False, also=()):
    """An array of numbers: the axes in `free` may be of any length; nothing in it is bad too, if it asks for `some`."""
    good = np.asarray(good, dtype=np.float64)

    def holed(place, value):
        spoilt = good.copy()
        spoilt.flat[place] = value
        return spoilt

    shapes = [] if any_shape else [(1, *good.shape), ()]
    for axis in () if any_shape else set(range(good.ndim)) - set(free):
        shapes += [
            good.shape[:axis] + (n,) + good.shape[axis + 1 :] for n in (0, good.shape[axis] - 1, good.shape[axis] + 1)
        ]
    shapes += [(0, *good.shape[1:])] if some else []
    return Argument(
        good,
        st.builds(holed, st.integers(0, good.size - 1), st.sampled_from(NOWHERE))
        | st.sampled_from([bool, object, str, complex, "M8[s]"]).map(good.astype)
        | st.sampled_from([None, "1.5", {}, [[1.0], [1.0, 2.0]], *also])
        | (st.sampled_from(shapes).map(lambda shape: np.resize(good, shape)) if shapes else st.nothing()),
    )


def count(good, *, least=1, most=None):
    """A whole number."""
    beyond = st.integers(max_value=least - 1) | (st.nothing() if most is None else st.integers(min_value=most + 1))
    return Argument(
        good, beyond | st.sampled_from([good + 0.5, float(good), *NOWHERE, None, str(good), True, [good], 1j])
    )


def number(good, *, least=-math.inf, most=math.inf):
    """A finite number in a range."""
    outside = [value for value in (least - 1, least - 1e-9, most + 1e-9, most + 1) if math.isfinite(value)]
    return Argument(good, st.sampled_from([*outside, *NOWHERE, None, "1", True, [1.0], 1j]))


def choice(good):
    """A name among some that are known."""
    return Argument(
        good, st.text(max_size=6).filter(lambda text: text != good) | st.sampled_from([None, 3, [good], np.nan, {}])
    )


class Broken:
    """A policy whose `predict` gives something else than actions and a state."""

    def __init__(self, answer):
        self.answer = answer

    def predict(self, obs):
        return self.answer


def actor(good, m=2):
    """A policy for a task with m actions."""
    values = [np.nan, np.inf, "up", 1j, True, None]
    bad = [Constant(*[value] * m) for value in values] + [Constant(*[0.0] * n) for n in (0, m - 1, m + 1)]
    return Argument(
        good, st.sampled_from([*bad, *map(Broken, (None, 3.0, (), np.zeros(m))), None, 3, "TD3", np.zeros(2)])
    )


def settings_of(kind, good):
    """The fields of a dataclass of settings."""
    fields = {}
    for name, hint in get_type_hints(kind).items():
        value = getattr(good, name)
        optional = name.endswith("_price") or name in ("n_corrections", "n_generations")
        if get_origin(hint) is Literal:
            fields[name] = Argument(value, choice(value).bad.filter(lambda one, known=get_args(hint): one not in known))
        elif hint is bool:
            fields[name] = Argument(value, st.sampled_from([0, 1, None, "True", np.nan, np.bool_(True), []]))
        elif hint is int:
            fields[name] = count(value, least=0 if optional else 1)
        else:
            fields[name] = number(value, least=0.0)
    return fields


# What good calls are made of: numbers that float32 holds exactly

TASK, TEACHER = envs.get_task(SIMPLEGOAL), CurvedTeacher()
STATES = np.array([(x, y) for x in (0.125, 0.375, 0.625, 0.875) for y in (0.25, 0.5, 0.75)])  # (12, 2)
ACTIONS = (STATES - 0.5) * [1.0, -1.0]
TWO = policy.VoronoiPolicy(
    [[0.0, 0.5], [1.0, 0.5]], [[[1, 0], [0, 2], [0.25, -0.5]], np.zeros((3, 2))], task=SIMPLEGOAL
)
SHORT = tiny(n_epochs=24, n_freeze=4)
REFINEMENT = config.Refinement(
    n_cells=2, n_episodes=2, n_restarts=1, n_steps=4, n_corrections=1, n_correction_episodes=2, n_generations=1,
    n_tuning_episodes=2, n_validation=2,
)  # fmt: skip
HISTORY = distill.distill(TEACHER, SIMPLEGOAL, SHORT, seed=0)[1]
RULES = [
    regions.Rule(0, np.array([-np.inf, -np.inf]), np.array([0.5, np.inf])),
    regions.Rule(1, np.array([0.5, -np.inf]), np.full(2, np.inf)),
]
NET = network_teacher(SIMPLEGOAL)
GRID = geometry.grid(np.zeros(2), np.ones(2), 3)
NAMES = ("x", "y")


def with_critics():
    shapes = {"qf0.0": (1, 4), "qf1.0": (1, 4)}
    critic = {f"{name}.weight": np.ones(shape, np.float32) for name, shape in shapes.items()}
    critic |= {f"{name}.bias": np.zeros(1, np.float32) for name in shapes}
    actor = {
        f"mu.0.{part}": value
        for part, value in (("weight", np.eye(2, dtype=np.float32)), ("bias", np.zeros(2, np.float32)))
    }
    return teachers.Teacher(actor, SIMPLEGOAL, critic=critic)


def weights(**changes):
    """A teacher whose tensors are these."""
    parts = {"weight": np.eye(2), "bias": np.zeros(2)} | changes
    return teachers.Teacher({f"mu.0.{name}": part for name, part in parts.items()}, SIMPLEGOAL)


@functools.cache
def ax(function):
    return figures.panels()[1][0]


def of_ax(function, **fixed):
    """A figure's function, each time on the same axes: what is refused is refused before anything is drawn."""
    return lambda **arguments: function(ax(function), **fixed, **arguments)


class QuickSoftTree(trees.SoftTree):
    N_STEPS = 5


def partition():
    return partition_of([[0.25, 0.5], [0.75, 0.5]])


states, some_states = numbers(STATES, free=(0,)), numbers(STATES, some=True)
pairs = {"states": numbers(STATES, free=(), some=True), "actions": numbers(ACTIONS, free=(), some=True)}
task, seed, teacher = choice(SIMPLEGOAL), count(0, least=0), actor(TEACHER)
player = {"policy": actor(TEACHER), "task": task}
starts = numbers(STATES, also=[np.full((1, 2), 1.5), np.full((1, 2), -0.001)])
points = {"codewords": numbers(STATES, free=(0, 1), some=True), "metric": choice("manhattan")}
lookup = points | {"states": states}
digits = Argument(3, count(3, least=0).bad.filter(lambda one: one is not None))  # None: as many as it takes
cell = count(1, least=0, most=1)
leaves = count(3)
budget = Argument(REFINEMENT, st.sampled_from([3, "best", SHORT, {}, np.nan]))
x_y = {"x": Argument(GRID[0], numbers(GRID[0], free=()).bad), "y": Argument(GRID[1], numbers(GRID[1], free=()).bad)}
values_on_grid = numbers(np.arange(9.0) % 2, free=(), any_shape=True, also=[np.zeros(8), np.zeros((3, 4))])
RNG = np.random.default_rng

CASES = {
    "agents.agent": (
        agents.agent,
        {"source": Argument(TEACHER, st.sampled_from([None, 3, "TD3", np.zeros(2), np.nan]))},
    ),
    "baselines.Heuristic.predict": (baselines.Heuristic().predict, {"obs": numbers(np.ones((3, 8)) / 4)}),
    "baselines.PumpAndBalance.predict": (baselines.PumpAndBalance().predict, {"obs": numbers(np.ones((3, 3)) / 4)}),
    "baselines.Still.predict": (baselines.Still(TASK).predict, {"obs": states}),
    "baselines.dagger": (
        functools.partial(baselines.dagger, [lambda s, a: baselines.linear_map(s, a, SIMPLEGOAL)]),
        {"teacher": teacher, "task": task, "config": budget, "seed": seed},
    ),
    "baselines.kmeans_cells": (
        baselines.kmeans_cells,
        pairs | {"cells": count(2, most=len(STATES)), "task": task, "seed": seed},
    ),
    "baselines.linear_map": (baselines.linear_map, pairs | {"task": task}),
    "baselines.refit": (functools.partial(baselines.refit, TWO), pairs),
    "baselines.rule_of_thumb": (baselines.rule_of_thumb, {"task": task}),
    "config.Config": (config.Config, settings_of(config.Config, SHORT)),
    "config.Refinement": (config.Refinement, settings_of(config.Refinement, REFINEMENT)),
    "config.check_refinement": (config.check_refinement, {"config": budget}),
    "config.preset": (config.preset, {"task": task, "kind": choice("paper")}),
    "distill.distill": (
        distill.distill,
        {
            "teacher": teacher,
            "task": task,
            "config": Argument(SHORT, budget.bad.filter(lambda c: c is not SHORT)),
            "seed": seed,
        },
    ),
    "distill.teacher_episodes": (
        lambda **arguments: list(distill.teacher_episodes(task=TASK, rng=RNG(0), **arguments)),
        {"teacher": teacher, "n": count(2, least=0)},
    ),
    "envs.SimpleGoalEnv": (envs.SimpleGoalEnv, {"goal_reward": choice("add")}),
    "envs.SimpleGoalEnv.step": (envs.SimpleGoalEnv().step, {"action": numbers([0.5, 0.25], free=())}),
    "envs.get_task": (envs.get_task, {"name": task}),
    "envs.gymnasium_task": (
        envs.gymnasium_task,
        {"name": Argument("Pendulum-v1", st.sampled_from(["CartPole-v1", "FrozenLake-v1", "Acrobot-v1"]))},
    ),
    "envs.render": (envs.render, {"name": task, "state": numbers([0.5, 0.5], free=())}),
    "evaluate.evaluate": (evaluate.evaluate, player | {"n_episodes": count(3), "seed": seed}),
    "evaluate.interval": (
        functools.partial(evaluate.interval, statistic=np.mean),
        {
            "returns": numbers(STATES, any_shape=True, some=True),
            "level": number(0.9, least=0, most=1),
            "n_resamples": count(5),
            "seed": seed,
        },
    ),
    "evaluate.outcomes": (evaluate.outcomes, player | {"n_episodes": count(3), "seed": seed}),
    "evaluate.outlier_numbers": (evaluate.outlier_numbers, {"returns": numbers(STATES, any_shape=True, some=True)}),
    "evaluate.resample": (
        evaluate.resample,
        {"returns": numbers(STATES, free=(0, 1), some=True), "n_resamples": count(5), "seed": seed},
    ),
    "evaluate.spread": (evaluate.spread, {"returns": numbers(STATES, any_shape=True, some=True)}),
    "evaluate.start_states": (evaluate.start_states, {"task": task, "n_episodes": count(3), "seed": seed}),
    "export.codeword_latex": (functools.partial(export.codeword_latex, TWO), {"cell": cell, "digits": digits}),
    "export.equations_latex": (functools.partial(export.equations_latex, TWO), {"cell": cell, "digits": digits}),
    "export.to_latex": (functools.partial(export.to_latex, TWO), {"digits": digits}),
    "export.to_text": (functools.partial(export.to_text, TWO), {"digits": digits}),
    "figures.arrows": (of_ax(figures.arrows), pairs),
    "figures.box_plot": (
        lambda returns: figures.box_plot(ax(figures.box_plot), {"teacher": returns}),
        {"returns": numbers(STATES[:, 0], any_shape=True)},
    ),
    "figures.cells": (of_ax(figures.cells), x_y | {"index": values_on_grid}),
    "figures.codewords": (of_ax(figures.codewords), {"points": states}),
    "figures.error_map": (of_ax(figures.error_map, label="error"), x_y | {"error": values_on_grid}),
    "figures.extent": (figures.extent, x_y),
    "figures.force_map": (of_ax(figures.force_map), x_y | {"force": values_on_grid}),
    "figures.histogram": (of_ax(figures.histogram), {"returns": numbers(STATES[:, 0])}),
    "figures.learning_curve": (
        of_ax(figures.learning_curve),
        {"steps": numbers(STATES[:, 0], free=()), "means": numbers(STATES[:, 1], free=())},
    ),
    "figures.over_iterations": (of_ax(figures.over_iterations, ylabel="cells"), {"values": numbers(STATES[:, 0])}),
    "figures.run_means": (of_ax(figures.run_means, teacher=0.5), {"means": numbers(STATES[:, 0])}),
    "geometry.check_codewords": (geometry.check_codewords, {"codewords": points["codewords"]}),
    "geometry.delaunay_neighbours": (
        geometry.delaunay_neighbours,
        {
            "codewords": Argument(
                STATES, points["codewords"].bad | st.integers(0, 11).map(lambda i: np.vstack([STATES, STATES[i]]))
            )
        },
    ),
    "geometry.distances": (geometry.distances, lookup),
    "geometry.grid": (
        geometry.grid,
        {"low": numbers(np.zeros(2), free=()), "high": numbers(np.ones(2), free=()), "resolution": count(3)},
    ),
    "geometry.lookup_neighbours": (
        geometry.lookup_neighbours,
        points
        | {
            "low": numbers(np.zeros(2), free=(), also=[np.ones(2), [0, 2]]),
            "high": numbers(np.ones(2), free=(), also=[-np.ones(2)]),
        },
    ),
    "geometry.nearest": (geometry.nearest, lookup),
    "geometry.nearest_brute": (geometry.nearest_brute, lookup),
    "geometry.nearest_kdtree": (geometry.nearest_kdtree, lookup),
    "geometry.visited_neighbours": (geometry.visited_neighbours, points | {"witnesses": states}),
    "history.History.policy_at": (HISTORY.policy_at, {"n": count(3, least=0, most=23)}),
    "lime.compare_maps": (
        functools.partial(lime.compare_maps, TWO, TEACHER, rng=RNG(0)),
        {"states": states, "scale": numbers([0.5, 0.25], free=(), also=[[1.0, 0.0], [-1.0, 1.0]])},
    ),
    "lime.gradient_map": (
        functools.partial(lime.gradient_map, TEACHER),
        {"state": numbers(STATES[0], free=()), "scale": numbers([0.5, 0.25], free=(), also=[[1.0, 0.0], [-1.0, 1.0]])},
    ),
    "lime.local_map": (
        lambda **arguments: lime.local_map(TEACHER, rng=RNG(0), **arguments),
        {
            "task": task,
            "state": numbers(STATES[0], free=()),
            "scale": numbers([0.5, 0.25], free=(), also=[[1.0, 0.0]]),
            "n": count(9),
        },
    ),
    "moments.rounds_to": (functools.partial(moments.rounds_to, 1.5), {"printed": number(1.5)}),
    "moves.closest": (moves.closest, {"teacher": teacher, "task": task, "config": budget, "seed": seed}),
    "paper.check_task": (paper.check_task, {"task": task}),
    "paper.hyperparameters": (paper.hyperparameters, {"task": task}),
    "paper.linear_policies": (paper.linear_policies, {"task": task}),
    "paper.published_policy": (paper.published_policy, {"task": task}),
    "paper.spread": (paper.spread, {"task": task}),
    "paper.spread_id": (functools.partial(paper.spread_id, metric="Mean"), {"task": task, "subject": choice("ours")}),
    "paper.spread_values": (paper.spread_values, {"task": task, "subject": choice("ours")}),
    "paper.text_numbers": (
        paper.text_numbers,
        {"task": Argument(SIMPLEGOAL, task.bad.filter(lambda one: one is not None))},
    ),
    "paper.value": (paper.value, {"id": choice("sg_drl_mean")}),
    "partition.Partition.add": (
        lambda state: partition().add(state, RNG(0)),
        {"state": numbers([0.5, 0.5], free=(), also=[np.array([0.25, 0.5]), np.array([0.75, 0.5])])},
    ),
    "partition.Partition.locate": (lambda state: partition().locate(state), {"state": numbers([0.5, 0.5], free=())}),
    "partition.Partition.observe": (
        lambda states, actions: partition().observe(rollouts.Episode(states, actions)),
        {"states": numbers(STATES, free=(), some=True), "actions": numbers(ACTIONS, free=(), some=True)},
    ),
    "policy.VoronoiPolicy": (
        policy.VoronoiPolicy,
        {
            "codewords": numbers(TWO.codewords, free=(), some=True, also=[np.ones((2, 2))]),
            "coefficients": numbers(TWO.coefficients, free=(), some=True),
            "task": task,
            "metric": choice("euclidean"),
            "scale": Argument(
                np.ones(2),
                numbers(np.ones(2), free=(), also=[np.zeros(2), np.array([1.0, -1.0])]).bad.filter(
                    lambda one: one is not None
                ),
            ),
            "sub_policy": choice("linear"),
        },
    ),
    **{
        f"policy.VoronoiPolicy.{name}": (getattr(TWO, name), {"obs": states}) for name in ("cells", "linear", "predict")
    },
    "policy.VoronoiPolicy.explain": (TWO.explain, {"obs": numbers(STATES[0], free=())}),
    "policy.VoronoiPolicy.equations": (TWO.equations, {"cell": cell, "digits": digits}),
    "policy.VoronoiPolicy.to_latex": (TWO.to_latex, {"digits": digits}),
    "policy.VoronoiPolicy.to_text": (TWO.to_text, {"digits": digits}),
    "refine.refine": (refine.refine, {"teacher": teacher, "task": task, "config": budget, "seed": seed}),
    "regions.Rule.holds": (RULES[0].holds, {"states": states}),
    "regions.RulePolicy.predict": (regions.RulePolicy(TWO, RULES).predict, {"obs": states}),
    "regions.apply": (functools.partial(regions.apply, RULES), {"states": states}),
    **{
        f"regions.{function.__name__}": (
            functools.partial(function, TWO),
            {
                "states": some_states,
                "unseen": some_states,
                "agreement": number(0.75, least=0, most=1),
                "leaves": count(4, least=2),
            },
        )
        for function in (regions.describe, regions.find_rules)
    },
    "rollouts.Episode": (
        rollouts.Episode,
        {"states": numbers(STATES, free=(1,), some=True), "actions": numbers(ACTIONS, free=(1,), some=True)},
    ),
    "rollouts.play": (rollouts.play, player | {"starts": starts}),
    "rollouts.record": (rollouts.record, player | {"starts": starts}),
    "rollouts.visited": (
        rollouts.visited,
        player | {"starts": Argument(STATES, starts.bad | st.just(np.zeros((0, 2))))},
    ),
    "simplify.gathered": (functools.partial(simplify.gathered, TWO), {"states": some_states}),
    "simplify.rounded": (functools.partial(simplify.rounded, TWO), {"digits": count(2)}),
    "simplify.simplify": (
        simplify.simplify,
        {"teacher": teacher, "task": task, "config": budget, "tolerance": number(1.0, least=0), "seed": seed},
    ),
    "subpolicies.expression": (
        subpolicies.expression,
        {
            "coefficients": numbers([0.5, -1.0, 2.0], free=()),
            "names": Argument(NAMES, st.sampled_from([(), ("x",), ("x", "y", "z")])),
            "digits": digits,
        },
    ),
    "subpolicies.form_of": (
        functools.partial(subpolicies.form_of, task=TASK),
        {"sub_policy": Argument("linear", choice("linear").bad | st.just("pid"))},
    ),
    "subpolicies.number": (functools.partial(subpolicies.number, 0.5), {"digits": digits}),
    "tables.as_text": (functools.partial(tables.as_text, pd.DataFrame({"a": [0.5, 2.0]})), {"digits": digits}),
    "tables.equation_table": (functools.partial(tables.equation_table, TWO), {"digits": digits}),
    "tables.hyperparameters": (lambda task: tables.hyperparameters([task]), {"task": task}),
    "tables.readings": (tables.readings, {"task": task}),
    "tables.spread_table": (
        tables.spread_table,
        {
            "task": task,
            "teacher": numbers(STATES[:, 0], free=(), some=True),
            "runs": numbers(STATES.T, free=(0,), some=True),
        },
    ),
    "tables.text_numbers": (
        tables.text_numbers,
        {
            "task": task,
            "teacher": numbers(STATES[:, 0], free=(), some=True),
            "runs": numbers(STATES.T, free=(0,), some=True),
            "cells": count(3),
        },
    ),
    "tdavq.DiscretePolicy.cells": (
        tdavq.DiscretePolicy(STATES, np.zeros((12, 3)), ACTIONS[:3]).cells,
        {"states": states},
    ),
    "tdavq.DiscretePolicy.predict": (
        tdavq.DiscretePolicy(STATES, np.zeros((12, 3)), ACTIONS[:3]).predict,
        {"obs": states},
    ),
    "tdavq.learn": (
        tdavq.learn,
        {"task": task, "seed": seed, "n_steps": count(3)}
        | {name: number(0.5, least=0) for name in ("min_distance", "likeness", "discount")},
    ),
    "teachers.Teacher": (weights, {"weight": numbers(np.eye(2), free=()), "bias": numbers(np.zeros(2), free=())}),
    "teachers.Teacher.predict": (NET.predict, {"obs": states}),
    "teachers.Teacher.stakes": (with_critics().stakes, {"obs": numbers(STATES)}),
    "teachers.load_teacher": (
        teachers.load_teacher,
        {"source": Argument(SIMPLEGOAL, st.sampled_from(["", "SimpelGoal-v0", "agent.pth", "agent.zip", "agent"]))},
    ),
    "trees.LinearTree": (trees.LinearTree, pairs | {"leaves": leaves, "task": task}),
    "trees.LinearTree.predict": (trees.LinearTree(STATES, ACTIONS, leaves=2, task=SIMPLEGOAL).predict, {"obs": states}),
    "trees.ObliqueLinearTree": (trees.ObliqueLinearTree, pairs | {"leaves": leaves, "task": task, "seed": seed}),
    "trees.SoftTree": (
        QuickSoftTree,
        {name: numbers(one.good, free=(1,), some=True) for name, one in pairs.items()}
        | {"leaves": leaves, "seed": seed},
    ),
    "trees.SoftTree.predict": (lambda obs: soft_tree().predict(obs), {"obs": states}),
    "trees.Tree": (
        trees.Tree,
        {name: numbers(one.good, free=(1,), some=True) for name, one in pairs.items()} | {"leaves": leaves},
    ),
    "trees.Tree.predict": (trees.Tree(STATES, ACTIONS, leaves=3).predict, {"obs": states}),
    "trees.standard": (trees.standard, {"states": numbers(STATES, free=(0, 1), some=True)}),
}


@functools.cache
def soft_tree():
    return QuickSoftTree(STATES, ACTIONS, leaves=2, seed=0)


# Public functions without a case, and why. A class or module stands for all that is in it.

EXEMPT = {
    "the inner loop of a distillation: a Partition puts in what it has checked": """
        buffers subpolicies.SubPolicies subpolicies.Form subpolicies.Network geometry.look_up geometry.all_differ""",
    "a line or a pass of the paper's algorithms, on a Partition and an Episode, which are good by construction": """
        distill.split_regions distill.merge_regions distill.may_alter distill.due history.History
        history.History.add_events history.History.observe partition.Partition partition.Partition.train
        partition.Partition.keep partition.Partition.reset partition.Partition.far partition.Partition.loss
        partition.Partition.neighbours""",
    "dynamics, and what a task is made of: `rollouts` checks what moves through them": """
        envs.Task envs.Signals envs.SimpleGoalEnv.reset envs.simplegoal_start envs.simplegoal_step
        envs.mountaincar_start envs.mountaincar_signals envs.mountaincar_step
        envs.pendulum_start envs.pendulum_see envs.pendulum_signals envs.pendulum_step""",
    "the inside of `refine`, which checks what comes in": """
        refine.Frame refine.Cells refine.Labelled refine.Aim refine.Trials refine.worth refine.squared_error
        refine.squared_errors refine.closeness refine.line refine.beginning refine.anneal refine.expected_loss
        refine.tune""",
    "the inside of `closest`, of trees, of `learn`, which check what comes in": """
        moves.moved moves.nearest_two trees.Split trees.Node trees.LinearTree.split trees.LinearTree.inputs
        trees.LinearTree.apply trees.ObliqueLinearTree.split tdavq.DiscretePolicy tdavq.Walkers tdavq.update tdavq.split
        tdavq.merge regions.Rule""",
    "holds what another function found": "history.Event rollouts.Outcomes policy.Explanation moments.Part",
    "hands on what the reader's own function takes and gives, or is but a protocol": """
        agents.Agent rollouts.Policy simplify.prune regions.RulePolicy""",
    "takes a path: see the tests of damaged files": "policy.VoronoiPolicy.save policy.VoronoiPolicy.load",
    "takes a policy, a task or runs, which are good by construction, and no more than digits for `number`": """
        export.to_json export.to_python export.to_c export.distances_latex baselines.Still baselines.fit
        baselines.compare baselines.kept_comparison baselines.teacher_data""",
    "any text will do": "export.symbol regions.Rule.text regions.latex teachers.part_of",
    "arithmetic, tried below": """
        moments.fences moments.quartiles_from_fences moments.remaining_mean moments.remaining_std moments.quarters
        moments.mean_range moments.least_std moments.greatest_std""",
    "takes a frame, which pandas has checked, or parts of a figure": """
        tables.save_table tables.as_latex tables.show figures.panels figures.embedded figures.Picture
        figures.save_figure figures.letter figures.square figures.force_bar figures.trail figures.legend_below
        figures.phase figures.upper_bound figures.intervals figures.again figures.margin figures.reference
        figures.ledger_gaps figures.boxes figures.by_group""",
}
EXEMPT = {name: reason for reason, names in EXEMPT.items() for name in names.split()}


def public():
    """The names of all public functions, classes and methods that take anything."""
    for module in MODULES:
        for name, thing in vars(importlib.import_module(f"vsp.{module}")).items():
            if name.startswith("_") or getattr(thing, "__module__", "") != f"vsp.{module}":
                continue
            methods = vars(thing).items() if inspect.isclass(thing) else ()
            found = {f"{module}.{name}": thing} | {
                f"{module}.{name}.{method}": getattr(thing, method) for method, _ in methods if method[0] != "_"
            }
            for full, one in found.items():
                if callable(one) and set(inspect.signature(one).parameters) - {"self"}:
                    yield full


def exempt(name):
    """Whether a name, or the class or module that it is in, is in the list; a class with cases excuses only itself."""
    within = {
        one for one in EXEMPT if name.startswith(f"{one}.") and not any(case.startswith(f"{one}.") for case in CASES)
    }
    return name in EXEMPT or within


def test_every_public_function_has_a_property_or_a_reason_why_not():
    known = set(public())
    assert not sorted(name for name in known - set(CASES) if not exempt(name)), "add a case, or a reason"
    assert not sorted(set(CASES) - known), "cases of functions that are gone"
    gone = {one for one in EXEMPT if not any(f"{name}.".startswith(f"{one}.") for name in known - set(CASES))}
    assert not gone, "reasons for functions that are gone"
    assert len(MODULES) == 27 and all(
        importlib.util.find_spec(f"vsp.{name}") for name in " ".join(OUTSIDE.values()).split()
    )


def test_everything_in_the_face_of_the_package_is_covered():
    faces = {
        f"{thing.__module__.removeprefix('vsp.')}.{name}"
        for name, thing in vars(vsp).items()
        if name in vsp.__all__ and callable(thing)
    }
    assert faces - set(CASES) == {"envs.tasks"}  # which takes nothing


def call(case, /, **changes):
    function, arguments = CASES[case]
    return function(**{one: value.good for one, value in arguments.items()} | changes)


@pytest.mark.parametrize("name", CASES)
def test_good_arguments_are_good(name):
    """Else a case would be refused for another reason than the one it is about."""
    call(name)


@pytest.mark.parametrize("name", CASES)
@given(data=st.data())
def test_what_a_function_cannot_work_with_is_one_clear_error(name, data):
    spoilt = data.draw(st.sampled_from(sorted(CASES[name][1])))
    value = data.draw(CASES[name][1][spoilt].bad)
    with pytest.raises(
        (ValueError, TypeError, FileNotFoundError), match="expected|fails on|lies outside|say which|load it for"
    ) as caught:
        call(name, **{spoilt: value})
    assert Path(traceback.extract_tb(caught.tb)[-1].filename).parent == Path(vsp.__file__).parent, (
        "not an error of ours"
    )


# Numbers of another type are the same numbers: whole ones, float32, a list

SAME = [
    name
    for name, (_, arguments) in CASES.items()
    if any(isinstance(one.good, np.ndarray) for one in arguments.values())
    and not name.startswith(("figures.", "lime.", "envs."))
]


def plain(result):
    """What a function returned, as something that NumPy can compare."""
    if isinstance(result, policy.VoronoiPolicy):
        return result.to_json()
    if isinstance(result, pd.DataFrame):
        return result.to_csv()
    if dataclasses.is_dataclass(result):
        return [plain(getattr(result, field.name)) for field in dataclasses.fields(result)]
    if isinstance(result, list | tuple):
        return [plain(one) for one in result]
    known = (np.ndarray, str, dict, int, float, np.number)
    return result if isinstance(result, known) else type(result).__name__


@pytest.mark.parametrize("name", SAME)
@pytest.mark.parametrize("other", [np.float32, np.longdouble, list])
def test_numbers_of_another_type_are_the_same_numbers(name, other):
    changes = {
        one: value.good.tolist() if other is list else value.good.astype(other)
        for one, value in CASES[name][1].items()
        if isinstance(value.good, np.ndarray)
    }
    np.testing.assert_equal(plain(call(name, **changes)), plain(call(name)))


@pytest.mark.parametrize("kind", [int, np.uint8, np.float16])
def test_whole_numbers_are_observations_too(kind):
    corners = np.array([[0, 0], [0, 1], [1, 1]])
    for act in (TWO.predict, NET.predict, TWO.linear, TWO.cells):
        np.testing.assert_equal(act(corners.astype(kind)), act(corners.astype(np.float64)))


# Arithmetic of what summaries say: what is not finite stays so

GROUPS = [(2.0, 0.0, 1.0), (2.0, 1.0, 3.0)]
PARTS = [moments.Part(2.0, 1.0, 0.5, 0.0, 2.0)]
MOMENTS = {
    "fences": (1.0, 2.0),
    "quartiles_from_fences": (1.0, 2.0),
    "remaining_mean": (5.0, 1.0, PARTS),
    "remaining_std": (5.0, 1.0, 1.0, PARTS),
    "quarters": (8.0, (0.0, 1.0, 2.0, 3.0, 4.0), 1.0, 1.0),
    "mean_range": (GROUPS,),
    "least_std": (1.0, GROUPS),
    "greatest_std": (1.0, 0.0, 2.0),
}


@pytest.mark.parametrize("name", MOMENTS)
@given(data=st.data())
def test_arithmetic_of_a_nan_is_a_nan(name, data):
    """Wherever it stands, in a number or in a group or part that is passed on."""
    arguments = list(MOMENTS[name])
    place = data.draw(st.integers(0, len(arguments) - 1))
    if isinstance(arguments[place], list):
        spoilt = [list(group) for group in arguments[place]]
        spoilt[data.draw(st.integers(0, len(spoilt) - 1))][data.draw(st.integers(0, 1))] = np.nan
        arguments[place] = [moments.Part(*group) if len(group) == 5 else tuple(group) for group in spoilt]
    else:
        whole = isinstance(arguments[place], float)
        arguments[place] = np.nan if whole else (np.nan, *arguments[place][1:])
    assert np.isnan(getattr(moments, name)(*arguments)).any()
