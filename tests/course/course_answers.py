"""What students write: typical wrong answers with the words that a check must find for them, and other right ones.

`@wrong("1.2", "one row more")` enters an answer to exercise 1.2 in WRONG, `@right("1.2")` in RIGHT. Most wrong answers
are the lesson's own solution with a piece of its text changed: `wrongs` enters these.
"""

from dataclasses import replace
from multiprocessing.pool import ThreadPool

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree
from scipy.stats import bootstrap

import vsp
from vsp import tasks
from vsp.paper import baselines
from vsp.rollouts import collect_episodes, rollout
from vsp.subpolicies.base import PolicyClass
from vsp_course import build, lesson_1, lesson_2, lesson_3
from vsp_course.feedback import Exercise

EXERCISES = {
    exercise.number: (lesson, exercise.name)
    for lesson in (lesson_1, lesson_2, lesson_3)
    for exercise in vars(lesson).values()
    if isinstance(exercise, Exercise)
}
SOLUTIONS = [
    cell.source for lesson in build.read_sources().values() for cell in lesson.cells if build.is_solution(cell)
]
GIVEN = {"np": np, "vsp": vsp, "tasks": tasks, "rollout": rollout, "collect_episodes": collect_episodes,
         "EXPERT": lesson_3.standard_errors, "FAILURES": lesson_3.failures, "REFIT": baselines.refit,
         "LOOP": lesson_2._algorithm_1}  # fmt: skip
WRONG, RIGHT = [], []  # (exercise, words of the message, answer), (exercise, answer)


def wrong(exercise, words):
    return lambda answer: WRONG.append((exercise, words, answer)) or answer


def right(exercise):
    return lambda answer: RIGHT.append((exercise, answer)) or answer


def changed(exercise, *changes):
    """The function that solves an exercise, with pieces of its text replaced: old, new, old, new, ..."""
    name = EXERCISES[exercise][1]
    (source,) = (source for source in SOLUTIONS if f"def {name}(" in source)
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in source, f"{old} is not in the solution of {exercise}"
        source = source.replace(old, new)
    made = {}
    exec(source, {**GIVEN, "check": lesson_1}, made)
    return made[name]


def wrongs(exercise, *entries):
    """Enter wrong answers: of each the words, then the changes of the solution."""
    for words, *changes in entries:
        wrong(exercise, words)(changed(exercise, *changes))


def first(exercise, statement):
    """The function that solves an exercise, with a statement before its body."""
    return changed(exercise, "    ### BEGIN", f"    {statement}\n    ### BEGIN")


SHUFFLED = "np.random.default_rng(0).shuffle(actions)"
CENTRED = "actions -= actions.mean(axis=0)"
for exercise, i, statement in (
    ("1.2", 1, "states *= 2"), ("1.2", 2, CENTRED), ("1.2", 2, SHUFFLED), ("1.3", 3, "states *= 0"),
    ("1.5", 3, "states[:] = 0"), ("1.7", 1, "states.sort(axis=0)"), ("2.2", 2, "losses *= 0"), ("3.2", 1, "ours *= 2"),
    ("3.5", 3, "actions *= -1"), ("3.5", 3, CENTRED), ("3.5", 3, SHUFFLED), ("3.5", 2, "states.sort(axis=0)"),
    ("3.6", 6, "actions *= -1"),
):  # fmt: skip
    wrong(exercise, f"argument {i} altered in place")(first(exercise, statement))
GAPS = "return ours.mean() - theirs.mean(), EXPERT(ours, theirs)[0]"
wrong("3.2", "a call of vsp's `standard_errors`")(first("3.2", GAPS))
wrong("3.5", "a call of vsp's `refit`")(first("3.5", "return REFIT(policy, states, actions)"))
wrong("2.2", "KeyError")(first("2.2", "known = dict.fromkeys(range(4), 0); [known[cell] for cell in cells]"))


# 1.1 reading

READ_1 = {
    "right of the pit": "down-left",
    "beyond the pit": "down-right",
    "at the limit": "more than three quarters",
    "sudden turn": "beyond the pit, seen from the goal",
}
wrong("1.1", "is not answered yet")(READ_1 | {"at the limit": None})
wrong("1.1", "what lies on it")(READ_1 | {"beyond the pit": "down-left"})
wrong("1.1", "expected one of")(READ_1 | {"sudden turn": "everywhere"})
wrong("1.1", "→ Hint 3")(READ_1 | {"sudden turn": "between goal and pit"})
right("1.1")(READ_1)


# 1.2 fit_linear

