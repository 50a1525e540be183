"""Every public function that a reader calls refuses what it cannot work with: an error of ours that says what was
expected, never a silent result. How many cases each, the Hypothesis profile says: few in `make test`, 200 in `make
faults`.
"""

import dataclasses
import functools
import math
import traceback
from pathlib import Path
from typing import Literal, get_origin, get_type_hints

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import SIMPLEGOAL, Constant, CurvedTeacher, network_teacher, partition_of, tiny

import vsp
from studies.comparison import imitate
from studies.proofs.network import teacher_steps_to_goal
from studies.rivals import critics, dagger, hand_written, small_network, tdavq, trees
from studies.rivals.soft_tree import SoftTree
from studies.robots import Walking, imitate_pushed, search_one_map, walking_preset
from studies.robots.fewest import fewest_numbers
from vsp import algorithms, evaluation, export, geometry, policy, rollouts
from vsp.config import Config, paper_preset
from vsp.paper import baselines as simple
from vsp.paper import printed, shown, statistics, tables
from vsp.show import captions, state_space, style
from vsp.show.returns import box_plot, histogram, learning_curve, over_iterations, run_means
from vsp.subpolicies import base
from vsp.subpolicies.registry import policy_class
from vsp.tasks import gym_adapter, registry, simplegoal
from vsp.teachers import agents
from vsp.teachers.teacher import Teacher, load_teacher
from vsp_beyond.explain import lime, rules
from vsp_beyond.few_cells import config, faithful, simplification, tuned
from vsp_beyond.few_cells.limit import limit_preset
from vsp_beyond.optimum import best_policy, best_returns
from vsp_beyond.proofs import largest_disturbance, steps_to_goal
from vsp_beyond.proofs.pendulum import prove_pendulum
from vsp_beyond.proofs.pendulum_starts import shares_of_starts

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
        optional = name.endswith("_penalty") or name in ("n_corrections", "n_generations")
        if get_origin(hint) is Literal:
            fields[name] = Argument(value, st.text(max_size=6) | st.sampled_from([None, 3, np.nan, {}]))
        elif hint is bool:
            fields[name] = Argument(value, st.sampled_from([0, 1, None, "True", np.nan, np.bool_(True), []]))
        elif hint is int:
            fields[name] = count(value, least=0 if optional else 1)
        else:
            fields[name] = number(value, least=-math.inf if name == "margin" else 0.0)
    return fields


# What good calls are made of: numbers that float32 holds exactly

TASK, TEACHER = registry.get_task(SIMPLEGOAL), CurvedTeacher()
STATES = np.array([(x, y) for x in (0.125, 0.375, 0.625, 0.875) for y in (0.25, 0.5, 0.75)])  # (12, 2)
ACTIONS = (STATES - 0.5) * [1.0, -1.0]
TWO = policy.VoronoiPolicy(
    [[0.0, 0.5], [1.0, 0.5]], [[[1, 0], [0, 2], [0.25, -0.5]], np.zeros((3, 2))], task=SIMPLEGOAL
)
SHORT = tiny(n_epochs=24, n_freeze=4)
REFINEMENT = config.Tuned(
    n_cells=2, n_episodes=2, n_restarts=1, n_steps=4, n_corrections=1, n_correction_episodes=2, n_generations=1,
    n_tuning_episodes=2, n_validation=2,
)  # fmt: skip
FAITHFUL = config.Faithful(
    n_cells=2, tolerance=1.0, n_episodes=2, n_states=20, n_restarts=1, n_generations=1, n_tuning_episodes=2,
    n_validation=2,
)  # fmt: skip
WALKING = Walking(
    n_cells=2, n_episodes=2, n_corrections=1, n_correction_episodes=2, n_states=20, n_restarts=1, n_validation=2,
    n_random_steps=10, n_directions=2, n_best=1,
)  # fmt: skip
STILL = policy.VoronoiPolicy([[0, 0, 0]], np.zeros((1, 4, 1)), task="Pendulum-v1")
HISTORY = vsp.distill(TEACHER, SIMPLEGOAL, SHORT, seed=0)[1]
RULES = [
    rules.Rule(0, np.array([-np.inf, -np.inf]), np.array([0.5, np.inf])),
    rules.Rule(1, np.array([0.5, -np.inf]), np.full(2, np.inf)),
]
NET = network_teacher(SIMPLEGOAL)
GRID = state_space.grid(np.zeros(2), np.ones(2), 3)
NAMES = ("x", "y")


