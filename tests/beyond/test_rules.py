import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL

from vsp.evaluation import start_states
from vsp.paper.printed import published_policy
from vsp.policy import VoronoiPolicy
from vsp.rollouts import visited_states
from vsp.tasks.registry import get_task
from vsp_beyond.explain.rules import Rule, RulePolicy, _merged, _rounded, apply, describe_rules, find_rules


def constants(codewords, values, task=SIMPLEGOAL, **options):
    """A policy that does one thing in each cell."""
    codewords, space = np.asarray(codewords, dtype=float), get_task(task)
    maps = np.zeros((len(codewords), len(space.low) + 1, len(space.action_low)))
    maps[:, -1] = np.asarray(values)[:, None]
    return VoronoiPolicy(codewords, maps, task=task, **options)


def uniform(n, seed):
    return np.random.default_rng(seed).random((n, 2))


@pytest.fixture(scope="module")
def published():
    policy = published_policy(SIMPLEGOAL)
    states, unseen = (visited_states(policy, policy.task, start_states(policy.task, 300, seed)) for seed in (1, 2))
    return policy, states, unseen, describe_rules(policy, states, unseen)


# By hand


def test_a_border_along_an_axis_is_one_rule_per_cell():
    policy = constants([[0.2, 0.5], [0.6, 0.5]], [1, -1])  # the border is x = 0.4
    frame = describe_rules(policy, uniform(2000, 0), uniform(2000, 1), agreement=0.999)
    assert frame["rule"].tolist() == ["x <= 0.4", "x > 0.4"] and frame["cell"].tolist() == [0, 1]
    assert frame["coverage"].tolist() == frame["fidelity"].tolist() == [1.0, 1.0]
    assert frame["share"].sum() == 1 and frame["share"][0] == np.mean(uniform(2000, 1)[:, 0] <= 0.4)
    assert frame.attrs == {"agreement": 1.0, "asked": 0.999, "reached": True, "rules": 2, "digits": 1}


def test_coverage_and_fidelity_by_hand():
    """Two, two and four states in three cells, and one split: it sets the four apart."""
    policy = constants([[0.2, 0.5], [0.5, 0.5], [0.8, 0.5]], [0, 0, 0])
    states = np.column_stack([np.tile([0.1, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0], 5), np.full(40, 0.5)])
    frame = describe_rules(policy, states, states, leaves=2)
    assert frame.attrs["agreement"] == 0.75 and not frame.attrs["reached"] and frame.attrs["rules"] == 2
    assert frame["rule"].tolist() == ["x <= 0.65", "none", "x > 0.65"]  # 0.6 or 0.7 would be a state's own
    assert frame["coverage"].tolist() == [1, 0, 1] and frame["share"].tolist() == [0.25, 0.25, 0.5]
    assert frame["fidelity"][0] == 0.5 and np.isnan(frame["fidelity"][1]) and frame["fidelity"][2] == 1


def test_one_cell_is_always_and_needs_no_border():
    frame = describe_rules(constants([[0.5, 0.5]], [1]), uniform(50, 0), uniform(50, 1))
    assert frame.loc[0, ["cell", "share", "rule", "coverage", "fidelity"]].tolist() == [0, 1, "always", 1, 1]


def test_a_cell_that_nobody_visits_is_said_to_have_no_rule():
    policy = constants([[0.2, 0.5], [0.6, 0.5], [9.0, 9.0]], [0, 0, 0])
    frame = describe_rules(policy, uniform(500, 0), uniform(500, 1))
    assert frame["rule"].tolist()[2] == "none" and frame["share"][2] == 0 and np.isnan(frame["coverage"][2])


def test_a_rule_in_words():
    names, inf = ("cos θ", "sin θ", "ω"), np.inf
    rule = Rule(0, np.array([0.25, -inf, -1.0]), np.array([0.5, 2.0, inf]))
    assert rule.text(names) == "0.25 < cos θ <= 0.5 and sin θ <= 2 and ω > -1"
    assert Rule(0, np.full(3, -inf), np.full(3, inf)).text(names) == "always"
    assert Rule(0, np.array([-0.0]), np.array([1e-5])).text(("v",)) == "0 < v <= 0.00001"


def test_a_bound_belongs_to_the_rule_below_it():
    rules = [Rule(7, np.array([-np.inf]), np.array([0.5])), Rule(3, np.array([0.5]), np.array([np.inf]))]
    assert rules[0].holds(np.array([[0.5], [0.6]])).tolist() == [True, False]
    assert apply(rules, np.array([[0.5], [0.6], [-9.0]])).tolist() == [7, 3, 7]


