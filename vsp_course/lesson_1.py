"""Checks of lesson 1: what a policy is, linear maps, errors, cells, and codewords set by hand and by a rule.

Each check calls a student's function on small random cases, and raises `NotYet` or prints one line.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vsp import geometry, show
from vsp.algorithms import teacher_episodes
from vsp.paper import baselines
from vsp.policy import VoronoiPolicy
from vsp.rollouts import Policy
from vsp.tasks import Task, get_task
from vsp.tasks.simplegoal import GOAL_EDGE, PIT_HIGH
from vsp.teachers import load_teacher

from .feedback import ActionsAlone, Exercise, Mistake, NotYet, Question, joined, works

SEEDS = range(3)
PLACE_SEEDS, DRAWS = range(5), 100  # data sets per task; draws of random codewords for each
CASES = ((2, 2), (2, 1), (3, 2))  # dimensions of state and action
GIVEN = ((0.3, 0.3), (0.7, 0.6))  # codewords that the notebook begins with
AT_MOST = 8  # codewords set by hand
CELLS = 8  # codewords asked of a rule
MARGIN = 0.85  # times the error of random codewords, which a rule has to beat; the best of five sets rarely does

READING = Exercise("1.1", "reading")
FIT_LINEAR = Exercise("1.2", "fit_linear")
ACTION_ERROR = Exercise("1.3", "action_error", ("vsp_course.drawing.squared_error",))
NEAREST = Exercise("1.4", "nearest", ("vsp.geometry.nearest", "vsp.geometry.look_up"))
ACT = Exercise("1.5", "act")
BY_HAND = Exercise("1.6", "codewords")
PLACE = Exercise("1.7", "place", seconds=180)

WAYS = ("up-left", "up-right", "down-left", "down-right")
SHARES = ("less than a quarter", "about half", "more than three quarters")
PLACES = ("beyond the pit, seen from the goal", "between goal and pit", "along the walls")


@READING.checks
def reading(answers: object, teacher: Policy) -> None:
    """1.1: answers `right of the pit`, `beyond the pit`, `at the limit`, `sudden turn`."""
    shortest = {"down-left": "that is the straight way to the goal; look at what lies on it"}
    _, _, states = show.grid(np.zeros(2), np.ones(2), 21)
    actions = teacher.predict(states)[0]
    share = SHARES[int(np.digitize((np.abs(actions) > 0.99).mean(), [0.25, 0.75]))]
    questions = {
        "right of the pit": Question(WAYS, _way(teacher, [0.9, 0.2]), 1),
        "beyond the pit": Question(WAYS, _way(teacher, [0.7, 0.6]), 1, shortest),
        "at the limit": Question(SHARES, share, 2),
        "sudden turn": Question(PLACES, _sharpest(states, actions), 3),
    }
    first = READING.ask(answers, questions)
    READING.passed(f"you read the arrows as the network means them.{first}")


def _way(teacher: Policy, state: list[float]) -> str:
    dx, dy = teacher.predict(np.array(state))[0]
    return f"{'up' if dy > 0 else 'down'}-{'right' if dx > 0 else 'left'}"


def _sharpest(states: np.ndarray, actions: np.ndarray) -> str:
    """Return which of `PLACES` has the largest mean turn between neighbours on the grid."""
    side = int(np.sqrt(len(states)))
    by_row = actions.reshape(side, side, -1)
    turn = np.zeros((side, side))
    turn[:, 1:] += np.abs(np.diff(by_row, axis=1)).sum(axis=2)
    turn[1:] += np.abs(np.diff(by_row, axis=0)).sum(axis=2)
    turn, diagonal = turn.ravel(), states.sum(axis=1)
    wall = ((states < GOAL_EDGE) | (states > 1 - GOAL_EDGE)).any(axis=1)
    beyond = ~wall & (diagonal > 2 * PIT_HIGH - 0.1)
    between = ~wall & (diagonal < 0.8)
    return PLACES[int(np.argmax([turn[mask].mean() for mask in (beyond, between, wall)]))]


@FIT_LINEAR.checks
def fit_linear(function: Callable) -> None:
    """1.2: `fit_linear(states, actions)` returns coefficients (d + 1, m), weights above the bias."""
    for seed in SEEDS:
        for d, m in CASES:
            rng = np.random.default_rng(seed)
            states = rng.uniform(-1, 1, (40, d))
            _fits(function, states, 1 + states @ rng.normal(size=(d, m)) + rng.normal(size=(40, m)))
    FIT_LINEAR.passed("weights and bias, and no map has a smaller squared error.")


def _fits(function: Callable, states: np.ndarray, actions: np.ndarray) -> None:
    inputs = np.column_stack([states, np.ones(len(states))])
    (d, p), m = (states.shape[1], inputs.shape[1]), actions.shape[1]
    found = FIT_LINEAR.call(function, states, actions)
    if isinstance(found, tuple):
        raise FIT_LINEAR.wrong(f"{len(found)} values", f"one array {(p, m)}, the coefficients alone", 3)
    shape = np.shape(found)
    if shape == (d, m):
        raise FIT_LINEAR.wrong(f"{d} rows for {d} inputs", "one row more: at the origin such a map can only say 0", 1)
    if shape == (m, p) and m != p:
        raise FIT_LINEAR.wrong(f"shape {shape}", f"{(p, m)}: a row per input, a column per action", 2)
    found = FIT_LINEAR.array(found, (p, m), hint=2)
    best = np.linalg.lstsq(inputs, actions, rcond=None)[0]
    error, least = (np.square(inputs @ c - actions).mean() for c in (found, best))
    if error > 1.001 * least:  # a map found by gradient descent is right too
        mistakes = [
            Mistake(np.roll(best, 1, axis=0), "the bias in the first row", "it in the last one", 2),
            *_whatever(FIT_LINEAR, function, (states, actions), {"states": states[::-1], "actions": -actions}),
            Mistake(None, f"a squared error of {error:.4g}", f"the least that a linear map can have, {least:.4g}", 1),
        ]
        FIT_LINEAR.compare(found, best, mistakes)


def _whatever(exercise: Exercise, function: Callable, case: tuple, others: dict[str, object]) -> list[Mistake]:
    """Return feedback if the result stays the same when an argument of `case` is replaced by that in `others`: such a
    function usually reads a variable of the notebook instead."""
    here, blind = exercise.call(function, *case), []
    for i, (name, other) in enumerate(others.items()):
        try:
            same = np.array_equal(here, exercise.call(function, *case[:i], other, *case[i + 1 :]))
        except NotYet:
            continue  # it raises an error, so it reads that argument
        blind += [f"any `{name}`"] if same else []
    words = f"the same result for {' and '.join(blind)}", "one that is made of the arguments, not of other variables"
    return [Mistake(None, *words)] if blind else []


class _Map:
    """A linear policy for cases whose error is known."""

    def __init__(self, weights: np.ndarray):
        self.weights = weights

    def predict(self, obs: np.ndarray) -> tuple[np.ndarray, None]:
        return np.asarray(obs) @ self.weights, None


@ACTION_ERROR.checks
def action_error(function: Callable) -> None:
    """1.3: `action_error(policy, teacher, states)` returns the mean squared difference of two policies' actions."""
    for seed in SEEDS:
        for d, m in CASES:
            rng = np.random.default_rng(seed)
            states = rng.normal(size=(30, d))
            own, other = (_Map(rng.normal(size=(d, m))) for _ in range(2))
            difference = states @ own.weights - states @ other.weights
            _error(function, (own, other, states), difference)
    ACTION_ERROR.passed("a mean of squares, over states and over actions.")


