"""Checks of lesson 1: what a policy is, linear maps, errors, cells, and codewords set by hand and by a rule."""

from collections.abc import Callable, Iterator

import numpy as np

from vsp import PiecewisePolicy, Policy, Task, VoronoiPolicy, agent, geometry, get_task, load_teacher, teacher_episodes
from vsp.paper import baselines
from vsp.rollouts import Episodes

from . import drawing
from .feedback import Exercise, Mistake, generators

GIVEN = ((0.3, 0.3), (0.7, 0.6))  # codewords that the notebook begins with
AT_MOST, SHARE = 4, 0.4  # codewords set by hand (with eight, chance does as well), and of the error of one map
TWICE = ("a codeword that is there twice", "all of them different", 1)
# Codewords asked of a rule (with other numbers it only has to do about as well as chance), and random ones, each time
CELLS, DRAWS = 8, 100
MARGIN, WORST = 0.8, 1.1  # times the error of random codewords: in the mean of a rule, and each time

READING = Exercise("1.1", "reading")
FIT_LINEAR = Exercise("1.2", "fit_linear", (baselines.refit, baselines.linear_map))
PAIR = ((TypeError, "tuple", 1), (ValueError, "inhomogeneous", 1))  # errors of who takes what `predict` returns whole
ACTION_ERROR = Exercise("1.3", "action_error", (drawing.squared_error,), PAIR)
NEAREST = Exercise("1.4", "nearest", (geometry.nearest, geometry.look_up, geometry.distances))
ACT = Exercise("1.5", "act", (PiecewisePolicy.predict, PiecewisePolicy.linear))
BY_HAND = Exercise("1.6", "codewords")
PLACE = Exercise("1.7", "place")


@READING.checks
def reading(answers: object) -> None:
    """1.1: answers `right of the pit`, `beyond the pit`, `at the limit`, `sudden turn`."""
    READING.ask(answers, "you read the arrows as the network means them.")


def _draws() -> Iterator[tuple[np.random.Generator, int, int, int, int]]:
    """Random generators, each with the numbers of states, inputs, outputs and cells of a case."""
    for rng, (d, m) in zip(generators(9), 3 * ((2, 2), (2, 1), (5, 3))):
        yield rng, int(rng.integers(30, 90)), d, m, int(rng.integers(2, 12))


@FIT_LINEAR.checks
def fit_linear(function: Callable) -> None:
    """1.2: `fit_linear(states, actions)` returns coefficients (d + 1, m), weights above the bias."""
    for rng, n, d, m, _ in _draws():
        states = rng.uniform(-1, 1, (n, d))
        actions = 1 + states @ rng.normal(size=(d, m)) + rng.normal(size=(n, m))
        answer = FIT_LINEAR.call(function, states, actions)
        if isinstance(answer, tuple):
            raise FIT_LINEAR.wrong(f"{len(answer)} values", f"one array {(d + 1, m)}, the coefficients alone", 3)
        mistaken_shapes = {
            (m, d + 1): (f"shape {(m, d + 1)}", f"{(d + 1, m)}: a row per input, a column per action", 2),
            (d, m): (f"{d} rows for {d} inputs", "one row more: at the origin such a map can only say 0", 1),
        }
        if np.shape(answer) in mistaken_shapes:
            raise FIT_LINEAR.wrong(*mistaken_shapes[np.shape(answer)])
        coefficients = FIT_LINEAR.array(answer, (d + 1, m), hint=2)
        inputs = np.column_stack([states, np.ones(len(states))])
        best = np.linalg.lstsq(inputs, actions, rcond=None)[0]
        error, least = (np.square(inputs @ c - actions).mean() for c in (coefficients, best))
        if error > 1.00001 * least:  # a map found by gradient descent is right too
            aim = f"{least:.6g}, the least that a linear map of these arguments can have (not of other variables)"
            mistakes = [
                Mistake(np.roll(best, 1, axis=0), "the bias in the first row", "it in the last one", 2),
                Mistake(None, f"a squared error of {error:.6g}", aim, 1),
            ]
            FIT_LINEAR.compare(coefficients, best, mistakes)
    FIT_LINEAR.passed("weights and bias, and no map has a smaller squared error.")


def _linear(weights: np.ndarray) -> Policy:
    return agent(lambda states: states @ weights)


