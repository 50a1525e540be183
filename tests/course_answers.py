"""What students write: typical wrong answers with the words that a check must find for them, and other right ones.

`@wrong("1.2", "one row more")` enters an answer to exercise 1.2 in WRONG, `@right("1.2")` in RIGHT; `others` enters
answers that are no functions.
"""

import functools
from dataclasses import replace

import numpy as np
from numpy.linalg import lstsq
from scipy.spatial.distance import cdist

import vsp
from vsp import baselines
from vsp.envs import GOAL, PIT
from vsp.rollouts import play, record
from vsp.subpolicies import Form

WRONG, RIGHT = [], []  # (exercise, words of the message, answer), (exercise, answer)


def wrong(exercise, words):
    return lambda answer: WRONG.append((exercise, words, answer)) or answer


def right(exercise):
    return lambda answer: RIGHT.append((exercise, answer)) or answer


def ones(states):
    return np.column_stack([states, np.ones(len(states))])


# 1.1 reading

READ_1 = {
    "right of the pit": "down-left",
    "beyond the pit": "down-right",
    "at the limit": "more than three quarters",
    "sudden turn": "beyond the pit, seen from the goal",
}
wrong("1.1", "is not answered yet")(READ_1 | {"at the limit": None})
wrong("1.1", "what lies on it")(READ_1 | {"beyond the pit": "down-left"})
wrong("1.1", "question 'at the limit': not 'about half'")(READ_1 | {"at the limit": "about half"})
wrong("1.1", "expected one of")(READ_1 | {"sudden turn": "everywhere"})
wrong("1.1", "→ Hint 3")(READ_1 | {"sudden turn": "between goal and pit"})
right("1.1")(READ_1)


# 1.2 fit_linear


@wrong("1.2", "one row more")
def no_bias(states, actions):
    return lstsq(states, actions, rcond=None)[0]


@wrong("1.2", "the bias in the first row")
def bias_first(states, actions):
    return lstsq(np.column_stack([np.ones(len(states)), states]), actions, rcond=None)[0]


@wrong("1.2", "a row per input, a column per action")
def transposed(states, actions):
    return lstsq(ones(states), actions, rcond=None)[0].T


@wrong("1.2", "4 things")
def all_of_lstsq(states, actions):
    return lstsq(ones(states), actions, rcond=None)


@wrong("1.2", "expected (3, 2)")
def one_action_alone(states, actions):
    return lstsq(ones(states), actions, rcond=None)[0][:, :1]


@wrong("1.2", "the least that a linear map can have")
def too_few_steps(states, actions):
    return by_descent(states, actions, n=20)


@wrong("1.2", "the least that a linear map can have")
def too_much_ridge(states, actions):
    inputs = ones(states)
    return np.linalg.solve(inputs.T @ inputs + np.eye(inputs.shape[1]), inputs.T @ actions)


@wrong("1.2", "None as the result")
def forgot_return(states, actions):
    lstsq(ones(states), actions, rcond=None)


@wrong("1.2", "LinAlgError")
def solves_a_rectangle(states, actions):
    return np.linalg.solve(ones(states), actions)


def notebook_variables():
    """States and actions as the lesson has them beside the arguments."""
    rng = np.random.default_rng(0)
    return rng.uniform(size=(50, 2)), rng.uniform(-1, 1, (50, 2))


@wrong("1.2", "the same result for any `states` and any `actions`")
def of_the_notebook(states, actions):
    states, actions = notebook_variables()
    return lstsq(ones(states), actions, rcond=None)[0]


@wrong("1.2", "the same result for any `states`,")
def inputs_of_nothing(states, actions):
    return lstsq(ones(0 * states), actions, rcond=None)[0]


@right("1.2")
def normal_equations(states, actions):
    inputs = ones(states)
    return np.linalg.solve(inputs.T @ inputs, inputs.T @ actions)


@right("1.2")
def by_descent(states, actions, n=1000):
    inputs, coefficients = ones(states), np.zeros((states.shape[1] + 1, actions.shape[1]))
    for _ in range(n):
        coefficients -= 0.2 * inputs.T @ (inputs @ coefficients - actions) / len(states)
    return coefficients


@right("1.2")
def scikit_learn(states, actions):
    from sklearn.linear_model import LinearRegression

    model = LinearRegression().fit(states, actions)
    return np.vstack([model.coef_.T, model.intercept_])


@right("1.2")
def column_by_column(states, actions):
    return np.array([np.linalg.pinv(ones(states)) @ column for column in actions.T]).T.tolist()


# 1.3 action_error


@wrong("1.3", "a sum over the actions")
def sum_over_actions(policy, teacher, states):
    return np.square(policy.predict(states)[0] - teacher.predict(states)[0]).sum(axis=1).mean()


@wrong("1.3", "a root")
def root(policy, teacher, states):
    return np.sqrt(np.square(policy.predict(states)[0] - teacher.predict(states)[0]).mean())


@wrong("1.3", "absolute values")
def absolute(policy, teacher, states):
    return np.abs(policy.predict(states)[0] - teacher.predict(states)[0]).mean()


@wrong("1.3", "cancel")
def signed(policy, teacher, states):
    return (teacher.predict(states)[0] - policy.predict(states)[0]).mean()


@wrong("1.3", "the square of a mean")
def squared_too_late(policy, teacher, states):
    return (policy.predict(states)[0] - teacher.predict(states)[0]).mean() ** 2


@wrong("1.3", "the first of its two things. → Hint 1")
def with_the_second_thing(policy, teacher, states):
    return np.square(policy.predict(states) - teacher.predict(states)).mean()


@wrong("1.3", "the first of its two things")
def one_of_them_with_the_second_thing(policy, teacher, states):
    return np.square(policy.predict(states)[0] - np.array(teacher.predict(states))).mean()


@wrong("1.3", "TypeError")
def with_a_wrong_call(policy, teacher, states):
    return np.square(policy.predict(states)[0] - teacher.predict()[0]).mean()


@wrong("1.3", "the same result for any `policy`,")
def of_another_policy(policy, teacher, states):
    return np.square(np.ones_like(teacher.predict(states)[0]) - teacher.predict(states)[0]).mean()


@wrong("1.3", "the same result for any `policy` and any `teacher` and any `states`")
def typed_in(policy, teacher, states):
    return 0.137


@wrong("1.3", "one number for all states")
def per_state(policy, teacher, states):
    return np.square(policy.predict(states)[0] - teacher.predict(states)[0]).mean(axis=1)


@right("1.3")
def in_a_loop(policy, teacher, states):
    total, n = 0.0, 0
    for state in states:
        for a, b in zip(policy.predict(state[None])[0][0], teacher.predict(state[None])[0][0]):
            total, n = total + (a - b) ** 2, n + 1
    return total / n