def _error(function: Callable, case: tuple, difference: np.ndarray) -> None:
    own, other, states = case
    alone = ActionsAlone(own), ActionsAlone(other), states
    pair = not works(ACTION_ERROR.call, function, *case) and works(ACTION_ERROR.call, function, *alone)
    found = "the whole result of `predict` taken as the actions"
    ACTION_ERROR.refuse_if(pair, found, "the first of its two values", 1)
    value, squares = np.asarray(ACTION_ERROR.call(function, *case)), np.square(difference)
    found = f"an array of shape {value.shape}"
    ACTION_ERROR.refuse_if(value.size != 1, found, "one number for all states together", 1)
    (value,) = ACTION_ERROR.array(np.ravel(value), (1,))
    others = {"policy": _Map(-own.weights), "teacher": _Map(-other.weights), "states": states + 1}
    mistakes = [
        Mistake(squares.sum(axis=1).mean(), "a sum over the actions", "a mean over them too", 2),
        Mistake(squares.sum(), "a sum over everything", "a mean", 2),
        Mistake(np.sqrt(squares.mean()), "a root", "the mean of squares as it is", 2),
        Mistake(np.abs(difference).mean(), "a mean of absolute values", "one of squares", 2),
        Mistake(difference.mean(), "a mean in which errors to either side cancel", "one of squares", 2),
        Mistake(-difference.mean(), "a mean in which errors to either side cancel", "one of squares", 2),
        Mistake(difference.mean() ** 2, "the square of a mean", "the mean of squares: first square, then average", 2),
        Mistake(squares.mean() / 2, "half of what it should be", "the mean of squares as it is", 2),
        *_whatever(ACTION_ERROR, function, case, others),
        Mistake(None, "another number", "a mean of squared differences of actions", 1),
    ]
    ACTION_ERROR.compare(value, squares.mean(), mistakes)