LSTSQ = "np.linalg.lstsq(inputs, actions, rcond=None)[0]"
RIDGE = "np.linalg.solve(inputs.T @ inputs + 0.1 * np.eye(inputs.shape[1]), inputs.T @ actions)"
wrongs(
    "1.2",
    ("one row more", "np.column_stack([states, np.ones(len(states))])", "states"),
    ("the bias in the first row", "[states, np.ones(len(states))]", "[np.ones(len(states)), states]"),
    ("a row per input, a column per action", "[0]", "[0].T"),
    ("4 values", "[0]", ""),
    ("None as the result", "return np", "np"),
    ("not of other variables", "inputs =", "actions = states = np.eye(9)[:, :2]; inputs ="),
    ("the least that a linear map", LSTSQ, RIDGE),
    ("in line", "len(states)", "40"),
    ("NaN or infinity", "[0]", "[0] * np.nan"),
)
right("1.2")(changed("1.2", LSTSQ, "np.array([np.linalg.pinv(inputs) @ column for column in actions.T]).T.tolist()"))


@right("1.2")
def by_descent(states, actions):
    inputs = np.column_stack([states, np.ones(len(states))])
    coefficients = np.zeros((inputs.shape[1], actions.shape[1]))
    for _ in range(1000):
        coefficients -= 0.2 * inputs.T @ (inputs @ coefficients - actions) / len(states)
    return coefficients


# 1.3 action_error

wrongs(
    "1.3",
    ("a sum over the actions", ".mean()", ".sum(axis=1).mean()"),
    ("a root", ".mean()", ".mean() ** 0.5"),
    ("absolute values", "np.square", "np.abs"),
    ("cancel", "np.square(policy", "-(policy"),
    ("the square of a mean", "np.square", "", ".mean()", ".mean() ** 2"),
    ("TypeError (unsupported operand type(s) for -: 'tuple'", "[0]", ""),
    ("→ Hint 1", "teacher.predict(states)[0]", "np.array(teacher.predict(states))"),
    ("another number", "policy.predict(states)[0]", "1"),
    ("one number for all states", ".mean()", ".mean(axis=1)"),
    ("another number", ".mean()", ".sum() / 60"),
    ("NaN or infinity", ".mean()", ".mean() * np.nan"),
)


@right("1.3")
def as_an_array(policy, teacher, states):
    (a, _), (b, _) = policy.predict(states), teacher.predict(states)
    return np.array([((a - b) ** 2).mean(axis=0).mean()])


# 1.4 nearest

DIFFERENCES = "np.abs(states[:, None] - codewords)"
wrongs(
    "1.4",
    ("the cells of the Euclidean distance", "np.abs", "np.square"),
    ("along one axis", ".sum(axis=2)", ".max(axis=2)"),
    ("differences that cancel", f"{DIFFERENCES}.sum(axis=2)", "np.abs((states[:, None] - codewords).sum(axis=2))"),
    ("the first two inputs alone", "states[:, None] - codewords", "states[:, None, :2] - codewords[:, :2]"),
    ("the later of two", "np.abs", "len(codewords) - 1 - np.abs", ".argmin", "[:, ::-1].argmin"),
    ("coordinates", "np.abs", "codewords[np.abs", ".argmin(axis=1)", ".argmin(axis=1)]"),
    ("not distances", "argmin", "min"),
    ("begin at 1", ".argmin(axis=1)", ".argmin(axis=1) + 1"),
    ("farthest", "argmin", "argmax"),
    ("states, expected the right one for all", "states[:, None]", "1.02 * states[:, None]"),
    ("indices of type float64", ".argmin(axis=1)", ".argmin(axis=1).astype(float)"),
    ("the right one for all", "states[:, None] - codewords", "states[:, None, :3] - codewords[:, :3]"),
    ("the right one for all", ".sum(axis=2)", ".sum(axis=2).clip(max=10)"),
    ("", ".sum(axis=2)", "[:, range(6)].sum(axis=2)"),
)


@right("1.4")
def by_min(codewords, states):
    return [min(range(len(codewords)), key=lambda i: sum(abs(s - codewords[i]))) for s in states]


# 1.5 act

wrongs(
    "1.5",
    ("beyond the limits", "np.clip(actions, -1.0, 1.0)", "actions"),
    ("limits on both sides", "-1.0, 1.0", "0, 1"),
    ("one limit only", "np.clip(actions, -1.0, 1.0)", "np.minimum(actions, 1)"),
    ("without their bias", " + own[:, -1]", ""),
    ("one map for all states", "vsp.nearest(codewords, states)", "np.zeros(len(states), int)"),
    ("after the limits", " + own[:, -1]", "", "np.clip(actions, -1.0, 1.0)", "np.clip(actions, -1, 1) + own[:, -1]"),
    ("a wrong action in 1 of", "    return np.clip", "    actions[0] = 0.5\n    return np.clip"),
    ("", "own =", "coefficients = coefficients[:4]; own ="),
)


@right("1.5")
def state_by_state(codewords, coefficients, states):
    return [
        [max(-1, min(1, float(np.append(s, 1) @ column))) for column in coefficients[i].T]
        for s, i in zip(states, by_min(codewords, states))
    ]


right("1.5")(lambda *given: changed("1.5")(*(np.asarray(one, np.float32) for one in given)))
right("1.4")(lambda codewords, states: by_min(codewords, states) and np.array(by_min(codewords, states), dtype=object))