@ACTION_ERROR.checks
def action_error(function: Callable) -> None:
    """1.3: `action_error(policy, teacher, states)` returns the mean squared difference of two policies' actions."""
    for rng, n, d, m, _ in _draws():
        states = rng.normal(size=(n, d))[rng.integers(n, size=n)]  # some are there twice
        policy, teacher = (_linear(rng.normal(size=(d, m))) for _ in range(2))
        difference = policy.predict(states)[0] - teacher.predict(states)[0]
        squares, both_sides = np.square(difference), "a mean in which errors to either side cancel"
        value = np.asarray(ACTION_ERROR.call(function, policy, teacher, states))
        shape = f"an array of shape {value.shape}"
        ACTION_ERROR.refuse_if(value.size != 1, shape, "one number for all states together", 1)
        (value,) = ACTION_ERROR.array(np.ravel(value), (1,))
        mistakes = [
            Mistake(squares.sum(axis=1).mean(), "a sum over the actions", "a mean over them too", 2),
            Mistake(squares.sum(), "a sum over everything", "a mean", 2),
            Mistake(np.sqrt(squares.mean()), "a root", "the mean of squares as it is", 2),
            Mistake(np.abs(difference).mean(), "a mean of absolute values", "one of squares", 2),
            Mistake(difference.mean(), both_sides, "one of squares", 2),
            Mistake(-difference.mean(), both_sides, "one of squares", 2),
            Mistake(difference.mean() ** 2, "the square of a mean", "the mean of squares: square, then average", 2),
            Mistake(None, "another number", "a mean of squared differences of the two arguments' actions", 1),
        ]
        ACTION_ERROR.compare(value, squares.mean(), mistakes)
    ACTION_ERROR.passed("a mean of squares, over states and over actions.")


@NEAREST.checks
def nearest(function: Callable) -> None:
    """1.4: `nearest(codewords, states)` returns the index of the nearest codeword by Manhattan distance. (n,)"""
    cases = [(4 * m * rng.uniform(-1, 1, (k, d)), 4 * m * rng.uniform(-1, 1, (n, d))) for rng, n, d, m, k in _draws()]
    ties = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), np.array([[0.5, 0.0], [1.0, 0.5], [0.2, 0.2]])
    grid = np.random.default_rng(1).integers(-2, 3, (2, 40, 2)).astype(float)  # ties of all kinds
    cases += [ties, (np.array([[0.3, 0.3]]), grid[0]), (grid[0], grid[1])]
    for codewords, states in cases:
        value = np.asarray(NEAREST.call(function, codewords, states))
        mistaken_shapes = {states.shape: "coordinates", (len(states), len(codewords)): "a number for each pair"}
        if value.shape in mistaken_shapes:
            raise NEAREST.wrong(mistaken_shapes[value.shape], "which row of `codewords` is nearest, for each state", 1)
        cells = NEAREST.array(value, (len(states),), hint=1)
        fractions = (cells != np.round(cells)).any()
        NEAREST.refuse_if(fractions, "numbers that are no integers", "indices of codewords, not distances to them", 1)
        whole = value.dtype.kind in "iu" or all(isinstance(cell, int | np.integer) for cell in value)
        NEAREST.refuse_if(not whole, f"indices of type {value.dtype}", "integers: nothing else can index an array")
        right = geometry.nearest(codewords, states)
        distances, signed = geometry.distances(states, codewords), (states[:, None] - codewords).sum(axis=2)
        last = len(codewords) - 1 - distances[:, ::-1].argmin(axis=1)
        euclidean, chebyshev = (geometry.nearest(codewords, states, metric) for metric in ("euclidean", "chebyshev"))
        plane = geometry.nearest(codewords[:, :2], states[:, :2])
        cancel = "differences that cancel", "absolute values first, then the sum", 2
        number = f"the wrong cell for {(cells != right).sum()} of {len(states)} states"
        mistakes = [
            Mistake(last, "the later of two codewords that are equally near", "the one with the lower index", 3),
            Mistake(euclidean, "the cells of the Euclidean distance", "those of the Manhattan distance", 2),
            Mistake(chebyshev, "cells by the largest difference along one axis", "those by the sum over the axes", 2),
            Mistake(np.abs(signed).argmin(axis=1), *cancel),
            Mistake(signed.argmin(axis=1), *cancel),
            Mistake(plane, "distances in the first two inputs alone", "all columns: states may have more than two", 2),
            Mistake(distances.argmax(axis=1), "the codeword farthest away", "the nearest one", 1),
            Mistake(right + 1, "indices that begin at 1", "indices that begin at 0", 1),
            Mistake(None, number, "the right one for all", 1),
        ]
        NEAREST.compare(cells, right, mistakes)
    NEAREST.passed("every state found its cell.")


@ACT.checks
def act(function: Callable) -> None:
    """1.5: `act(codewords, coefficients, states)` returns each state's action by its cell's map, within [-1, 1]."""
    for rng, n, d, m, k in _draws():
        codewords, states = rng.uniform(-1, 1, (k, d)), rng.uniform(-2, 2, (n, d))
        coefficients = rng.normal(size=(k, d + 1, m))
        value = ACT.array(ACT.call(function, codewords, coefficients, states), (n, m), hint=1)
        maps = coefficients[geometry.nearest(codewords, states)]
        weighted, bias = np.einsum("nd,ndm->nm", states, maps[:, :-1]), maps[:, -1]
        raw, first = weighted + bias, states @ coefficients[0, :-1] + coefficients[0, -1]
        right, both = np.clip(raw, -1, 1), "limits on both sides, -1 and 1"
        wrong = (np.abs(value - right) > 1e-4).any(axis=1).sum()
        mistakes = [
            Mistake(raw, f"an action of {np.abs(raw).max():.2f}", "none beyond the limits -1 and 1", 3),
            Mistake(np.clip(raw, 0, 1), "no action below 0", both, 3),
            Mistake(np.minimum(raw, 1), "one limit only", both, 3),
            Mistake(np.maximum(raw, -1), "one limit only", both, 3),
            Mistake(np.clip(weighted, -1, 1), "maps without their bias", "the last row of a cell's map added", 2),
            Mistake(np.clip(weighted, -1, 1) + bias, "the bias added after the limits", "limits last", 3),
            Mistake(np.clip(first, -1, 1), "one map for all states", "the map of each state's own cell", 1),
            Mistake(None, f"a wrong action in {wrong} of {n} states", "the right one in all", 1),
        ]
        ACT.compare(value, right, mistakes, rtol=1e-5)  # float32 is right too
    ACT.passed("codewords, maps and limits make a policy.")