@right("1.3")
def as_an_array(policy, teacher, states):
    (a, _), (b, _) = policy.predict(states), teacher.predict(states)
    return np.array([((a - b) ** 2).mean(axis=0).mean()])


# 1.4 nearest


@wrong("1.4", "the cells of the Euclidean distance")
def euclidean(codewords, states):
    return np.linalg.norm(states[:, None] - codewords, axis=2).argmin(axis=1)


@wrong("1.4", "along one axis")
def largest_axis(codewords, states):
    return np.abs(states[:, None] - codewords).max(axis=2).argmin(axis=1)


@wrong("1.4", "differences that cancel")
def no_abs(codewords, states):
    return (states[:, None] - codewords).sum(axis=2).argmin(axis=1)


@wrong("1.4", "the first two inputs alone")
def in_the_plane(codewords, states):
    return cdist(states[:, :2], codewords[:, :2], "cityblock").argmin(axis=1)


@wrong("1.4", "differences that cancel")
def abs_too_late(codewords, states):
    return np.abs((states[:, None] - codewords).sum(axis=2)).argmin(axis=1)


@wrong("1.4", "the later of two codewords")
def last_of_equals(codewords, states):
    found = []
    for state in states:
        best, place = np.inf, 0
        for i, codeword in enumerate(codewords):
            if np.abs(state - codeword).sum() <= best:
                best, place = np.abs(state - codeword).sum(), i
        found.append(place)
    return np.array(found)


@wrong("1.4", "coordinates")
def the_codewords_themselves(codewords, states):
    return codewords[cdist(states, codewords, "cityblock").argmin(axis=1)]


@wrong("1.4", "not distances")
def the_distances(codewords, states):
    return cdist(states, codewords, "cityblock").min(axis=1)


@wrong("1.4", "begin at 1")
def counted_from_one(codewords, states):
    return cdist(states, codewords, "cityblock").argmin(axis=1) + 1


@wrong("1.4", "farthest")
def farthest(codewords, states):
    return cdist(states, codewords, "cityblock").argmax(axis=1)


@right("1.4")
def by_scipy(codewords, states):
    return cdist(states, codewords, "cityblock").argmin(axis=1)


@right("1.4")
def by_min(codewords, states):
    return [min(range(len(codewords)), key=lambda i: sum(abs(s - codewords[i]))) for s in states]


# 1.5 act


def raw(codewords, coefficients, states):
    own = coefficients[by_scipy(codewords, states)]
    return np.einsum("nd,ndm->nm", states, own[:, :-1]) + own[:, -1]


@wrong("1.5", "beyond the limits")
def without_limits(codewords, coefficients, states):
    return raw(codewords, coefficients, states)


@wrong("1.5", "limits on both sides")
def limits_from_zero(codewords, coefficients, states):
    return raw(codewords, coefficients, states).clip(0, 1)


@wrong("1.5", "one limit only")
def upper_limit_only(codewords, coefficients, states):
    return np.minimum(raw(codewords, coefficients, states), 1)


@wrong("1.5", "without their bias")
def weights_only(codewords, coefficients, states):
    own = coefficients[by_scipy(codewords, states)]
    return np.einsum("nd,ndm->nm", states, own[:, :-1]).clip(-1, 1)


@wrong("1.5", "one map for all states")
def first_map_only(codewords, coefficients, states):
    return np.clip(states @ coefficients[0, :-1] + coefficients[0, -1], -1, 1)


@wrong("1.5", "after the limits")
def bias_after_limits(codewords, coefficients, states):
    own = coefficients[by_scipy(codewords, states)]
    return np.einsum("nd,ndm->nm", states, own[:, :-1]).clip(-1, 1) + own[:, -1]


@right("1.5")
def cell_by_cell(codewords, coefficients, states):
    cells, actions = by_scipy(codewords, states), np.zeros((len(states), coefficients.shape[2]))
    for i, own in enumerate(coefficients):
        actions[cells == i] = ones(states[cells == i]) @ own
    return np.minimum(np.maximum(actions, -1), 1)


@right("1.5")
def state_by_state(codewords, coefficients, states):
    return [
        [max(-1, min(1, float(np.append(s, 1) @ column))) for column in coefficients[i].T]
        for s, i in zip(states, by_min(codewords, states))
    ]


# 1.6 codewords

wrong("1.6", "is not written yet")(np.array([[0.3, 0.3], [0.7, 0.6]]))
wrong("1.6", "expected at most 8")(np.random.default_rng(0).uniform(size=(9, 2)))
wrong("1.6", "a row x, y per codeword")(np.zeros((0, 2)))
wrong("1.6", "at most 50%")(np.array([[0.9, 0.7], [0.9, 0.8], [0.9, 0.9]]))
wrong("1.6", "→ Hint 2")([[0.6, 0.7], [0.7, 0.6], [0.7, 0.85], [0.85, 0.7], [0.8, 0.95], [0.95, 0.8], [0.3, 0.3]])
wrong("1.6", "there twice")(np.array([[0.5, 0.5], [0.5, 0.5]]))
wrong("1.6", "outside the unit square")(np.array([[0.5, 0.5], [5, 0.5]]))
wrong("1.6", "a row x, y per codeword")(np.array([0.1, 0.2, 0.3]))
right("1.6")(np.array([[0.04, 0.15], [0.14, 0.05], [0.3, 0.5], [0.5, 0.3], [0.65, 0.85], [0.85, 0.65]]))
right("1.6")([[x, y] for x in (0.25, 0.75) for y in (0.12, 0.37, 0.62, 0.87)])
right("1.6")([[0.05, 0.2], [0.2, 0.05], [0.2, 0.6], [0.6, 0.2], [0.6, 0.8], [0.8, 0.6]])


# 1.7 place


def leftover(points, states, actions):
    cells, total = by_scipy(points, states), 0.0
    for cell in np.unique(cells):
        own = ones(states[cells == cell])
        goal = actions[cells == cell]
        total += np.square(own @ lstsq(own, goal, rcond=None)[0] - goal).sum()
    return total


@wrong("1.7", "expected (8, 2)")
def too_few(states, actions, k):
    return states[: k - 1]


@wrong("1.7", "of random codewords on SimpleGoal-v0")
def the_first_ones(states, actions, k):
    return np.unique(states, axis=0)[:k]


@wrong("1.7", "→ Hint 2")
def chase_the_worst(states, actions, k):
    points = states[:1]
    while len(points) < k:
        error = np.zeros(len(states))
        cells = by_scipy(points, states)
        for cell in np.unique(cells):
            own, goal = ones(states[cells == cell]), actions[cells == cell]
            error[cells == cell] = np.square(own @ lstsq(own, goal, rcond=None)[0] - goal).mean(axis=1)
        error[cdist(states, points).min(axis=1) == 0] = -1
        points = np.vstack([points, states[error.argmax()]])
    return points