# 1.6 codewords

wrong("1.6", "is not written yet")(np.array([[0.3, 0.3], [0.7, 0.6]]))
wrong("1.6", "expected at most 4")(np.random.default_rng(0).uniform(size=(5, 2)))
wrong("1.6", "a row x, y per codeword")(np.zeros((0, 2)))
wrong("1.6", "→ Hint 2")([[0.6, 0.7], [0.7, 0.6], [0.8, 0.95], [0.3, 0.3]])
wrong("1.6", "there twice")(np.array([[0.5, 0.5], [0.5, 0.5]]))
wrong("1.6", "NaN or infinity in codewords")(np.array([[np.nan, 0.5], [0.2, 0.3]]))
wrong("1.6", "outside the unit square")(np.array([[0.5, 0.5], [5, 0.5]]))
right("1.6")(np.array([[0.29, 0.1], [0.07, 1.0], [0.28, 0.31], [0.69, 0.04]]))
right("1.6")([[0.17, 0.31], [0.1, 0.05], [0.22, 0.44], [0.39, 0.19]])


# 1.7 place


wrong("1.7", "expected (8, 2)")(lambda states, actions, k: states[: k - 1])
wrong("1.7", "of random codewords on SimpleGoal-v0")(lambda states, actions, k: np.unique(states, axis=0)[:k])
wrongs(
    "1.7",
    ("→ Hint 3", "range(60)", "range(5)"),
    ("expected (5, 2)", "candidates, k,", "candidates, 8,"),
)


right("1.7")(changed("1.7", "range(60)", "range(20)", "default_rng(0)", "default_rng(1)"))


# 2.1 reading

READ_2 = {
    "last change": 3540,
    "half of the cells": "before iteration 500",
    "fewer cells by": "a merge",
    "loss jumps by": "a split",
}
wrong("2.1", "still changes after it")(READ_2 | {"last change": 1000})
wrong("2.1", "nothing changes there")(READ_2 | {"last change": 4900})
wrong("2.1", "where the freeze begins")(READ_2 | {"last change": 4000})
wrong("2.1", "a split adds a codeword")(READ_2 | {"fewer cells by": "a split"})
wrong("2.1", "the large jumps are another matter")(READ_2 | {"loss jumps by": "a reset of the buffers"})
wrong("2.1", "expected a number")(READ_2 | {"last change": "3540"})
wrong("2.1", "expected a number")(READ_2 | {"last change": float("nan")})
right("2.1")(READ_2 | {"last change": 3700.0})


# 2.2 running_mean

NEW, MEAN = "t and cell != cells[t - 1]", "np.mean(since)"
wrongs(
    "2.2",
    ("since the episode began", NEW, "False"),
    ("earlier visit", MEAN, "losses[: t + 1][cells[: t + 1] == cell].mean()"),
    ("sums", MEAN, "sum(since)"),
    ("the losses themselves, as if the mean began anew at every step", NEW, "cell != None"),
    ("outside the first cell", NEW, "cell != cells[0]"),
    ("NaN or infinity", "np.array(means)", "np.array(means) / 0"),
)


@wrong("2.2", "losses of later steps")
def mean_of_the_visit(cells, losses):
    visit = np.cumsum(np.r_[True, cells[1:] != cells[:-1]])
    return np.array([losses[visit == v].mean() for v in visit])


@right("2.2")
def by_pandas(cells, losses):
    cells, losses = pd.Series(cells), pd.Series(losses)
    return losses.groupby((cells != cells.shift()).cumsum()).expanding().mean().to_numpy()


# 2.3 split_regions