def test_boxes_side_by_side_become_one():
    def box(cell, *sides):
        return Rule(cell, *np.array(sides, dtype=float).T)

    quarters = [box(0, (0, 1), (0, 1)), box(0, (1, 2), (0, 1)), box(0, (0, 1), (1, 2)), box(0, (1, 2), (1, 2))]
    (whole,) = _merged(quarters)
    assert (whole.low.tolist(), whole.high.tolist()) == ([0, 0], [2, 2])
    apart = [box(0, (0, 1), (0, 1)), box(1, (1, 2), (0, 1)), box(0, (2, 3), (0, 1)), box(0, (0, 1), (1, 3))]
    assert len(_merged(apart)) == 3  # another cell's, one that does not touch


# Properties


def test_what_was_asked_is_reached_and_recomputed_from_the_words(published):
    """Two routes: from the boxes, and from the text of the rules, read as Python."""
    policy, _, unseen, frame = published
    x, y = unseen.T
    read = [text.replace(" and ", ") & (") for text in frame["rule"]]
    held = np.array([eval(f"({_chained(text)})", {"x": x, "y": y}) for text in read])
    assert (held.sum(axis=0) == 1).all()  # one rule for each state
    found = frame["cell"].to_numpy()[held.argmax(axis=0)]
    assert np.mean(found == policy.cells(unseen)) == frame.attrs["agreement"] >= 0.95 and frame.attrs["reached"]
    own = policy.cells(unseen) == frame["cell"].to_numpy()[:, None]
    assert np.allclose(frame["coverage"], (held & own).sum(axis=1) / own.sum(axis=1))
    assert np.allclose(frame["fidelity"], (held & own).sum(axis=1) / held.sum(axis=1))


def _chained(text):
    """Comparisons of arrays do not chain: "0.2 < x <= 0.4" in two."""
    parts = [part.split(" < ") for part in text.split(") & (")]
    return ") & (".join(f"{p[0]} < {p[1].split()[0]}) & ({p[1]}" if len(p) == 2 else p[0] for p in parts)


def test_a_smaller_tree_or_shorter_numbers_do_not_reach_it(published):
    from sklearn.tree import DecisionTreeClassifier

    policy, states, unseen, frame = published
    rules, digits = find_rules(policy, states, unseen)
    cells, truth = policy.cells(states), policy.cells(unseen)
    trees = (DecisionTreeClassifier(max_leaf_nodes=n, random_state=0).fit(states, cells) for n in range(2, 100))
    first = next(tree for tree in trees if np.mean(tree.predict(unseen) == truth) >= 0.95)
    assert len(frame) == len(rules) <= first.get_n_leaves()
    shorter = _rounded(rules, np.full(2, digits - 1))  # the states span 1, so digits are decimals
    assert np.mean(apply(shorter, unseen) == truth) < 0.95 <= np.mean(apply(rules, unseen) == truth)


def test_more_agreement_takes_more_rules(published):
    policy, states, unseen, frame = published
    few, many = (describe_rules(policy, states, unseen, agreement=asked) for asked in (0.8, 0.96))
    assert few.attrs["rules"] < frame.attrs["rules"] < many.attrs["rules"]
    assert 0.8 <= few.attrs["agreement"] < 0.95 < 0.96 <= many.attrs["agreement"]


def test_out_of_reach_gives_the_best_there_is(published):
    policy, states, unseen, _ = published
    frame = describe_rules(policy, states, unseen, agreement=1.0, leaves=20)
    assert not frame.attrs["reached"] and frame.attrs["asked"] == 1.0 and frame.attrs["rules"] <= 20
    assert 0.7 < frame.attrs["agreement"] < 1


def test_inputs_may_have_any_number_and_unit():
    rng = np.random.default_rng(0)
    states = np.column_stack([rng.uniform(-1, 1, (1500, 2)), rng.uniform(-8, 8, 1500)])
    policy = constants([[0, 0, -3], [0, 0, 5]], [0, 0], PENDULUM)
    frame = describe_rules(policy, states[:700], states[700:], agreement=0.98)
    assert frame["rule"].tolist() == ["ω <= 1", "ω > 1"]
    slow = constants([[0, -0.02], [0, 0.04]], [0, 0], MOUNTAINCAR)
    states = np.column_stack([rng.uniform(-1, 0.5, 3000), rng.uniform(-0.07, 0.07, 3000)])
    frame = describe_rules(slow, states[:2000], states[2000:], agreement=0.99)
    assert frame["rule"].tolist() == ["v <= 0.01", "v > 0.01"]


def test_the_same_arguments_give_the_same_rules(published):
    policy, states, unseen, frame = published
    assert describe_rules(policy, states, unseen).equals(frame)


def test_rules_act_as_the_policy_where_they_agree(published):
    policy, states, unseen, _ = published
    rules, _ = find_rules(policy, states, unseen)
    same = apply(rules, unseen) == policy.cells(unseen)
    actions, none = RulePolicy(policy, rules).predict(unseen)
    assert none is None and np.allclose(actions[same], policy.predict(unseen)[0][same])
    assert not np.allclose(actions[~same], policy.predict(unseen)[0][~same])