@wrong("1.7", "of random codewords on")
def clusters_of_states(states, actions, k):
    from sklearn.cluster import KMeans

    return KMeans(k, n_init=1, random_state=0).fit(states).cluster_centers_


@wrong("1.7", "→ Hint 2")
def unlucky_clusters_of_states_and_actions(states, actions, k):
    from scipy.cluster.vq import kmeans2

    return kmeans2(np.column_stack([states, actions]), k, minit="++", seed=0)[0][:, : states.shape[1]]


@wrong("1.7", "→ Hint 3")
def leaves_of_a_tree(states, actions, k):
    from sklearn.tree import DecisionTreeRegressor

    leaves = DecisionTreeRegressor(max_leaf_nodes=k, random_state=0).fit(states, actions).apply(states)
    return np.array([states[leaves == leaf].mean(axis=0) for leaf in np.unique(leaves)])


@wrong("1.7", "there twice")
def the_same_again(states, actions, k):
    return np.tile(states.mean(axis=0), (k, 1))


@right("1.7")
def greedy(states, actions, k):
    rng, points = np.random.default_rng(5), states[:1]
    while len(points) < k:
        tries = [np.vstack([points, s]) for s in rng.permutation(np.unique(states, axis=0))[:25] if s not in points]
        points = min(tries, key=lambda p: leftover(p, states, actions))
    return points


@right("1.7")
def best_of_many(states, actions, k):
    rng = np.random.default_rng(11)
    draws = (rng.choice(np.unique(states, axis=0), k, replace=False) for _ in range(80))
    return min(draws, key=lambda p: leftover(p, states, actions))


@right("1.7")
def clusters_of_states_and_actions(states, actions, k):
    from sklearn.cluster import KMeans

    both = np.column_stack([states, actions])
    return KMeans(k, n_init=1, random_state=8).fit(both).cluster_centers_[:, : states.shape[1]]


@right("1.7")
def best_of_twenty(states, actions, k):
    rng, candidates = np.random.default_rng(1), np.unique(states, axis=0)
    draws = [rng.choice(candidates, k, replace=False) for _ in range(20)]
    return min(draws, key=lambda p: leftover(p, states, actions))


@right("1.7")
def exchanged_one_by_one(states, actions, k):
    rng, candidates = np.random.default_rng(0), np.unique(states, axis=0)
    points = rng.choice(candidates, k, replace=False)
    for state in rng.permutation(candidates)[:80]:
        tried = points.copy()
        tried[rng.integers(k)] = state
        new = len(np.unique(tried, axis=0)) == k
        points = tried if new and leftover(tried, states, actions) < leftover(points, states, actions) else points
    return points


# 2.1 reading

READ_2 = {
    "last change": 3540,
    "half of the cells": "before iteration 500",
    "fewer cells by": "a merge",
    "loss jumps by": "a split",
}
wrong("2.1", "is not answered yet")(dict.fromkeys(READ_2))
wrong("2.1", "still changes after it")(READ_2 | {"last change": 1000})
wrong("2.1", "nothing changes there")(READ_2 | {"last change": 4900})
wrong("2.1", "where the freeze begins")(READ_2 | {"last change": 4000})
wrong("2.1", "a split adds a codeword")(READ_2 | {"fewer cells by": "a split"})
wrong("2.1", "keeps a map that is trained already")(READ_2 | {"loss jumps by": "a merge"})
wrong("2.1", "the large jumps are another matter")(READ_2 | {"loss jumps by": "a reset of the buffers"})
wrong("2.1", "expected a number")(READ_2 | {"last change": "3540"})
right("2.1")(READ_2 | {"last change": 3700.0})


# 2.2 running_mean


@wrong("2.2", "since the episode began")
def never_forgets(cells, losses):
    return np.cumsum(losses) / np.arange(1, len(losses) + 1)


@wrong("2.2", "earlier visit")
def a_mean_per_cell(cells, losses):
    return np.array([losses[: t + 1][cells[: t + 1] == cells[t]].mean() for t in range(len(losses))])


@wrong("2.2", "sums")
def forgot_to_divide(cells, losses):
    sums = []
    for t, loss in enumerate(losses):
        sums.append(loss + (sums[-1] if t and cells[t] == cells[t - 1] else 0))
    return np.array(sums)


@wrong("2.2", "the losses themselves")
def no_mean(cells, losses):
    return losses


@wrong("2.2", "remembered in every step?). → Hint 2")
def previous_is_none_for_ever(cells, losses):
    previous, since, means = None, [], []
    for cell, loss in zip(cells, losses):
        if cell != previous:
            since = []
        since.append(loss)
        means.append(np.mean(since))
    return means


@wrong("2.2", "outside the first cell")
def previous_is_the_first_for_ever(cells, losses):
    previous, since, means = cells[0], [], []
    for cell, loss in zip(cells, losses):
        if cell != previous:
            since = []
        since.append(loss)
        means.append(np.mean(since))
    return means


@wrong("2.2", "losses of later steps")
def mean_of_the_visit(cells, losses):
    visit = np.cumsum(np.r_[True, cells[1:] != cells[:-1]])
    return np.array([losses[visit == v].mean() for v in visit])


@right("2.2")
def by_sum_and_count(cells, losses):
    means, total, n = [], 0.0, 0
    for t in range(len(cells)):
        if t > 0 and cells[t] != cells[t - 1]:
            total, n = 0.0, 0
        total, n = total + losses[t], n + 1
        means.append(total / n)
    return means


@right("2.2")
def by_pandas(cells, losses):
    import pandas as pd

    cells, losses = pd.Series(cells), pd.Series(losses)
    return losses.groupby((cells != cells.shift()).cumsum()).expanding().mean().to_numpy()


# 2.3 split_regions


def split_pass(
    partition,
    episode,
    config,
    rng,
    *,
    value=np.mean,
    forget=True,
    remember=True,
    refresh=True,
    far=True,
    loss=True,
    empty="both",
    most=99,
    again=True,
    whose=lambda i: i,
    metric="cityblock",
):
    """Algorithm 2 with one thing wrong, as the options say."""
    previous, losses, added = None, [], []
    locate = partition.locate if refresh else partition.snapshot()
    for state, action in zip(episode.states, episode.actions):
        i = locate(state)
        if i != previous:
            previous, losses = i if remember else previous, [] if forget else losses
        losses.append(partition.loss(whose(i), state, action))
        gap = cdist([state], partition.codewords[[i]], metric)[0, 0]
        apart = gap > config.min_pol_distance or (not far and not (partition.codewords == state).all(axis=1).any())
        if (value(losses) > config.max_pol_loss or not loss) and apart:
            near = partition.neighbours()[i]
            near[i] = empty != "neighbours"
            near |= empty == "all"
            partition.add(state, rng)
            partition.reset(np.append(near & (empty != "none"), False))
            added.append(state)
            losses = [] if again else losses
            if len(added) == most:
                break
    return added