LOCATE = "        i = partition.locate(state)\n"
BESIDE = "abs(np.arange(len(partition.codewords) + 1) - i) < 2"
EUCLIDEAN = "np.linalg.norm(partition.codewords[i] - state) > config.min_pol_distance"
FOR_ALL_CELLS = "for i, state, action in zip([*map(partition.locate, episode.states)], "
wrongs(
    "2.3",
    ("not the last one. → Hint 3", "np.mean(losses)", "losses[-1]"),
    ("not the largest loss. → Hint 2", "np.mean(losses)", "max(losses)"),
    ("not their sum. → Hint 2", "np.mean(losses)", "sum(losses)"),
    ("not the last ones", "np.mean(losses)", "np.mean(losses[-3:])"),
    ("the mean begins anew", "previous, losses = i, []", "previous = i"),
    ("a codeword that came a moment ago", LOCATE, "", "for state, action in zip(", FOR_ALL_CELLS),
    ("no state far from its codeword", "partition.far(i, state)", "state.tolist() not in partition.codewords.tolist()"),
    ("a policy without any error", "np.mean(losses) > config.max_pol_loss and ", ""),
    ("go on after a split", "losses = []  # after a split the mean begins anew\n    return", "break\n    return"),
    ("buffers of (0, 0, 0, 0, 0) states", "affected[i] = True", "affected[:-1] = True"),
    ("buffers of (1, 0, 1, 1, 0) states", "affected[i] = True", "affected[i] = False"),
    ("ask for the loss of its own", "partition.loss(i,", "partition.loss(0,"),
    ("by `partition.loss` and `partition.far`", "partition.far(i, state)", EUCLIDEAN),
    ("0 codewords returned", "return added", "return []"),
    ("not their indices", "added.append(state)", "added.append(len(partition.codewords) - 1)"),
    ("→ Hint 1", "        split = np.mean(losses) > config.max_pol_loss and partition.far(i, state)\n", ""),
    ("→ Hint 5", "np.append(partition.neighbours()[i], False)", "partition.neighbours()[i]"),
    ("exactly at the limit", "> config.max_pol_loss", ">= config.max_pol_loss"),
    ("on a random walk", "config.max_pol_loss", "0.25"),
    ("on a random walk", "partition.far(i, state)", "np.abs(partition.codewords[i] - state).sum() > 0.2"),
    ("emptied, no others", "np.append(partition.neighbours()[i], False)", BESIDE),
)
# The paper does not say whether the mean begins anew after a split
right("2.3")(changed("2.3", "            losses = []  # after a split the mean begins anew\n    return", "    return"))
OWN_LOCATE = "        i = int(np.abs(partition.codewords - state).sum(axis=1).argmin())\n"
right("2.3")(changed("2.3", LOCATE, OWN_LOCATE, "return added", "return np.array(added)"))


# 2.4 merge_regions

RESET, SIZE = "partition.reset(near)", "np.abs(coefficients - coefficients[i]).max(axis=1)"
wrongs(
    "2.4",
    ("six coefficients that each differ", SIZE, "np.linalg.norm(coefficients - coefficients[i], axis=1)"),
    ("one coefficient that differs", "apart < config", "apart < 2 * config"),
    ("one coefficient that differs", SIZE, SIZE.replace("[i])", "[i])[:, :-1]")),
    ("six coefficients that each differ", "apart < config", "apart < 0.95 * config"),
    ("its size counts, not its sign", SIZE, SIZE.replace("np.abs", "")),
    ("cells that are not neighbours", "partition.neighbours()[i]", "np.arange(len(partition.codewords)) != i"),
    ("whose turn comes first stays", "removed +=", "alike = np.arange(len(alike)) == i; removed +="),
    ("expected [0] or [1], in a case of two equal cells: one goes, one stays", "apart <", "apart >="),
    ("buffers of (0, 0, 0, 0) states", RESET, "partition.reset(near | True)"),
    ("buffers of (0, 1, 1, 1) states", "near[i] = True", "near[i] = False"),
    ("buffers of (1, 0, 1, 1) states", RESET, "partition.reset(np.arange(len(near)) == i)"),
    ("every cell that is left has its turn", "i -= alike[:i].sum()", "pass"),
    ("→ Hint 5", RESET, "partition.keep(~alike)", "partition.keep(~alike)\n            i", f"{RESET}\n            i"),
    ("not their indices", "list(partition.codewords[alike])", "np.flatnonzero(alike).tolist()"),
    ("→ Hint 2", "while i < len(partition.codewords):", "for i in range(len(partition.codewords)):"),
    ("nothing is averaged", "return removed", "partition.models.coefficients[:] += 0.1; return removed"),
    ("exactly the limit", "apart < config", "apart <= config"),
    ("both go at once", "if alike.any()", "alike[alike.argmax() + 1 :] = False\n        if alike.any()"),
    ("all neighbours alike, of any index", "if alike.any()", "alike[:i] = False\n        if alike.any()"),
    ("with random maps", "config.min_param_distance", "0.6"),
    ("emptied, no others", RESET, "partition.reset(abs(np.arange(len(near)) - i) < 2)"),
)
# A turn that goes on while a neighbour is alike
right("2.4")(changed("2.4", "        i += 1", "        i += not alike.any()"))


def with_a_mask(partition, config, gone_have_turns=False):
    coefficients, graph = partition.comparable_coefficients(), partition.neighbours()
    close = np.abs(coefficients[:, None] - coefficients).max(axis=2) < config.min_param_distance
    alive = np.ones(len(graph), dtype=bool)
    for i in range(len(graph)):
        alike = alive & graph[i] & close[i] & (alive[i] or gone_have_turns)
        alike[: i if gone_have_turns else 0] = False
        alive &= ~alike
        if alike.any():
            partition.reset(graph[i] | (np.arange(len(graph)) == i))
    removed = partition.codewords[~alive]
    partition.keep(alive)
    return removed


right("2.4")(with_a_mask)
wrong("2.4", "it removes no others")(lambda *given: with_a_mask(*given, gone_have_turns=True))


# 2.5 algorithm_1