def with_critics():
    shapes = {"qf0.0": (1, 4), "qf1.0": (1, 4)}
    critic = {f"{name}.weight": np.ones(shape, np.float32) for name, shape in shapes.items()}
    critic |= {f"{name}.bias": np.zeros(1, np.float32) for name in shapes}
    actor = {
        f"mu.0.{part}": value
        for part, value in (("weight", np.eye(2, dtype=np.float32)), ("bias", np.zeros(2, np.float32)))
    }
    return Teacher(actor, SIMPLEGOAL, critic=critic)


def weights(**changes):
    """A teacher whose tensors are these."""
    parts = {"weight": np.eye(2), "bias": np.zeros(2)} | changes
    return Teacher({f"mu.0.{name}": part for name, part in parts.items()}, SIMPLEGOAL)


@functools.cache
def ax(function):
    fig, axes = style.panels()
    plt.close(fig)  # it lives on, but no other test finds it open
    return axes[0]


def of_ax(function, **fixed):
    """A figure's function, each time on the same axes: what is refused is refused before anything is drawn."""
    return lambda **arguments: function(ax(function), **fixed, **arguments)


class QuickSoftTree(SoftTree):
    N_STEPS = 5


def quick_critic_driven(*data, **about):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(critics, "N_STEPS", 3)
        return critics.critic_driven(*data, **about)


def partition():
    return partition_of([[0.25, 0.5], [0.75, 0.5]])


states, some_states = numbers(STATES, free=(0,)), numbers(STATES, some=True)
pairs = {"states": numbers(STATES, free=(), some=True), "actions": numbers(ACTIONS, free=(), some=True)}
task, seed, teacher = choice(SIMPLEGOAL), count(0, least=0), actor(TEACHER)
critic = Argument(with_critics(), st.sampled_from([TEACHER, NET, None, 3, "TD3", np.zeros(2)]))
player = {"policy": actor(TEACHER), "task": task}
starts = numbers(STATES, also=[np.full((1, 2), 1.5), np.full((1, 2), -0.001)])
points = {"codewords": numbers(STATES, free=(0, 1), some=True), "metric": choice("manhattan")}
lookup = points | {"states": states}
price = Argument(0.01, number(0.01, least=0.0).bad.filter(lambda one: one is not None))
digits = Argument(3, count(3, least=0).bad.filter(lambda one: one is not None))  # None: as many as it takes
cell = count(1, least=0, most=1)
leaves = count(3)
intent = Argument(FAITHFUL, st.sampled_from([3, "faithful", SHORT, REFINEMENT, {}, np.nan]))
budget = Argument(REFINEMENT, st.sampled_from([3, "tuned", SHORT, {}, np.nan]))
x_y = {"x": Argument(GRID[0], numbers(GRID[0], free=()).bad), "y": Argument(GRID[1], numbers(GRID[1], free=()).bad)}
values_on_grid = numbers(np.arange(9.0) % 2, free=(), any_shape=True, also=[np.zeros(8), np.zeros((3, 4))])
RNG = np.random.default_rng