def splits(**options):
    return functools.partial(split_pass, **options)


wrong("2.3", "not the last one. → Hint 3")(splits(value=lambda losses: losses[-1]))
wrong("2.3", "not the last one. → Hint 3")(splits(remember=False))
wrong("2.3", "not the largest loss. → Hint 2")(splits(value=max))
wrong("2.3", "not their sum. → Hint 2")(splits(value=sum))
wrong("2.3", "not the last ones")(splits(value=lambda losses: np.mean(losses[-3:])))
wrong("2.3", "not the last ones")(splits(value=np.median))
wrong("2.3", "the mean begins anew")(splits(forget=False))
wrong("2.3", "a codeword that came a moment ago")(splits(refresh=False))
wrong("2.3", "no state far from its codeword")(splits(far=False))
wrong("2.3", "a copy without any error")(splits(loss=False))
wrong("2.3", "go on after a split")(splits(most=1))
wrong("2.3", "all buffers empty")(splits(empty="all"))
wrong("2.3", "full buffers beside a new cell")(splits(empty="none"))
wrong("2.3", "which has just lost states")(splits(empty="neighbours"))


wrong("2.3", "ask for the loss of its own")(splits(whose=lambda i: 0))
wrong("2.3", "by `partition.loss` and `partition.far`")(splits(metric="euclidean"))


@wrong("2.3", "0 codewords returned")
def forgets_to_tell(partition, episode, config, rng):
    split_pass(partition, episode, config, rng)
    return []


@wrong("2.3", "not their indices")
def tells_indices(partition, episode, config, rng):
    k = len(partition.codewords)
    split_pass(partition, episode, config, rng)
    return list(range(k, len(partition.codewords)))


@wrong("2.3", "other codewords returned")
def tells_those_that_were_there(partition, episode, config, rng):
    before = partition.codewords
    return [before[0]] * len(split_pass(partition, episode, config, rng))


@wrong("2.3", "→ Hint 1")
def never_decides(partition, episode, config, rng):
    for state, action in zip(episode.states, episode.actions):
        i = partition.locate(state)
        losses = [partition.loss(i, state, action)]
        if split:  # noqa: F821
            return losses


@wrong("2.3", "→ Hint 5")
def mask_too_short(partition, episode, config, rng):
    added = []
    for state, action in zip(episode.states, episode.actions):
        i = partition.locate(state)
        if partition.loss(i, state, action) > config.max_pol_loss and partition.far(i, state):
            near = partition.neighbours()[i]
            added.append(partition.add(state, rng))
            partition.reset(near)
    return added


right("2.3")(splits(again=False))  # the paper does not say whether the mean begins anew after a split


@right("2.3")
def with_sums(partition, episode, config, rng):
    cell, total, n, added = -1, 0.0, 0, []
    for t in range(len(episode.states)):
        state = episode.states[t]
        now = int(np.abs(partition.codewords - state).sum(axis=1).argmin())
        if now != cell:
            cell, total, n = now, 0.0, 0
        total, n = total + partition.loss(cell, state, episode.actions[t]), n + 1
        if total / n <= config.max_pol_loss or not partition.far(cell, state):
            continue
        empty = [*np.flatnonzero(partition.neighbours()[cell]), cell]
        partition.add(state, rng)
        partition.reset(np.isin(np.arange(len(partition.codewords)), empty))
        added += [state]
        cell = -1
    return np.array(added)


# 2.4 merge_regions


def merge_pass(
    partition,
    config,
    *,
    measure=lambda d: np.abs(d).max(axis=1),
    neighbours=True,
    empty="both",
    keep_first=True,
    once=False,
    above=False,
    step_back=True,
):
    """Algorithm 3 with one thing wrong, as the options say."""
    removed, i = [], 0
    while i < len(partition.codewords):
        parameters = partition.comparable_parameters()
        near = partition.neighbours()[i] if neighbours else np.arange(len(parameters)) != i
        apart = measure(parameters - parameters[i])
        alike = near & ((apart >= config.min_param_distance) if above else (apart < config.min_param_distance))
        if alike.any():
            if not keep_first:
                alike = np.arange(len(alike)) == i
            near &= empty != "survivor"
            near[i] = empty != "neighbours"
            partition.reset(near & (empty != "none") | (empty == "all"))
            removed += list(partition.codewords[alike])
            partition.keep(~alike)
            i -= alike[:i].sum() * step_back
            if once:
                return removed
        i += 1
    return removed


def merges(**options):
    return functools.partial(merge_pass, **options)


wrong("2.4", "six parameters that each differ")(merges(measure=lambda d: np.sqrt(np.square(d).sum(axis=1))))
wrong("2.4", "one parameter that differs")(merges(measure=lambda d: np.abs(d).mean(axis=1)))
wrong("2.4", "its size counts, not its sign")(merges(measure=lambda d: d.max(axis=1)))
wrong("2.4", "cells that are not neighbours")(merges(neighbours=False))
wrong("2.4", "whose turn comes first stays")(merges(keep_first=False))
wrong("2.4", "one goes, one stays")(merges(above=True))
wrong("2.4", "all buffers as they were")(merges(empty="none"))
wrong("2.4", "the survivor's buffer")(merges(empty="neighbours"))
wrong("2.4", "beside the cell that is gone")(merges(empty="survivor"))
wrong("2.4", "every cell that is left has its turn")(merges(step_back=False))
wrong("2.4", "expected [0] or [1], in a case of two equal cells")(merges(above=True))
wrong("2.4", "all buffers emptied")(merges(empty="all"))


@wrong("2.4", "one goes, one stays")
def remove_each_other(partition, config):
    parameters, graph = partition.comparable_parameters(), partition.neighbours()
    apart = np.abs(parameters[:, None] - parameters).max(axis=2)
    alike = (graph & (apart < config.min_param_distance)).any(axis=1)
    removed = list(partition.codewords[alike])
    partition.keep(~alike)
    return removed


@wrong("2.4", "what is gone removes no one")
def the_gone_take_their_turn(partition, config):
    parameters, graph = partition.comparable_parameters(), partition.neighbours()
    alive = np.ones(len(parameters), dtype=bool)
    for i in range(len(parameters)):
        apart = np.abs(parameters - parameters[i]).max(axis=1)
        alike = graph[i] & (apart < config.min_param_distance)
        alike[:i] = False
        alive &= ~alike
        partition.reset(graph[i] & alike.any())
    removed = list(partition.codewords[~alive])
    partition.keep(alive)
    return removed


@wrong("2.4", "→ Hint 5")
def empties_too_late(partition, config):
    removed, i = [], 0
    while i < len(partition.codewords):
        parameters, near = partition.comparable_parameters(), partition.neighbours()[i]
        alike = near & (np.abs(parameters - parameters[i]).max(axis=1) < config.min_param_distance)
        removed += list(partition.codewords[alike])
        partition.keep(~alike)
        partition.reset(near)
        i += 1
    return removed