FROZEN = "config.n_freeze:"
DUE = "            if n % config.n_split == 0:\n                split(partition, episode, config, rng)\n"
wrongs(
    "2.5",
    ("tells nothing yet", "0 < n <", "n <"),
    ("the freeze begins at", FROZEN, "config.n_freeze + 1:"),
    ("no `clear`", "partition.clear()", "pass"),
    ("no `clear`", "n and n %", "0 < n < config.n_epochs - config.n_freeze and n %"),
    ("the first state of the first episode", "episodes[0].states[0]", "episodes[0].states[-1]"),
    ("splits first", DUE, "", "merge(partition, config)\n", f"merge(partition, config)\n{DUE}"),
    ("one training step", "partition.train(rng)", "pass"),
    ("no `merge`", "n % config.n_merge == 0", "n % config.n_merge == n % config.n_split == 0"),
    ("something else", "split(partition, episode,", "split(partition, episodes[0],"),
    ("no episode observed", "partition.add", "return; partition.add"),
    ("however many episodes there are", "config.n_epochs - config.n_freeze", "len(episodes) - config.n_freeze"),
    ("`merge` with something else", "merge(partition, config)", "merge(config, partition)"),
    ("`split` with something else", "split(partition, episode, config, rng)", "split(None, episode, config, rng)"),
    ("`split` with something else", "split(partition, episode, config, rng)", "split(partition, episode, None, rng)"),
    ("in line", "partition.train(rng)", "partition.train()"),
    ("in line", "episodes[0].states[0], rng", "episodes[0].states[0]"),
    ("`train` with something else", "partition.train(rng)", "partition.train(np.random.default_rng())"),
    ("`add` with something else", "episodes[0].states[0], rng", "episodes[0].states[0], np.random.default_rng(8)"),
)


LOOP = "episodes = iter(episodes)\n    for n in range(config.n_epochs):\n        episode = next(episodes)"
FIRST = "        if not len(partition.codewords):\n            partition.add(episode.states[0], rng)\n"
OBSERVE = "        partition.observe(episode)\n"
right("2.5")(
    changed(
        "2.5", "for n, episode in enumerate(episodes):", LOOP, "    partition.add(episodes[0].states[0], rng)\n", "",
        OBSERVE, FIRST + OBSERVE, "n and n %", "n %",  # cleared also at n = 0, where it does no harm
    )
)  # fmt: skip
right("2.5")(changed("2.5", ", episode, config, rng)", ", config=config, episode=episode, rng=rng)"))


# 2.6 prediction

PREDICTION = {
    "a lower distance": "more cells",
    "a higher loss": "as many",
    "easier merges": "fewer cells",
    "exact maps": "fewer cells",
}
wrong("2.6", "wrong predictions for ['a higher loss']")(PREDICTION | {"a higher loss": "fewer cells"})
right("2.6")(PREDICTION)


# 2.7 my_policy_class


def class_of(features, code, terms=None, name="mine", sizes=None, kind=PolicyClass):
    terms = terms or tuple(f"f{i}" for i in range(len(code)))
    return kind(name, terms, code, np.ones(len(terms)) if sizes is None else sizes, features)


def wrong_class(words, features, *code, **others):
    wrong("2.7", words)(lambda task: class_of(features, code, **others))


def sides(s):
    return np.abs(s[..., :1] - s[..., 1:])


wrong_class("the features of 'linear'", lambda s: 2 * s[..., ::-1], "2 * state[1]", "2 * state[0]")
wrong_class("sums of the state's components", lambda s: s[..., 1:], "state[1]")
wrong_class("a string for `terms`", sides, "fabs(state[0] - state[1])", terms="d")
wrong_class("at most 80%", lambda s: np.sin(50 * s[..., :1]), "sin(50 * state[0])")
XY = ("state[0]", "state[1]")
for size in (1e-9, 0.05):
    waves = lambda s, size=size: np.concatenate([s, size * np.sin(50 * s[..., :1])], axis=-1)  # noqa: E731
    wrong_class("a feature of", waves, *XY, f"{size} * sin(50 * state[0])")
wrong_class("features of a single state", lambda s: np.atleast_2d(s)[:, :1] ** 2, "state[0] * state[0]")
wrong_class("that gives other numbers than feature", sides, "state[0] - state[1]")
wrong_class("'**' in the code", lambda s: s**3, "state[0] ** 3", "state[1] ** 3")
wrong_class("no functions but", lambda s: s.max(axis=-1, keepdims=True), "fmax(state[0], state[1])")
wrong("2.7", "a PolicyClass")(lambda task: lambda states: states**3)


def trained_by(batch):
    """A class with training of its own."""
    own = type("Own", (PolicyClass,), {"batch": batch})
    return lambda task: own("own", ("d",), ("state[0] - state[1]",), np.ones(1), lambda s: s[..., :1] - s[..., 1:])


wrong("2.7", "a gradient of")(
    trained_by(lambda self, x, weights: (x @ weights, lambda error: 0.5 * x.transpose(0, 2, 1) @ error))
)
wrong("2.7", "an answer that raises an error")(trained_by(lambda self, x, weights: (x @ weights[0, :1], None)))