CASES = {
    "teachers.agents.agent": (
        agents.agent,
        {"source": Argument(TEACHER, st.sampled_from([None, 3, "TD3", np.zeros(2), np.nan]))},
    ),
    "simple.Heuristic.predict": (hand_written.Heuristic().predict, {"obs": numbers(np.ones((3, 8)) / 4)}),
    "simple.PumpAndBalance.predict": (hand_written.PumpAndBalance().predict, {"obs": numbers(np.ones((3, 3)) / 4)}),
    "simple.ZeroPolicy.predict": (hand_written.ZeroPolicy(TASK).predict, {"obs": states}),
    "critics.critic_driven": (
        quick_critic_driven,
        pairs | {"cells": count(2), "teacher": critic, "task": task, "seed": seed},
    ),
    "critics.advantage_weighted": (
        critics.advantage_weighted,
        pairs | {"cells": count(2, most=len(STATES)), "teacher": critic, "task": task, "seed": seed},
    ),
    "dagger.dagger": (
        functools.partial(dagger.dagger, [lambda s, a: simple.linear_map(s, a, SIMPLEGOAL)]),
        {"teacher": teacher, "task": task, "rounds": budget, "seed": seed},
    ),
    "simple.kmeans_cells": (
        simple.kmeans_cells,
        pairs | {"cells": count(2, most=len(STATES)), "task": task, "seed": seed},
    ),
    "simple.linear_map": (simple.linear_map, pairs | {"task": task}),
    "simple.refit": (functools.partial(simple.refit, TWO), pairs),
    "simple.rule_of_thumb": (simple.rule_of_thumb, {"task": task}),
    "config.Config": (Config, settings_of(Config, SHORT)),
    "few_cells.config.Tuned": (config.Tuned, settings_of(config.Tuned, REFINEMENT)),
    "few_cells.config.check_kind": (functools.partial(config.check_kind, kind=config.Faithful), {"config": intent}),
    "optimum.limit.limit_preset": (limit_preset, {"task": task}),
    "optimum.references.best_policy": (
        best_policy,
        {"task": task, "finer": number(0.5, least=0.1, most=10.0), "price": price},
    ),
    "proofs.robust.steps_to_goal": (
        functools.partial(steps_to_goal, TWO),
        {"disturbance": number(0.01, least=0.0, most=1.0), "n": count(20, most=4000)},
    ),
    "proofs.robust.largest_disturbance": (
        functools.partial(largest_disturbance, TWO),
        {"n": count(10, most=4000), "tolerance": number(0.05, least=1e-6, most=0.1)},
    ),
    "proofs.pendulum.prove_pendulum": (
        functools.partial(prove_pendulum, STILL),
        {"n": count(16, most=8000)},
    ),
    "proofs.pendulum_starts.shares_of_starts": (
        functools.partial(shares_of_starts, prove_pendulum(STILL, n=16)),
        {"parts": count(2, most=64), "levels": count(1, most=8)},
    ),
    "proofs.network.teacher_steps_to_goal": (
        functools.partial(teacher_steps_to_goal, load_teacher("SimpleGoal-v0")),
        {"n": count(20, most=8000)},
    ),
    "robots.settings.Walking": (Walking, settings_of(Walking, WALKING)),
    "robots.settings.walking_preset": (walking_preset, {"task": task}),
    "robots.fewest.fewest_numbers": (
        functools.partial(fewest_numbers, TWO),
        {"keep": number(0.5, least=0.0, most=1.0), "n_episodes": count(2), "seed": seed},
    ),
    "robots.imitation.imitate_pushed": (
        functools.partial(imitate_pushed, config=WALKING),
        {"teacher": teacher, "task": task, "seed": seed},
    ),
    "robots.random_search.search_one_map": (
        functools.partial(search_one_map, config=WALKING),
        {"task": task, "seed": seed},
    ),
    "optimum.simplegoal.best_returns": (best_returns, {"starts": states}),
    "few_cells.config.faithful_preset": (config.faithful_preset, {"task": task}),
    "few_cells.faithful.distill_faithfully": (
        faithful.distill_faithfully,
        {"teacher": teacher, "task": task, "config": intent, "seed": seed},
    ),
    "config.paper_preset": (paper_preset, {"task": task}),
    "few_cells.config.tuned_preset": (config.tuned_preset, {"task": task}),
    "vsp.distill": (
        vsp.distill,
        {
            "teacher": teacher,
            "task": task,
            "config": Argument(SHORT, budget.bad.filter(lambda c: c is not SHORT)),
            "seed": seed,
        },
    ),
    "algorithms.teacher_episodes": (
        lambda **arguments: list(algorithms.teacher_episodes(task=TASK, rng=RNG(0), **arguments)),
        {"teacher": teacher, "n": count(2, least=0)},
    ),
    "tasks.simplegoal.SimpleGoalEnv": (simplegoal.SimpleGoalEnv, {"goal_reward": choice("add")}),
    "tasks.simplegoal.SimpleGoalEnv.step": (simplegoal.SimpleGoalEnv().step, {"action": numbers([0.5, 0.25], free=())}),
    "tasks.registry.get_task": (registry.get_task, {"name": task}),
    "tasks.gym_adapter.gymnasium_task": (
        gym_adapter.gymnasium_task,
        {"name": Argument("Pendulum-v1", st.sampled_from(["CartPole-v1", "FrozenLake-v1", "Acrobot-v1"]))},
    ),
    "tasks.registry.render": (registry.render, {"name": task, "state": numbers([0.5, 0.5], free=())}),
    "evaluation.evaluate": (evaluation.evaluate, player | {"n_episodes": count(3), "seed": seed}),
    "paper.statistics.interval": (
        functools.partial(statistics.interval, statistic=np.mean),
        {
            "returns": numbers(STATES, any_shape=True, some=True),
            "n_resamples": count(5),
            "seed": seed,
        },
    ),
    "evaluation.rollout_from_seed": (evaluation.rollout_from_seed, player | {"n_episodes": count(3), "seed": seed}),
    "paper.statistics.outlier_numbers": (
        statistics.outlier_numbers,
        {"returns": numbers(STATES, any_shape=True, some=True)},
    ),
    "paper.statistics.resample": (
        statistics.resample,
        {"returns": numbers(STATES, free=(0, 1), some=True), "n_resamples": count(5), "seed": seed},
    ),
    "paper.statistics.spread": (statistics.spread, {"returns": numbers(STATES, any_shape=True, some=True)}),
    "evaluation.start_states": (evaluation.start_states, {"task": task, "n_episodes": count(3), "seed": seed}),
    "export.codeword_latex": (functools.partial(export.codeword_latex, TWO), {"cell": cell, "digits": digits}),
    "export.equations_latex": (functools.partial(export.equations_latex, TWO), {"cell": cell, "digits": digits}),
    "export.to_latex": (functools.partial(export.to_latex, TWO), {"digits": digits}),
    "export.to_text": (functools.partial(export.to_text, TWO), {"digits": digits}),
    "show.state_space.arrows": (of_ax(state_space.arrows), pairs),
    "show.returns.box_plot": (
        lambda returns: box_plot(ax(box_plot), {"teacher": returns}),
        {"returns": numbers(STATES[:, 0], any_shape=True)},
    ),
    "show.state_space.cells": (of_ax(state_space.cells), x_y | {"index": values_on_grid}),
    "show.state_space.codewords": (of_ax(state_space.codewords), {"points": states}),
    "show.state_space.error_map": (of_ax(state_space.error_map, label="error"), x_y | {"error": values_on_grid}),
    "show.state_space.extent": (state_space.extent, x_y),
    "show.state_space.force_map": (of_ax(state_space.force_map), x_y | {"force": values_on_grid}),
    "show.returns.histogram": (of_ax(histogram), {"returns": numbers(STATES[:, 0])}),
    "show.returns.learning_curve": (
        of_ax(learning_curve),
        {"steps": numbers(STATES[:, 0], free=()), "means": numbers(STATES[:, 1], free=())},
    ),
    "show.returns.over_iterations": (of_ax(over_iterations, ylabel="cells"), {"values": numbers(STATES[:, 0])}),
    "show.returns.run_means": (of_ax(run_means, teacher=0.5), {"means": numbers(STATES[:, 0])}),
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
    "show.state_space.grid": (
        state_space.grid,
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
    "geometry.visited_neighbours": (geometry.visited_neighbours, points | {"witnesses": states}),
    "history.History.policy_at": (HISTORY.policy_at, {"n": count(3, least=0, most=23)}),
    "explain.lime.compare_maps": (
        functools.partial(lime.compare_maps, TWO, TEACHER, rng=RNG(0)),
        {"states": states, "scale": numbers([0.5, 0.25], free=(), also=[[1.0, 0.0], [-1.0, 1.0]])},
    ),
    "explain.lime.gradient_map": (
        functools.partial(lime.gradient_map, TEACHER),
        {"state": numbers(STATES[0], free=()), "scale": numbers([0.5, 0.25], free=(), also=[[1.0, 0.0], [-1.0, 1.0]])},
    ),
    "explain.lime.local_map": (
        lambda **arguments: lime.local_map(TEACHER, rng=RNG(0), **arguments),
        {
            "task": task,
            "state": numbers(STATES[0], free=()),
            "scale": numbers([0.5, 0.25], free=(), also=[[1.0, 0.0]]),
            "n": count(9),
        },
    ),
    "paper.statistics.rounds_to": (functools.partial(statistics.rounds_to, 1.5), {"printed": number(1.5)}),
    "few_cells.imitate.imitate": (
        imitate.imitate,
        {"teacher": teacher, "task": task, "config": budget, "seed": seed},
    ),
    "paper.printed.check_task": (printed.check_task, {"task": task}),
    "paper.printed.printed_hyperparameters": (printed.printed_hyperparameters, {"task": task}),
    "paper.printed.linear_policies": (printed.linear_policies, {"task": task}),
    "paper.printed.published_policy": (printed.published_policy, {"task": task}),
    "paper.printed.printed_spread": (printed.printed_spread, {"task": task}),
    "paper.printed.spread_id": (
        functools.partial(printed.spread_id, metric="Mean"),
        {"task": task, "subject": choice("ours")},
    ),
    "paper.printed.printed_spread_values": (printed.printed_spread_values, {"task": task, "subject": choice("ours")}),
    "paper.printed.printed_text_numbers": (
        printed.printed_text_numbers,
        {"task": Argument(SIMPLEGOAL, task.bad.filter(lambda one: one is not None))},
    ),
    "paper.printed.printed_value": (printed.printed_value, {"id": choice("sg_drl_mean")}),
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
    "few_cells.tuned.distill_tuned": (
        tuned.distill_tuned,
        {"teacher": teacher, "task": task, "config": budget, "seed": seed},
    ),
    "explain.rules.Rule.holds": (RULES[0].holds, {"states": states}),
    "explain.rules.RulePolicy.predict": (rules.RulePolicy(TWO, RULES).predict, {"obs": states}),
    "explain.rules.apply": (functools.partial(rules.apply, RULES), {"states": states}),
    **{
        f"explain.rules.{function.__name__}": (
            functools.partial(function, TWO),
            {
                "states": some_states,
                "unseen": some_states,
                "agreement": number(0.75, least=0, most=1),
                "leaves": count(4, least=2),
            },
        )
        for function in (rules.describe_rules, rules.find_rules)
    },
    "rollouts.Episode": (
        rollouts.Episode,
        {"states": numbers(STATES, free=(1,), some=True), "actions": numbers(ACTIONS, free=(1,), some=True)},
    ),
    "rollouts.rollout": (rollouts.rollout, player | {"starts": starts}),
    "rollouts.collect_episodes": (rollouts.collect_episodes, player | {"starts": starts}),
    "rollouts.visited_states": (
        rollouts.visited_states,
        player | {"starts": Argument(STATES, starts.bad | st.just(np.zeros((0, 2))))},
    ),
    "few_cells.simplification.gathered": (
        functools.partial(simplification.gathered, TWO),
        {"states": some_states},
    ),
    "few_cells.simplification.rounded": (functools.partial(simplification.rounded, TWO), {"digits": count(2)}),
    "few_cells.simplification.simplify": (
        simplification.simplify,
        {"teacher": teacher, "task": task, "config": budget, "tolerance": number(1.0, least=0), "seed": seed},
    ),
    "subpolicies.base.expression": (
        base.expression,
        {
            "coefficients": numbers([0.5, -1.0, 2.0], free=()),
            "names": Argument(NAMES, st.sampled_from([(), ("x",), ("x", "y", "z")])),
            "digits": digits,
        },
    ),
    "subpolicies.registry.policy_class": (
        functools.partial(policy_class, task=TASK),
        {"sub_policy": Argument("linear", choice("linear").bad | st.just("pid"))},
    ),
    "subpolicies.base.number": (functools.partial(base.number, 0.5), {"digits": digits}),
    "show.captions.caption_of": (
        functools.partial(captions.caption_of, name="mine", alt="What it shows."),
        {"kind": choice("figures")},
    ),
    "paper.shown.as_text": (functools.partial(shown.as_text, pd.DataFrame({"a": [0.5, 2.0]})), {"digits": digits}),
    "paper.tables.show_policy": (functools.partial(tables.show_policy, TWO), {"digits": digits}),
    "paper.tables.equation_table": (functools.partial(tables.equation_table, TWO), {"digits": digits}),
    "paper.tables.hyperparameter_table": (lambda task: tables.hyperparameter_table([task]), {"task": task}),
    "paper.tables.interpretation_table": (tables.interpretation_table, {"task": task}),
    "paper.tables.spread_table": (
        tables.spread_table,
        {
            "task": task,
            "teacher": numbers(STATES[:, 0], free=(), some=True),
            "runs": numbers(STATES.T, free=(0,), some=True),
        },
    ),
    "paper.tables.text_number_table": (
        tables.text_number_table,
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
    "teachers.teacher.Teacher": (
        weights,
        {"weight": numbers(np.eye(2), free=()), "bias": numbers(np.zeros(2), free=())},
    ),
    "teachers.teacher.Teacher.predict": (NET.predict, {"obs": states}),
    "teachers.teacher.Teacher.criticality": (with_critics().criticality, {"obs": numbers(STATES)}),
    "teachers.teacher.Teacher.value": (
        with_critics().value,
        {"obs": numbers(STATES, free=()), "actions": numbers(ACTIONS, free=())},
    ),
    "teachers.teacher.load_teacher": (
        load_teacher,
        {"source": Argument(SIMPLEGOAL, st.sampled_from(["", "SimpelGoal-v0", "agent.pth", "agent.zip", "agent"]))},
    ),
    "trees.LinearTree": (trees.LinearTree, pairs | {"leaves": leaves, "task": task}),
    "trees.LinearTree.predict": (
        trees.LinearTree(STATES, ACTIONS, leaves=2, task=SIMPLEGOAL).predict,
        {"obs": states},
    ),
    "trees.ObliqueLinearTree": (
        trees.ObliqueLinearTree,
        pairs | {"leaves": leaves, "task": task, "seed": seed},
    ),
    "small_network.SmallNetwork": (
        small_network.SmallNetwork,
        pairs | {"units": leaves, "task": task, "seed": seed},
    ),
    "small_network.SmallNetwork.predict": (
        small_network.SmallNetwork(STATES, ACTIONS, units=2, task=SIMPLEGOAL, seed=0).predict,
        {"obs": states},
    ),
    "soft_tree.SoftTree": (
        QuickSoftTree,
        {name: numbers(one.good, free=(1,), some=True) for name, one in pairs.items()}
        | {"leaves": leaves, "seed": seed},
    ),
    "soft_tree.SoftTree.predict": (lambda obs: soft_tree().predict(obs), {"obs": states}),
    "simple.Tree": (
        simple.Tree,
        {name: numbers(one.good, free=(1,), some=True) for name, one in pairs.items()} | {"leaves": leaves},
    ),
    "simple.Tree.predict": (simple.Tree(STATES, ACTIONS, leaves=3).predict, {"obs": states}),
    "rollouts.standard": (rollouts.standard, {"states": numbers(STATES, free=(0, 1), some=True)}),
}


@functools.cache
def soft_tree():
    return QuickSoftTree(STATES, ACTIONS, leaves=2, seed=0)


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
        (ValueError, TypeError, FileNotFoundError), match="expected|fails on|lies outside|name the task|load it for"
    ) as caught:
        call(name, **{spoilt: value})
    raised_in = Path(traceback.extract_tb(caught.tb)[-1].filename)
    assert raised_in.is_relative_to(Path(vsp.__file__).parents[1]), "not an error of ours"


# Numbers of another type are the same numbers: whole ones, float32, a list

SAME = [
    name
    for name, (_, arguments) in CASES.items()
    if any(isinstance(one.good, np.ndarray) for one in arguments.values())
    and not name.startswith(("show.", "explain.lime.", "tasks."))
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
PARTS = [statistics.Part(2.0, 1.0, 0.5, 0.0, 2.0)]
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
        arguments[place] = [statistics.Part(*group) if len(group) == 5 else tuple(group) for group in spoilt]
    else:
        whole = isinstance(arguments[place], float)
        arguments[place] = np.nan if whole else (np.nan, *arguments[place][1:])
    assert np.isnan(getattr(statistics, name)(*arguments)).any()