@wrong("2.4", "not their indices")
def tells_who_went(partition, config):
    before = partition.codewords.tolist()
    return [before.index(codeword.tolist()) for codeword in merge_pass(partition, config)]


@wrong("2.4", "→ Hint 2")
def stale_indices(partition, config):
    removed = []
    for i in range(len(partition.codewords)):
        parameters = partition.comparable_parameters()
        apart = np.abs(parameters - parameters[i]).max(axis=1)
        alike = partition.neighbours()[i] & (apart < config.min_param_distance)
        removed += list(partition.codewords[alike])
        partition.keep(~alike)
    return removed


@wrong("2.4", "→ Hint 2")
def for_ever(partition, config):
    i = 0
    while i < len(partition.codewords):
        near = partition.neighbours()[i]
        if not near.any():
            i += 1
    return []


@wrong("2.4", "nothing is averaged")
def average(partition, config):
    before = partition.models.parameters.copy()
    removed = merge_pass(partition, config)
    if len(removed) and len(before) > 6:
        partition.models.parameters[:] += 0.1
    return removed


@right("2.4")
def as_vsp(partition, config):
    from vsp.distill import merge_regions

    return merge_regions(partition, config)


@right("2.4")
def with_a_mask(partition, config):
    parameters, graph, k = partition.comparable_parameters(), partition.neighbours(), len(partition.codewords)
    alive = [True] * k
    for i in range(k):
        twins = [j for j in range(k) if alive[i] and alive[j] and graph[i, j]]
        twins = [j for j in twins if max(abs(parameters[i] - parameters[j])) < config.min_param_distance]
        for j in twins:
            alive[j] = False
        if twins:
            partition.reset(graph[i] | (np.arange(k) == i))
    removed = partition.codewords[~np.array(alive)]
    partition.keep(np.array(alive))
    return removed


# 2.5 algorithm_1


def frame(
    partition,
    episodes,
    config,
    rng,
    split,
    merge,
    *,
    zero=False,
    freeze=0,
    reset="always",
    first=True,
    order="split",
    train=True,
    late=False,
    over=lambda episode, episodes: episode,
):
    """Algorithm 1 with one thing wrong, as the options say."""
    for n, episode in enumerate(episodes):
        if n == 0:
            partition.add(episode.states[0 if first else -1], rng)
        partition.observe(episode)
        for _ in range(int(train)):
            partition.train(rng)
        if (n or zero) and n < config.n_epochs - config.n_freeze + freeze:
            passes = [
                (n % config.n_split == 0, "split", lambda: split(partition, over(episode, episodes), config, rng))
            ]
            passes.append((n % config.n_merge == 0, "merge", lambda: merge(partition, config)))
            for due, name, action in passes if order == "split" else passes[::-1]:
                if due and not (name == "merge" and late and n % config.n_split):
                    action()
        if n and n % config.n_reset == 0 and (reset == "always" or reset == "thawed" and n < 5):
            partition.clear()


def frames(**options):
    return functools.partial(frame, **options)


wrong("2.5", "tells nothing yet")(frames(zero=True))
wrong("2.5", "the freeze begins at")(frames(freeze=1))
wrong("2.5", "no `split`")(frames(freeze=-4))
wrong("2.5", "the freeze begins at")(frames(freeze=99))
wrong("2.5", "no `clear`")(frames(reset="never"))
wrong("2.5", "no `clear`")(frames(reset="thawed"))
wrong("2.5", "the first state of the first episode")(frames(first=False))
wrong("2.5", "splits first")(frames(order="merge"))
wrong("2.5", "one training step")(frames(train=False))
wrong("2.5", "no `merge`")(frames(late=True))


wrong("2.5", "the freeze begins at")(frames(freeze=-1))
wrong("2.5", "something else")(frames(over=lambda episode, episodes: episodes[0]))
wrong("2.5", "something else")(frames(over=lambda episode, episodes: episodes))


@wrong("2.5", "no episode observed")
def empty_frame(partition, episodes, config, rng, split, merge):
    return partition


@right("2.5")
def with_next(partition, episodes, config, rng, split, merge):
    episodes, thawed = iter(episodes), config.n_epochs - config.n_freeze
    for n in range(config.n_epochs):
        episode = next(episodes)
        if not len(partition.codewords):
            partition.add(episode.states[0], rng)
        partition.observe(episode)
        partition.train(rng)
        if n > 0 and n < thawed and not n % config.n_split:
            split(partition, episode, config, rng)
        if n > 0 and n < thawed and not n % config.n_merge:
            merge(partition, config)
        if n % config.n_reset == 0:  # also at n = 0, where it does no harm
            partition.clear()
    return partition


@right("2.5")
def by_name(partition, episodes, config, rng, split, merge):
    frame(
        partition,
        episodes,
        config,
        rng,
        lambda p, e, c, r: split(partition=p, episode=e, config=c, rng=r),
        lambda p, c: merge(p, config=c),
    )
    return partition.codewords


@right("2.5")
def due_lists(partition, episodes, config, rng, split, merge):
    thawed = range(1, config.n_epochs - config.n_freeze)
    splitting = {n for n in thawed if n % config.n_split == 0}
    merging = {n for n in thawed if n % config.n_merge == 0}
    partition.add(episodes[0].states[0], rng)
    for n in range(len(episodes)):
        partition.observe(episodes[n])
        partition.train(rng)
        _ = split(partition, episodes[n], config, rng) if n in splitting else None
        _ = merge(partition, config) if n in merging else None
        _ = partition.clear() if n and n % config.n_reset == 0 else None


# 2.6 prediction

PREDICTION = {
    "a lower distance": "more cells",
    "a higher loss": "as many",
    "easier merges": "fewer cells",
    "exact maps": "fewer cells",
}
wrong("2.6", "is not answered yet")(PREDICTION | {"exact maps": None})
wrong("2.6", "the runs disagree with you on ['a higher loss']")(PREDICTION | {"a higher loss": "fewer cells"})
wrong("2.6", "['a lower distance', 'easier merges']")(
    PREDICTION | {"a lower distance": "fewer cells", "easier merges": "more cells"}
)
wrong("2.6", "expected one of")(PREDICTION | {"easier merges": "less"})
right("2.6")(PREDICTION)


# 2.7 my_form


def form_of(features, code, terms=None, name="mine", sizes=None):
    terms = terms or tuple(f"f{i}" for i in range(len(code)))
    return Form(name, terms, code, np.ones(len(terms)) if sizes is None else sizes, features)


@wrong("2.7", "the features of 'linear'")
def linear_again(task):
    return form_of(lambda s: 2 * s[..., ::-1], ("2 * state[1]", "2 * state[0]"))


@wrong("2.7", "sums of the state's components")
def less_than_linear(task):
    return form_of(lambda s: s[..., 1:], ("state[1]",))