@right("2.7")
def polar(task):
    def features(s):
        dx, dy = s[..., 0] - 0.5, s[..., 1] - 0.5
        return np.stack([np.hypot(dx, dy), np.arctan2(dy, dx)], axis=-1)

    code = ("hypot(state[0] - 0.5, state[1] - 0.5)", "atan2(state[1] - 0.5, state[0] - 0.5)")
    return class_of(features, code, ("r", "φ"), sizes=np.array([0.8, 3.2]))


@right("2.7")
def squashed(task):
    """Not linear in what it does with the weighted sum, with a gradient of its own."""

    class Squashed(PolicyClass):
        def outputs(self, features, coefficients):
            return np.tanh(super().outputs(features, coefficients))

        def batch(self, inputs, coefficients):
            out = np.tanh(inputs @ coefficients)
            return out, lambda error: inputs.transpose(0, 2, 1) @ (error * (1 - out**2))

    return Squashed("squashed", ("x", "y"), ("state[0]", "state[1]"), np.ones(2), lambda s: s)


# 3.1 reading

READ_3 = {
    "higher median": "the teacher",
    "inside the box": "half",
    "pit episodes": "nowhere",
    "sees the pit": "the mean",
}
wrong("3.1", "that is box and whiskers")(READ_3 | {"inside the box": "nearly all"})
wrong("3.1", "how far down it reaches")(READ_3 | {"pit episodes": "in the lower whisker"})
wrong("3.1", "→ Hint 3")(READ_3 | {"sees the pit": "the median"})
right("3.1")(READ_3)


# 3.2 paired_gap

ERROR = "difference.std(ddof=1) / np.sqrt(len(difference))"
wrongs(
    "3.2",
    ("nothing to do with each other", ERROR, "np.sqrt((ours.var(ddof=1) + theirs.var(ddof=1)) / len(ours))"),
    ("the deviation of single differences", ERROR, "difference.std()"),
    ("the sign turned", "ours - theirs", "theirs - ours"),
    ("half a 95 % interval", ERROR, f"1.96 * {ERROR}"),
    ("the gap and its standard error", f", {ERROR}", ""),
    ("a standard error of", "difference.std(ddof=1)", "np.square(difference).mean() ** 0.5"),
    ("a standard error of", "difference.std(ddof=1)", "np.ptp(np.percentile(difference, [25, 75])) / 1.349"),
    ("a standard error of", "difference.std(ddof=1)", "1.4826 * np.median(np.abs(difference - np.median(difference)))"),
    ("a standard error of", "len(difference)", "(len(ours) + len(theirs))"),
    ("of the standard error", ERROR, f"1.04 * {ERROR}"),
    ("of the standard error", ERROR, f"0.95 * {ERROR}"),
    ("a standard error of", ERROR, "difference.std() / 20"),
    ("a standard error of", "difference.std(ddof=1)", "difference[20:].std()"),
    ("a standard error of", "difference.std(ddof=1)", "difference[:-20].std()"),
)


@right("3.2")
def by_bootstrap(ours, theirs):
    gaps, rng = ours - theirs, np.random.default_rng(0)
    return gaps.mean(), rng.choice(gaps, (4000, len(gaps))).mean(axis=1).std()


# 3.3 interval

MEANS = "returns.mean(axis=1)[rng.integers(p, size=(4000, p))].mean(axis=1)"
LOW_HIGH = "np.percentile(means, [2.5, 97.5])"
wrongs(
    "3.3",
    ("were an independent sample", MEANS, "[rng.choice(returns.ravel(), returns.size).mean() for _ in range(400)]"),
    ("*with* replacement", MEANS, "[rng.permutation(returns).mean() for _ in range(100)]"),
    ("for 90 %", "[2.5, 97.5]", "[5, 95]"),
    ("of a few thousand draws", "4000", "20"),
    ("an interval that is too wide", "[2.5, 97.5]", "[1, 99]"),
    ("aside of the mean", "[2.5, 97.5]", "[1, 96]"),
    ("without the mean", "rng.integers(p,", "rng.integers(p - 1,"),
    ("the range of single policies", MEANS, "returns.mean(axis=1)"),
    ("without the mean", "returns.mean(axis=1)", "np.median(returns, axis=1)"),
    ("the upper end first", "return low, high", "return high, low"),
    ("one standard error", LOW_HIGH, "returns.mean() + np.array([-1, 1]) * returns.mean(axis=1).std() / p**0.5"),
    ("of the width", "[2.5, 97.5]", "[2, 98]"),
    ("of the width", "[2.5, 97.5]", "[3, 97]"),
    ("beside an outlier", LOW_HIGH, "means.mean() + np.array([-2, 2]) * means.std()"),
    ("beside an outlier", LOW_HIGH, "means.mean() + rng.normal(1.96, 0.01) * np.array([-1, 1]) * means.std()"),
    ("", "(4000, p)", "(4000, 30)"),
    ("", "size=(4000, p)", "size=(4000, 28)"),
    ("", "size=(4000, p)", "size=(4000, p - 1)"),
)