def piecewise(codewords: np.ndarray, states: np.ndarray, actions: np.ndarray, task: str | Task) -> VoronoiPolicy:
    """Fit least-squares maps in the cells of `codewords` (k, d) to states (n, d) and actions (n, m)."""
    maps = np.zeros((len(codewords), states.shape[1] + 1, actions.shape[1]))
    maps[:, -1] = actions.mean(axis=0)  # in cells without states
    return baselines.refit(VoronoiPolicy(codewords, maps, task=task), states, actions)


def leftover(codewords: np.ndarray, states: np.ndarray, actions: np.ndarray) -> float:
    """Return the squared error of least-squares maps in the cells of `codewords` (k, d), on the data of the fit."""
    cells, inputs, total = geometry.nearest(codewords, states), np.column_stack([states, np.ones(len(states))]), 0.0
    for cell in np.unique(cells):
        x, y = inputs[cells == cell], actions[cells == cell]
        total += np.square(x @ np.linalg.lstsq(x, y, rcond=None)[0] - y).sum()
    return total / actions.size


@BY_HAND.checks
def by_hand(codewords: np.ndarray) -> None:
    """1.6: at most `AT_MOST` codewords whose maps have at most `SHARE` of the error of one map for everything."""
    n = len(codewords) if np.ndim(codewords) else 1
    points = BY_HAND.array(codewords, (max(1, n), 2), "codewords", 1, "a row x, y per codeword")
    if points.shape == (2, 2) and np.allclose(points, GIVEN):
        raise BY_HAND.unsolved()
    inside = ((points >= 0) & (points <= 1)).all()
    BY_HAND.refuse_if(not inside, "a codeword outside the unit square", "all of them inside", 1)
    BY_HAND.refuse_if(not geometry.all_differ(points), *TWICE)
    BY_HAND.refuse_if(len(points) > AT_MOST, f"{len(points)} codewords", f"at most {AT_MOST}", 3)
    task = get_task("SimpleGoal-v0")
    episodes = Episodes(teacher_episodes(load_teacher(task.name), task, 300, np.random.default_rng(0)))
    policies = (piecewise(c, episodes.states, episodes.actions, task) for c in (points[:1], points))
    single, all_cells = (np.square(policy.predict(episodes.states)[0] - episodes.actions).mean() for policy in policies)
    share = all_cells / single
    BY_HAND.refuse_if(share > SHARE, f"{share:.1%} of the error of one map", f"at most {SHARE:.0%}", 2)
    BY_HAND.passed(f"{len(points)} codewords leave {share:.0%} of the error of one map.")


@PLACE.checks
def place(function: Callable) -> None:
    """1.7: `place(states, actions, k)` returns k codewords that beat random ones, on both tasks."""
    for name, n_episodes in (("SimpleGoal-v0", 150), ("MountainCarContinuous-v0", 10)):
        ratios, random = [], " of the error of random codewords"
        for rng, k in zip(generators(7), (*5 * (CELLS,), 5, 11)):
            episodes = Episodes(teacher_episodes(load_teacher(name), get_task(name), n_episodes, rng))
            states, actions = episodes.states, episodes.actions
            placed = PLACE.call(function, states, actions, k)
            points = PLACE.array(placed, (k, states.shape[1]), "codewords", 1)
            PLACE.refuse_if(not geometry.all_differ(points), *TWICE)
            error, different = leftover(points, states, actions), np.unique(states, axis=0)
            draws = [rng.choice(different, k, replace=False) for _ in range(DRAWS)]
            ratios.append(error / np.median([leftover(d, states, actions) for d in draws]))
            share = f"{ratios[-1]:.1%}{random} on {name}"
            PLACE.refuse_if(ratios[-1] > WORST, share, f"at most {WORST:.0%} each time", 2)
        mean = np.mean(ratios[:5])  # those with CELLS codewords
        PLACE.refuse_if(mean > MARGIN, f"{mean:.1%}{random} on {name}, in the mean", f"at most {MARGIN:.0%}", 3)
    PLACE.passed(f"your rule beats random codewords on both tasks, with {CELLS} cells.")