@wrong("2.7", "a string for `code`")
def no_comma_after_the_code(task):
    return form_of(lambda s: np.abs(s[..., :1] - s[..., 1:]), ("fabs(state[0] - state[1])"), ("d",))


@wrong("2.7", "a string for `terms`")
def no_comma_after_the_term(task):
    return form_of(lambda s: np.abs(s[..., :1] - s[..., 1:]), ("fabs(state[0] - state[1])",), ("d"))


@wrong("2.7", "at most 80%")
def chance(task):
    return form_of(lambda s: np.sin(50 * s[..., :1]), ("sin(50 * state[0])",))


@wrong("2.7", "features of a single state")
def batches_only(task):
    return form_of(lambda s: np.column_stack([np.hypot(*np.atleast_2d(s).T)]), ("hypot(state[0], state[1])",))


@wrong("2.7", "that gives other numbers than feature")
def code_out_of_step(task):
    return form_of(lambda s: np.abs(s[..., :1] - s[..., 1:]), ("state[0] - state[1]",))


@wrong("2.7", "in the code")
def code_that_does_not_run(task):
    return form_of(lambda s: s[..., :1] ** 2, ("x ** 2",))


@wrong("2.7", "'**' in the code")
def power_that_c_lacks(task):
    return form_of(lambda s: s**3, ("state[0] ** 3", "state[1] ** 3"))


@wrong("2.7", "no functions but")
def function_that_python_lacks(task):
    return form_of(lambda s: s.max(axis=-1, keepdims=True), ("fmax(state[0], state[1])",))


@wrong("2.7", "a gradient of")
def wrong_gradient(task):
    class Half(Form):
        def batch(self, inputs, parameters):
            return inputs @ parameters, lambda error: 0.5 * inputs.transpose(0, 2, 1) @ error

    return Half("half", ("d",), ("state[0] - state[1]",), np.ones(1), lambda s: s[..., :1] - s[..., 1:])


@wrong("2.7", "cannot be read")
def training_that_stops(task):
    class Broken(Form):
        def batch(self, inputs, parameters):
            return inputs @ parameters[0, :1], None

    return Broken("broken", ("d",), ("state[0] - state[1]",), np.ones(1), lambda s: s[..., :1] - s[..., 1:])


@wrong("2.7", "of the error that constants have")
def nothing_in_it(task):
    return form_of(lambda s: 1e-9 * np.sin(40 * s[..., :1]), ("1e-9 * sin(40 * state[0])",))


@wrong("2.7", "a Form")
def only_features(task):
    return lambda states: states**3


@right("2.7")
def polar(task):
    def features(s):
        dx, dy = s[..., 0] - 0.5, s[..., 1] - 0.5
        return np.stack([np.hypot(dx, dy), np.arctan2(dy, dx)], axis=-1)

    code = ("hypot(state[0] - 0.5, state[1] - 0.5)", "atan2(state[1] - 0.5, state[0] - 0.5)")
    return form_of(features, code, ("r", "φ"), sizes=np.array([0.8, 3.2]))


@right("2.7")
def bumps(task):
    centres = [(0.2, 0.2), (0.7, 0.7), (0.3, 0.8), (0.8, 0.3)]

    def features(s):
        return np.stack([np.exp(-10 * ((s[..., 0] - x) ** 2 + (s[..., 1] - y) ** 2)) for x, y in centres], axis=-1)

    def square(i, c):
        return f"(state[{i}] - {c}) * (state[{i}] - {c})"

    return form_of(features, tuple(f"exp(-10 * ({square(0, x)} + {square(1, y)}))" for x, y in centres))


@right("2.7")
def distance_to_the_diagonal(task):
    return form_of(lambda s: np.abs(s[..., :1] - s[..., 1:]), ("fabs(state[0] - state[1])",), ("|x - y|",))


@right("2.7")
def linear_and_the_distance_to_the_pit(task):
    def features(s):
        return np.concatenate([s, np.hypot(s[..., :1] - 0.5, s[..., 1:] - 0.5)], axis=-1)

    return form_of(features, ("state[0]", "state[1]", "hypot(state[0] - 0.5, state[1] - 0.5)"))


@right("2.7")
def squashed(task):
    """Not linear in what it does with the weighted sum, with a gradient of its own."""

    class Squashed(Form):
        def outputs(self, features, parameters):
            return np.tanh(super().outputs(features, parameters))

        def batch(self, inputs, parameters):
            out = np.tanh(inputs @ parameters)
            return out, lambda error: inputs.transpose(0, 2, 1) @ (error * (1 - out**2))

    return Squashed("squashed", ("x", "y"), ("state[0]", "state[1]"), np.ones(2), lambda s: s)


# 3.1 reading

READ_3 = {
    "higher median": "the teacher",
    "inside the box": "half",
    "pit episodes": "nowhere",
    "sees the pit": "the mean",
}
wrong("3.1", "is not answered yet")({})
wrong("3.1", "that is box and whiskers")(READ_3 | {"inside the box": "nearly all"})
wrong("3.1", "how far down it reaches")(READ_3 | {"pit episodes": "in the lower whisker"})
wrong("3.1", "→ Hint 3")(READ_3 | {"sees the pit": "the median"})
right("3.1")(READ_3)


# 3.2 paired_gap


@wrong("3.2", "nothing to do with each other")
def unpaired(ours, theirs):
    n = len(ours)
    return ours.mean() - theirs.mean(), np.sqrt(ours.var(ddof=1) / n + theirs.var(ddof=1) / n)


@wrong("3.2", "the deviation of single differences")
def not_of_the_mean(ours, theirs):
    return (ours - theirs).mean(), (ours - theirs).std()


@wrong("3.2", "the sign turned")
def turned(ours, theirs):
    return (theirs - ours).mean(), (theirs - ours).std() / np.sqrt(len(ours))


@wrong("3.2", "half a 95 % interval")
def half_interval(ours, theirs):
    return (ours - theirs).mean(), 1.96 * (ours - theirs).std() / np.sqrt(len(ours))


@wrong("3.2", "the gap and its standard error")
def gap_only(ours, theirs):
    return (ours - theirs).mean()


@right("3.2")
def by_scipy_sem(ours, theirs):
    from scipy.stats import sem

    return np.array([np.mean(ours) - np.mean(theirs), sem(ours - theirs)])


@right("3.2")
def by_covariance(ours, theirs):
    c, n = np.cov(ours, theirs, ddof=0), len(ours)
    return sum(ours) / n - sum(theirs) / n, ((c[0, 0] + c[1, 1] - 2 * c[0, 1]) / n) ** 0.5


@right("3.2")
def by_bootstrap(ours, theirs):
    gaps, rng = ours - theirs, np.random.default_rng(0)
    return gaps.mean(), rng.choice(gaps, (4000, len(gaps))).mean(axis=1).std()


# 3.3 interval