@right("3.3")
def corrected_bootstrap(returns, rng):
    return bootstrap((returns.mean(axis=1),), np.mean, rng=rng).confidence_interval


@wrong("3.3", "no policies are resampled")
def normal_theory(returns, rng):
    means = returns.mean(axis=1)
    half = 1.96 * means.std(ddof=1) / np.sqrt(len(means))
    return means.mean() - half, means.mean() + half


# 3.4 blame

ENDS = "np.array([e.states[-1] for e in collect_episodes(policy, task, starts[failed])])"
LAST = "counts[policy.cells(episode.states[-1])] += 1"
wrongs(
    "3.4",
    ("where the teacher fails too", "(theirs == goal) & (ours != goal)", "ours != goal"),
    ("only the episodes that end in the pit", "(ours != goal)", "(ours == tasks.PIT)"),
    ("in other cells", "in collect_episodes(policy", "in collect_episodes(teacher"),
    ("the cell of their start", "episode.states[-1]", "episode.states[0]"),
    ("every step of a failure", LAST, "np.add.at(counts, policy.cells(episode.states), 1)"),
    ("a count per cell", "return counts", "return counts[:-1]"),
    ("shares", "return counts", "return counts / counts.sum()"),
    ("in line", "np.zeros(len(policy), dtype=int)", "np.zeros(5, dtype=int)"),
    ("", "counts = np.zeros(len(policy), dtype=int)", f"return np.bincount(policy.cells({ENDS})); counts = 0"),
    ("", "starts[failed]", "starts[failed[:40]]"),
    ("a call of vsp's `failures`", "(theirs == goal) & (ours != goal)", "FAILURES(policy, teacher, task, starts)"),
)

# 3.5 refit

FIT = "np.linalg.lstsq(inputs[mine], actions[mine], rcond=None)[0]"
SQUARES = "inputs[mine].T @ inputs[mine]"
INVERSE = f"np.linalg.inv({SQUARES}) @ inputs[mine].T @ actions[mine]"
wrongs(
    "3.5",
    ("→ Hint 3", FIT, INVERSE, "np.unique(cells)", "range(len(policy))"),
    ("in a cell without states", "policy.coefficients.copy()", "np.zeros_like(policy.coefficients)"),
    ("the same map in every cell", FIT, "np.linalg.lstsq(inputs, actions, rcond=None)[0]"),
    ("argument 1 altered in place", "policy.coefficients.copy()", "policy.coefficients"),
    ("the least there is", FIT, f"0.99 * {FIT}"),
    ("that misses the actions", FIT, f"np.linalg.solve({SQUARES} + 1e-3 * np.eye(3), inputs[mine].T @ actions[mine])"),
    ("a vsp.VoronoiPolicy", "return vsp", "return coefficients; vsp"),
    ("is not written yet", "cells, coefficients =", "raise NotImplementedError(); cells, coefficients ="),
    ("", "np.unique(cells)", "range(6)"),
    ("the least there is", "np.unique(cells)", "np.unique(cells)[:6]"),
)


RESTORED = "mean = actions.mean(axis=0); actions -= mean; actions += mean"
right("3.5")(first("3.5", RESTORED))
right("3.5")(changed("3.5", FIT, "np.linalg.pinv(inputs[mine]) @ actions[mine]"))


# 3.6 dagger_round

LABELS = "np.concatenate([actions, labels])"
BOTH = f"np.concatenate([states, visited]), {LABELS}"
wrongs(
    "3.6",
    ("the policy's own actions", "teacher.predict", "policy.predict"),
    ("the states that the teacher goes through", "collect_episodes(policy", "collect_episodes(teacher"),
    ("the old states gone", BOTH, "visited, labels"),
    ("in different orders", "[actions, labels]", "[labels, actions]"),
    ("one new state per episode", "episode.states for", "episode.states[:1] for"),
    ("one for each state", LABELS, "actions"),
    ("inhomogeneous", "labels, _ =", "labels ="),
    ("actions that is not made of numbers", "labels, _ =", "labels =", LABELS, "[*actions, *labels]"),
    ("two arrays", f", {LABELS}", ""),
    ("", "task, starts)", "task, starts[:20])"),
)


@right("3.6")
def label_all_again(policy, teacher, task, starts, states, actions):
    everything = np.vstack([*(episode.states for episode in collect_episodes(policy, task, starts)), states])
    return [everything, teacher.predict(everything)[0]]


# 3.7 challenger: policies, made when asked for


wrong("3.7", "a vsp.VoronoiPolicy")(lambda: vsp.load_teacher("SimpleGoal-v0"))
wrong("3.7", "a vsp.VoronoiPolicy alone")(lambda: (baselines.rule_of_thumb("SimpleGoal-v0")[1], None))