@NEAREST.checks
def nearest(function: Callable) -> None:
    """1.4: `nearest(codewords, states)` returns the index of the nearest codeword by Manhattan distance. (n,)"""
    for seed in SEEDS:
        for d in (2, 3):
            rng = np.random.default_rng(seed)
            _looks_up(function, rng.uniform(size=(6, d)), rng.uniform(size=(200, d)))
    _looks_up(function, np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), np.array([[0.5, 0.0], [1.0, 0.5], [0.2, 0.2]]))
    _looks_up(function, np.array([[0.3, 0.3]]), np.random.default_rng(0).uniform(size=(5, 2)))
    NEAREST.passed("every state found its cell.")


def _looks_up(function: Callable, codewords: np.ndarray, states: np.ndarray) -> None:
    value = np.asarray(NEAREST.call(function, codewords, states))
    if value.shape == states.shape:
        raise NEAREST.wrong("coordinates", "which row of `codewords` is nearest: an integer per state", 1)
    if value.shape == (len(states), len(codewords)):
        raise NEAREST.wrong("a number for each pair of state and codeword", "an integer per state", 1)
    integers, kind = value.dtype.kind in "iu", value.dtype
    value = NEAREST.array(value, (len(states),), hint=1)
    if (value != np.round(value)).any():
        raise NEAREST.wrong("numbers that are no integers", "indices of codewords, not distances to them", 1)
    NEAREST.refuse_if(not integers, f"indices of type {kind}", "integers: nothing else can index an array")
    right = geometry.nearest(codewords, states)
    number = f"the wrong cell for {(value != right).sum()} of {len(states)} states"
    NEAREST.compare(value, right, [*_other_cells(codewords, states), Mistake(None, number, "the right one for all", 1)])


def _other_cells(codewords: np.ndarray, states: np.ndarray) -> list[Mistake]:
    apart = geometry.distances(states, codewords)
    last = len(codewords) - 1 - apart[:, ::-1].argmin(axis=1)
    euclidean, chebyshev = (geometry.nearest(codewords, states, metric) for metric in ("euclidean", "chebyshev"))
    signed = (states[:, None] - codewords).sum(axis=2)
    plane = geometry.nearest(codewords[:, :2], states[:, :2])
    cancel = "differences that cancel", "absolute values first, then the sum", 2
    return [
        Mistake(last, "the later of two codewords that are equally near", "the one with the lower index", 3),
        Mistake(euclidean, "the cells of the Euclidean distance", "those of the Manhattan distance", 2),
        Mistake(chebyshev, "cells by the largest difference along one axis", "those by the sum over the axes", 2),
        Mistake(np.abs(signed).argmin(axis=1), *cancel),
        Mistake(signed.argmin(axis=1), *cancel),
        Mistake(plane, "distances in the first two inputs alone", "all columns: states may have more than two", 2),
        Mistake(apart.argmax(axis=1), "the codeword farthest away", "the nearest one", 1),
        Mistake(apart.argmin(axis=1) + 1, "indices that begin at 1", "indices that begin at 0", 1),
    ]


@ACT.checks
def act(function: Callable) -> None:
    """1.5: `act(codewords, coefficients, states)` returns each state's action by its cell's map, within [-1, 1]."""
    for seed in SEEDS:
        for d, m in CASES:
            rng = np.random.default_rng(seed)
            codewords, states = rng.uniform(size=(4, d)), rng.uniform(size=(60, d))
            _acts(function, codewords, rng.normal(size=(4, d + 1, m)), states)
    ACT.passed("codewords, maps and limits make a policy.")


def _acts(function: Callable, codewords: np.ndarray, coefficients: np.ndarray, states: np.ndarray) -> None:
    n, m = len(states), coefficients.shape[2]
    value = ACT.array(ACT.call(function, codewords, coefficients, states), (n, m), hint=1)
    own = coefficients[geometry.nearest(codewords, states)]
    weighted, bias = np.einsum("nd,ndm->nm", states, own[:, :-1]), own[:, -1]
    raw, first = weighted + bias, states @ coefficients[0, :-1] + coefficients[0, -1]
    ahead = np.einsum("nd,ndm->nm", states, own[:, 1:]) + own[:, 0]
    right, both = np.clip(raw, -1, 1), "limits on both sides, -1 and 1"
    bias_lost = "maps without their bias", "the last row of a cell's coefficients added", 2
    number = (~np.isclose(value, right).all(axis=1)).sum()
    mistakes = [
        Mistake(raw, f"an action of {np.abs(raw).max():.2f}", "none beyond the limits -1 and 1", 3),
        Mistake(np.clip(raw, 0, 1), "no action below 0", both, 3),
        Mistake(np.minimum(raw, 1), "one limit only", both, 3),
        Mistake(np.maximum(raw, -1), "one limit only", both, 3),
        Mistake(np.clip(weighted, -1, 1), *bias_lost),
        Mistake(weighted, *bias_lost),
        Mistake(np.clip(weighted, -1, 1) + bias, "the bias added after the limits", "limits last", 3),
        Mistake(np.clip(ahead, -1, 1), "the first row taken for the bias", "it in the last row", 2),
        Mistake(np.clip(first, -1, 1), "one map for all states", "the map of each state's own cell", 1),
        Mistake(None, f"a wrong action in {number} of {n} states", "the right one in all", 1),
    ]
    ACT.compare(value, right, mistakes)