def middle(means, tail=2.5):
    return np.percentile(means, [tail, 100 - tail])


@wrong("3.3", "every episode were a witness")
def resample_episodes(returns, rng):
    flat = returns.ravel()
    return middle([rng.choice(flat, flat.size).mean() for _ in range(400)])


@wrong("3.3", "*with* replacement")
def no_replacement(returns, rng):
    return middle([rng.permutation(returns).mean() for _ in range(100)])


@wrong("3.3", "for 90 %")
def ninety(returns, rng):
    p = len(returns)
    return middle(returns.mean(axis=1)[rng.integers(p, size=(8000, p))].mean(axis=1), 5)


@wrong("3.3", "too few resamples")
def a_hundred_resamples(returns, rng):
    p = len(returns)
    return middle(returns.mean(axis=1)[rng.integers(p, size=(100, p))].mean(axis=1))


@wrong("3.3", "too few resamples")
def few_and_always_the_same(returns, rng):
    return a_hundred_resamples(returns, np.random.default_rng(1))


@wrong("3.3", "the range of single policies")
def range_of_policies(returns, rng):
    return middle(returns.mean(axis=1))


@wrong("3.3", "without the mean")
def medians(returns, rng):
    p = len(returns)
    return middle(np.median(returns, axis=1)[rng.integers(p, size=(4000, p))].mean(axis=1))


@wrong("3.3", "the upper end first")
def upside_down(returns, rng):
    p = len(returns)
    return middle(returns.mean(axis=1)[rng.integers(p, size=(4000, p))].mean(axis=1))[::-1]


@wrong("3.3", "one standard error")
def plus_minus_one(returns, rng):
    means = returns.mean(axis=1)
    half = means.std() / np.sqrt(len(means))
    return means.mean() - half, means.mean() + half


@right("3.3")
def by_vsp(returns, rng):
    from vsp.evaluate import interval

    return interval(returns, np.mean, n_resamples=4000, seed=4)


@right("3.3")
def corrected_bootstrap(returns, rng):
    from scipy.stats import bootstrap

    return bootstrap((returns.mean(axis=1),), np.mean, rng=rng).confidence_interval


@right("3.3")
def policies_and_starts(returns, rng):
    p, n = returns.shape
    return middle([returns[rng.integers(p, size=p)][:, rng.integers(n, size=n)].mean() for _ in range(2000)])


@right("3.3")
def normal_theory(returns, rng):
    means = returns.mean(axis=1)
    half = 1.96 * means.std(ddof=1) / np.sqrt(len(means))
    return means.mean() - half, means.mean() + half


@right("3.3")
def row_by_row(returns, rng):
    means = []
    for _ in range(3000):
        means.append(np.concatenate([returns[rng.integers(len(returns))] for _ in range(len(returns))]).mean())
    return np.quantile(means, 0.025), np.quantile(means, 0.975)


# 3.4 blame


def count_cells(policy, states):
    return np.bincount(policy.cells(np.array(states).reshape(-1, 2)), minlength=len(policy))


def failing(policy, teacher, task, starts):
    ours, theirs = (play(p, task, starts).codes for p in (policy, teacher))
    return (ours != GOAL) & (theirs == GOAL)


@wrong("3.4", "where the teacher fails too")
def all_failures(policy, teacher, task, starts):
    mask = play(policy, task, starts).codes != GOAL
    return count_cells(policy, [e.states[-1] for e in record(policy, task, starts[mask])])


@wrong("3.4", "only the episodes that end in the pit")
def pit_only(policy, teacher, task, starts):
    mask = failing(policy, teacher, task, starts) & (play(policy, task, starts).codes == PIT)
    return count_cells(policy, [e.states[-1] for e in record(policy, task, starts[mask])])


@wrong("3.4", "in other cells")
def the_teachers_way(policy, teacher, task, starts):
    mask = failing(policy, teacher, task, starts)
    return count_cells(policy, [e.states[-1] for e in record(teacher, task, starts[mask])])


@wrong("3.4", "the cell of their start")
def blame_the_start(policy, teacher, task, starts):
    return count_cells(policy, starts[failing(policy, teacher, task, starts)])


@wrong("3.4", "every step of a failure")
def blame_everyone(policy, teacher, task, starts):
    mask = failing(policy, teacher, task, starts)
    return count_cells(policy, np.concatenate([e.states for e in record(policy, task, starts[mask])]))


@wrong("3.4", "a count per cell")
def without_minlength(policy, teacher, task, starts):
    mask = failing(policy, teacher, task, starts)
    return np.bincount(policy.cells(np.array([e.states[-1] for e in record(policy, task, starts[mask])])))[:-1]


@wrong("3.4", "shares")
def shares(policy, teacher, task, starts):
    counts = state_of_each_failure(policy, teacher, task, starts)
    return counts / counts.sum()


@right("3.4")
def state_of_each_failure(policy, teacher, task, starts):
    mask = failing(policy, teacher, task, starts)
    return count_cells(policy, [e.states[-1] for e, f in zip(record(policy, task, starts), mask) if f])


@right("3.4")
def of_those_that_fail(policy, teacher, task, starts):
    mask = failing(policy, teacher, task, starts)
    return count_cells(policy, [e.states[-1] for e in record(policy, task, starts[mask])])


@right("3.4")
def by_the_last_step(policy, teacher, task, starts):
    counts = [0] * len(policy)
    for ours, theirs in zip(record(policy, task, starts), record(teacher, task, starts)):
        ends = [task.step(e.states[-1:], e.actions[-1:])[2][0] for e in (ours, theirs)]
        if ends[0] != GOAL and ends[1] == GOAL:
            counts[int(policy.cells(ours.states[-1]))] += 1
    return counts


# 3.5 refit


def fitted(policy, coefficients):
    return vsp.VoronoiPolicy(policy.codewords, coefficients, task=policy.task)


@wrong("3.5", "where no state is in a cell")
def by_inverse(policy, states, actions):
    cells, coefficients = policy.cells(states), []
    for i in range(len(policy)):
        own = ones(states[cells == i])
        coefficients.append(np.linalg.inv(own.T @ own) @ own.T @ actions[cells == i])
    return fitted(policy, np.array(coefficients))


@wrong("3.5", "print what that line works with")
def without_bias(policy, states, actions):
    new, cells = policy.coefficients.copy(), policy.cells(states)
    for i in np.unique(cells):
        new[i] = lstsq(states[cells == i], actions[cells == i], rcond=None)[0]
    return fitted(policy, new)


@wrong("3.5", "in a cell without states")
def zeros_for_empty(policy, states, actions):
    new = baselines.refit(policy, states, actions).coefficients
    new[np.setdiff1d(np.arange(len(policy)), policy.cells(states))] = 0
    return fitted(policy, new)