@wrong("3.7", "codewords and coefficients that return")
def given_the_teachers_actions():
    policy = baselines.rule_of_thumb("SimpleGoal-v0")[1]
    policy.predict = vsp.load_teacher("SimpleGoal-v0").predict
    return policy


@wrong("3.7", "fewer than 13")
def too_many_cells():
    return vsp.VoronoiPolicy(np.random.default_rng(0).uniform(size=(13, 2)), np.zeros((13, 3, 2)), task="SimpleGoal-v0")


@wrong("3.7", "one for SimpleGoal-v0")
def for_another_task():
    return vsp.VoronoiPolicy([[0, 0]], [[[0], [12], [0]]], task="MountainCarContinuous-v0")


@right("3.7")
def quadratic_maps():
    config = replace(vsp.preset("SimpleGoal-v0"), fit="closed_form", sub_policy="quadratic")
    return vsp.distill(vsp.load_teacher("SimpleGoal-v0"), "SimpleGoal-v0", config, seed=0)[0]


# What somebody wrote who tried to break the checks

ADD, SPLIT = "partition.add(state, rng)", "split(partition, episode, config, rng)"
AT_END, ALIKE = "    return added", "np.abs(coefficients - coefficients[i])"
for exercise, words, *changes in (
    ("1.2", "the least that", LSTSQ, RIDGE.replace("0.1", "0.05")),
    ("1.4", "expected", "states[:, None] - codewords", "np.abs(states)[:, None] - np.abs(codewords)"),
    ("1.5", "a wrong action in", "own =", "states = states.clip(0, 1); own ="),
    ("2.2", "another number", "np.mean(since)", "np.mean(since[-7:])"),
    ("2.3", "other maps in the cells", ADD, "partition.add(state, np.random.default_rng(0))"),
    ("2.3", "other maps in the cells", AT_END, "    partition.models.coefficients[:] = 0\n    return added"),
    ("2.3", "on the other side", "losses = []  # after", "losses = losses[-1:]  # after"),
    ("2.3", "on the other side", "losses = []  # after", "losses = losses[:1]  # after"),
    ("2.3", "ten bad states", "np.mean(losses)", "np.mean(losses[-10:])"),
    ("2.3", "codewords returned", AT_END, "    return added[-2:]"),
    ("2.4", "others equal", f"{ALIKE}.max(axis=1)", f"{ALIKE}[:, [0, 5]].max(axis=1)"),
    ("2.4", "codewords returned", "return removed", "return removed[:3]"),
    ("2.5", "`split` with something else", SPLIT, SPLIT.replace("rng", "type(rng)(type(rng.bit_generator)(0))")),
    ("2.5", "in line", "episodes[0].states[0], rng", "episodes[0].states[0].tolist(), rng"),
    ("2.5", "no `merge`", SPLIT, f"if {SPLIT}: continue"),
    ("2.5", "it is not due then", "config.n_freeze", "2 * config.n_split"),
    ("2.5", "episodes observed", "observe(episode)", "observe(type(episode)(episode.states, 0 * episode.actions))"),
    ("2.5", "a call of vsp's `_algorithm_1`", "partition.add", "LOOP(*locals().values()); partition.add"),
    ("3.3", "aside of the mean", "[2.5, 97.5]", "[3, 98]"),
    ("3.3", "aside of the mean", "[2.5, 97.5]", "[2, 97]"),
):  # fmt: skip
    wrong(exercise, words)(changed(exercise, *changes))


wrong("1.4", "expected")(lambda codewords, states: cKDTree(codewords).query(states, p=1)[1])
wrong("1.4", "a call of vsp's `nearest`")(lambda *given: ThreadPool(1).apply(vsp.nearest, given))
Late, Named = (type(f"Own{kind.__name__}", (kind,), {}) for kind in (vsp.VoronoiPolicy, PolicyClass))
wrong("3.5", "a OwnVoronoiPolicy")(lambda old, *data: Late(old.codewords, old.coefficients, task=old.task))
wrong_class("the features of 'linear'", lambda s: s, *XY, kind=Named)
wrong_class("a feature of", sides, "fabs(state[0] - state[1])", sizes=np.array([30.0]))
wrong_class(
    "in the code", lambda s: np.stack([s[..., 0] / 2, s[..., 1] ** 2], axis=-1), "state[0]*(1/2)", "state[1]*state[1]"
)
wrong_class("expected arithmetic", lambda s: s**3, "state[0]*state[0]*state[0]", "state[-1]*state[1]*state[1]")
right("2.5")(
    changed(
        "2.5",
        "            partition.clear()",
        "            partition.reset(slice(None))\n    return partition.policy()",
    )
)
right("3.6")(lambda *given: np.array(changed("3.6")(*given)))
right("2.7")(lambda task: class_of(lambda s: np.concatenate([s, sides(s)], -1), (*XY, "fabs(state[0] - state[1])")))