def piecewise(codewords: np.ndarray, states: np.ndarray, actions: np.ndarray, task: str | Task) -> VoronoiPolicy:
    """Fit least-squares maps in the cells of `codewords` (k, d) to states (n, d) and actions (n, m)."""
    task = get_task(task)
    maps = np.zeros((len(codewords), states.shape[1] + 1, actions.shape[1]))
    maps[:, -1] = actions.mean(axis=0)  # in cells without states
    return baselines.refit(VoronoiPolicy(codewords, maps, task=task), states, actions)


def leftover(codewords: np.ndarray, states: np.ndarray, actions: np.ndarray) -> float:
    """Return the squared error of least-squares maps in the cells of `codewords` (k, d), on the data of the fit."""
    cells, inputs, total = geometry.nearest(codewords, states), np.column_stack([states, np.ones(len(states))]), 0.0
    for cell in np.unique(cells):
        own, goal = inputs[cells == cell], actions[cells == cell]
        total += np.square(own @ np.linalg.lstsq(own, goal, rcond=None)[0] - goal).sum()
    return total / actions.size


@BY_HAND.checks
def by_hand(codewords: np.ndarray, states: np.ndarray, actions: np.ndarray, task: str | Task) -> None:
    """1.6: at most `AT_MOST` codewords whose maps have at most half the error of one map for everything."""
    n = len(codewords) if np.ndim(codewords) else 1
    points = BY_HAND.array(codewords, (max(1, n), 2), "codewords", 1, "a row x, y per codeword")
    if points.shape == (2, 2) and np.allclose(points, GIVEN):
        raise BY_HAND.unsolved()
    inside = ((points >= 0) & (points <= 1)).all()
    BY_HAND.refuse_if(not inside, "a codeword outside the unit square", "all of them inside", 1)
    _all_different(BY_HAND, points)
    BY_HAND.refuse_if(len(points) > AT_MOST, f"{len(points)} codewords", f"at most {AT_MOST}", 3)
    policies = (piecewise(c, states, actions, task) for c in (points[:1], points))
    one, many = (np.square(policy.predict(states)[0] - actions).mean() for policy in policies)
    BY_HAND.refuse_if(many > one / 2, f"{many / one:.1%} of the error of one map", "at most 50%", 2)
    BY_HAND.passed(f"{len(points)} codewords leave {many / one:.0%} of the error of one map.")


def _all_different(exercise: Exercise, points: np.ndarray) -> None:
    twice = len(np.unique(points, axis=0)) < len(points)
    exercise.refuse_if(twice, "a codeword that is there twice", "all of them different", 1)


@PLACE.checks
def place(function: Callable) -> None:
    """1.7: `place(states, actions, k)` returns k codewords that beat random ones, on both tasks."""
    for name, n_episodes in (("SimpleGoal-v0", 150), ("MountainCarContinuous-v0", 10)):
        for seed in PLACE_SEEDS:
            rng = np.random.default_rng(seed)
            states, actions = joined(teacher_episodes(load_teacher(name), get_task(name), n_episodes, rng))
            _places(function, states, actions, name, rng)
    PLACE.passed(f"your rule beats random codewords on both tasks, with {CELLS} cells.")


def _places(
    function: Callable, states: np.ndarray, actions: np.ndarray, name: str, rng: np.random.Generator,
    error: Callable = leftover, margin: float = MARGIN,
) -> None:  # fmt: skip
    """`error` and `margin` are bound here, so that an answer cannot replace them in this module."""
    points = PLACE.array(PLACE.call(function, states, actions, CELLS), (CELLS, states.shape[1]), "codewords", 1)
    _all_different(PLACE, points)
    own, different = error(points, states, actions), np.unique(states, axis=0)
    draws = [rng.choice(different, CELLS, replace=False) for _ in range(DRAWS)]
    random = np.median([error(draw, states, actions) for draw in draws])
    if own > margin * random:
        found = f"{own / random:.1%} of the error of random codewords on {name}"
        raise PLACE.wrong(found, f"at most {margin:.0%}, on both tasks", 2 if own > random else 3)