@wrong("3.5", "the same map in every cell")
def one_for_all(policy, states, actions):
    new, known = policy.coefficients.copy(), np.unique(policy.cells(states))
    new[known] = lstsq(ones(states), actions, rcond=None)[0]
    return fitted(policy, new)


@wrong("3.5", "the old policy altered")
def in_place(policy, states, actions):
    policy.coefficients[:] = baselines.refit(policy, states, actions).coefficients
    return policy


@wrong("3.5", "constants")
def constants(policy, states, actions):
    return baselines.refit(policy, states, actions, constant=True)


@wrong("3.5", "a vsp.VoronoiPolicy")
def numbers_only(policy, states, actions):
    return baselines.refit(policy, states, actions).coefficients


@wrong("3.5", "is not written yet")
def stub(policy, states, actions):
    raise NotImplementedError()


@right("3.5")
def with_pinv(policy, states, actions):
    new, cells = policy.coefficients.copy(), policy.cells(states)
    for i in range(len(policy)):
        if (cells == i).any():
            new[i] = np.linalg.pinv(ones(states[cells == i])) @ actions[cells == i]
    return fitted(policy, new)


@right("3.5")
def with_sums_of_products(policy, states, actions):
    new = policy.coefficients.copy()
    for i in np.unique(policy.cells(states)):
        own, goal = ones(states[policy.cells(states) == i]), actions[policy.cells(states) == i]
        new[i] = np.linalg.solve(own.T @ own + 1e-12 * np.eye(3), own.T @ goal)
    return vsp.VoronoiPolicy(policy.codewords, new, task="SimpleGoal-v0")


@right("3.5")
def with_descent(policy, states, actions):
    new, cells = policy.coefficients.copy(), policy.cells(states)
    for i in np.unique(cells):
        inputs = ones(states[cells == i])
        for _ in range(5000):
            new[i] -= 0.3 * inputs.T @ (inputs @ new[i] - actions[cells == i]) / len(inputs)
    return fitted(policy, new)


# 3.6 dagger_round


def gone_through(policy, task, starts):
    return np.concatenate([e.states for e in record(policy, task, starts)])


@wrong("3.6", "the copy's own actions")
def own_labels(policy, teacher, task, starts, states, actions):
    episodes = record(policy, task, starts)
    s, a = (np.concatenate([getattr(e, part) for e in episodes]) for part in ("states", "actions"))
    return np.concatenate([states, s]), np.concatenate([actions, a])


@wrong("3.6", "the states that the teacher goes through")
def the_teacher_drives(policy, teacher, task, starts, states, actions):
    new = gone_through(teacher, task, starts)
    return np.concatenate([states, new]), np.concatenate([actions, teacher.predict(new)[0]])


@wrong("3.6", "the old states gone")
def forget_the_old(policy, teacher, task, starts, states, actions):
    new = gone_through(policy, task, starts)
    return new, teacher.predict(new)[0]


@wrong("3.6", "in different orders")
def shuffled(policy, teacher, task, starts, states, actions):
    new = gone_through(policy, task, starts)
    return np.concatenate([states, new]), np.concatenate([teacher.predict(new)[0], actions])


@wrong("3.6", "one new state per episode")
def starts_only(policy, teacher, task, starts, states, actions):
    return np.concatenate([states, starts]), np.concatenate([actions, teacher.predict(starts)[0]])


@wrong("3.6", "one for each state")
def labels_missing(policy, teacher, task, starts, states, actions):
    return np.concatenate([states, gone_through(policy, task, starts)]), actions


@wrong("3.6", "the pair that `predict` returns")
def labels_with_the_second_thing(policy, teacher, task, starts, states, actions):
    new = gone_through(policy, task, starts)
    return np.concatenate([states, new]), np.concatenate([actions, teacher.predict(new)])


@wrong("3.6", "the pair that `predict` returns")
def second_thing_in_a_list(policy, teacher, task, starts, states, actions):
    new = gone_through(policy, task, starts)
    return np.vstack([states, new]), [*actions, *teacher.predict(new)]


@wrong("3.6", "cannot be read")
def nonsense(policy, teacher, task, starts, states, actions):
    return "states", "actions"


@wrong("3.6", "two arrays")
def states_only(policy, teacher, task, starts, states, actions):
    return np.concatenate([states, gone_through(policy, task, starts)])


@right("3.6")
def label_all_again(policy, teacher, task, starts, states, actions):
    everything = np.vstack([gone_through(policy, task, starts), states])
    return [everything, teacher.predict(everything)[0]]


@right("3.6")
def step_by_step(policy, teacher, task, starts, states, actions):
    rows = list(zip(states, actions))
    for episode in record(policy, task, starts):
        rows += [(state, teacher.predict(state)[0]) for state in episode.states]
    return tuple(np.array(part) for part in zip(*rows))


# 3.7 challenger: policies, made when asked for


def data():
    from vsp.distill import teacher_episodes

    episodes = list(teacher_episodes(teacher(), vsp.get_task("SimpleGoal-v0"), 500, np.random.default_rng(5)))
    states, actions = (np.concatenate([getattr(e, part) for e in episodes]) for part in ("states", "actions"))
    return states, actions.astype(float)


@functools.cache
def teacher():
    return vsp.load_teacher("SimpleGoal-v0")


@wrong("3.7", "is not written yet")
def nobody():
    return None


@wrong("3.7", "fewer than 13")
def too_many_cells():
    states, _ = data()
    return vsp.VoronoiPolicy(np.unique(states, axis=0)[:13], np.zeros((13, 3, 2)), task="SimpleGoal-v0")


@wrong("3.7", "expected more than the best copy")
def one_linear_map():
    return baselines.linear_map(*data(), "SimpleGoal-v0")


@wrong("3.7", "a vsp.VoronoiPolicy")
def the_teacher_in_person():
    return teacher()


@wrong("3.7", "the class VoronoiPolicy itself")
def the_class_itself():
    return vsp.VoronoiPolicy


@wrong("3.7", "the policy alone")
def policy_and_history():
    return one_linear_map(), None


@wrong("3.7", "one for SimpleGoal-v0")
def for_another_task():
    return vsp.VoronoiPolicy([[0, 0]], [[[0], [12], [0]]], task="MountainCarContinuous-v0")


@right("3.7")
def quadratic_maps():
    config = replace(vsp.preset("SimpleGoal-v0"), fit="closed_form", sub_policy="quadratic")
    return vsp.distill(teacher(), "SimpleGoal-v0", config, seed=0)[0]


@right("3.7")
def dagger_on_k_means():
    from vsp.config import Refinement

    fits = [functools.partial(baselines.kmeans_cells, cells=12, task="SimpleGoal-v0", seed=seed) for seed in range(6)]
    config = Refinement(n_cells=12, n_episodes=500, n_corrections=3, n_correction_episodes=300, n_validation=1000)
    return baselines.dagger(fits, teacher(), "SimpleGoal-v0", config=config, seed=0)
