import numpy as np
import pytest
from sklearn.tree import DecisionTreeClassifier
from support import PENDULUM, SIMPLEGOAL

from vsp.evaluation import start_states
from vsp.paper.printed import published_policy
from vsp.policy import VoronoiPolicy
from vsp.rollouts import visited_states
from vsp.tasks.registry import get_task
from vsp_beyond.explain import rules
from vsp_beyond.explain.rules import Rule, RulePolicy, _merged, apply, describe_rules, find_rules


def constants(codewords, values, task=SIMPLEGOAL):
    """A policy that does one thing in each cell."""
    codewords, space = np.asarray(codewords, dtype=float), get_task(task)
    coefficients = np.zeros((len(codewords), len(space.low) + 1, len(space.action_low)))
    coefficients[:, -1] = np.asarray(values)[:, None]
    return VoronoiPolicy(codewords, coefficients, task=task)


def uniform(n, seed):
    return np.random.default_rng(seed).random((n, 2))


@pytest.fixture(scope="module")
def published():
    policy = published_policy(SIMPLEGOAL)
    states, unseen = (visited_states(policy, policy.task, start_states(policy.task, 300, seed)) for seed in (1, 2))
    return policy, states, unseen, describe_rules(policy, states, unseen)


# By hand


def test_a_border_along_an_axis_is_one_rule_per_cell():
    """And a cell that nobody visits has none."""
    policy = constants([[0.2, 0.5], [0.6, 0.5], [9.0, 9.0]], [1, -1, 0])  # the border is x = 0.4
    table = describe_rules(policy, uniform(2000, 0), uniform(2000, 1))
    assert table["rule"].tolist() == ["x <= 0.4", "x > 0.4", "none"] and table["cell"].tolist() == [0, 1, 2]
    assert table["coverage"].tolist()[:2] == table["fidelity"].tolist()[:2] == [1.0, 1.0]
    assert table["share"].sum() == 1 and table["share"][0] == np.mean(uniform(2000, 1)[:, 0] <= 0.4)
    assert table["share"][2] == 0 and np.isnan(table["coverage"][2])
    assert table.attrs == {"agreement": 1.0}


def test_coverage_and_fidelity_by_hand(monkeypatch):
    """Two, two and four states in three cells, and one split: it sets the four apart."""
    monkeypatch.setattr(rules, "MOST", 2)
    policy = constants([[0.2, 0.5], [0.5, 0.5], [0.8, 0.5]], [0, 0, 0])
    states = np.column_stack([np.tile([0.1, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0], 5), np.full(40, 0.5)])
    table = describe_rules(policy, states, states)
    assert table.attrs["agreement"] == 0.75
    assert table["rule"].tolist() == ["x <= 0.65", "none", "x > 0.65"]  # 0.6 or 0.7 would be a state's own
    assert table["coverage"].tolist() == [1, 0, 1] and table["share"].tolist() == [0.25, 0.25, 0.5]
    assert table["fidelity"][0] == 0.5 and np.isnan(table["fidelity"][1]) and table["fidelity"][2] == 1


def test_a_rule_in_words():
    names, inf = ("cos θ", "sin θ", "ω"), np.inf
    rule = Rule(0, np.array([0.25, -inf, -1.0]), np.array([0.5, 2.0, inf]))
    assert rule.text(names) == "0.25 < cos θ <= 0.5 and sin θ <= 2 and ω > -1"
    assert Rule(0, np.array([-0.0]), np.array([1e-5])).text(("v",)) == "0 < v <= 0.00001"
    table = describe_rules(constants([[0.5, 0.5]], [1]), uniform(50, 0), uniform(50, 1))
    assert table.loc[0, ["cell", "share", "rule", "coverage", "fidelity"]].tolist() == [0, 1, "always", 1, 1]


def test_a_bound_belongs_to_the_rule_below_it():
    rules = [Rule(7, np.array([-np.inf]), np.array([0.5])), Rule(3, np.array([0.5]), np.array([np.inf]))]
    assert apply(rules, np.array([[0.5], [0.6], [-9.0]])).tolist() == [7, 3, 7]


def test_boxes_side_by_side_become_one():
    def box(cell, *sides):
        return Rule(cell, *np.array(sides, dtype=float).T)

    quarters = [box(0, (0, 1), (0, 1)), box(0, (1, 2), (0, 1)), box(0, (0, 1), (1, 2)), box(0, (1, 2), (1, 2))]
    (whole,) = _merged(quarters)
    assert (whole.low.tolist(), whole.high.tolist()) == ([0, 0], [2, 2])
    assert len(_merged([quarters[0], box(1, (1, 2), (0, 1)), box(0, (2, 3), (0, 1)), box(0, (0, 1), (1, 3))])) == 3


def test_inputs_may_have_any_number_and_unit():
    rng = np.random.default_rng(0)
    states = np.column_stack([rng.uniform(-1, 1, (1500, 2)), rng.uniform(-8, 8, 1500)])
    table = describe_rules(constants([[0, 0, -3], [0, 0, 5]], [0, 0], PENDULUM), states[:700], states[700:])
    assert table["rule"].tolist() == ["ω <= 1", "ω > 1"]


# Properties


def test_what_was_asked_is_reached_and_recomputed_from_the_words(published):
    """Two routes: from the boxes, and from the text of the rules, read as Python."""
    policy, states, unseen, table = published
    x, y = unseen.T
    read = [text.replace(" and ", ") & (") for text in table["rule"]]
    held = np.array([eval(f"({_chained(text)})", {"x": x, "y": y}) for text in read])
    assert (held.sum(axis=0) == 1).all()  # one rule for each state
    assert np.mean(table["cell"].to_numpy()[held.argmax(axis=0)] == policy.cells(unseen)) == table.attrs["agreement"]
    assert table.attrs["agreement"] >= 0.95
    in_cell = policy.cells(unseen) == table["cell"].to_numpy()[:, None]
    assert np.allclose(table["coverage"], (held & in_cell).sum(axis=1) / in_cell.sum(axis=1))
    assert np.allclose(table["fidelity"], (held & in_cell).sum(axis=1) / held.sum(axis=1))
    assert describe_rules(policy, states, unseen).equals(table)


def _chained(text):
    """Comparisons of arrays do not chain: "0.2 < x <= 0.4" in two."""
    parts = [part.split(" < ") for part in text.split(") & (")]
    return ") & (".join(f"{p[0]} < {p[1].split()[0]}) & ({p[1]}" if len(p) == 2 else p[0] for p in parts)


def test_a_smaller_tree_or_shorter_numbers_do_not_reach_it(published):
    policy, states, unseen, table = published
    rules, digits = find_rules(policy, states, unseen)
    cells, truth = policy.cells(states), policy.cells(unseen)
    trees = (DecisionTreeClassifier(max_leaf_nodes=n, random_state=0).fit(states, cells) for n in range(2, 100))
    first = next(tree for tree in trees if np.mean(tree.predict(unseen) == truth) >= 0.95)
    assert len(table) == len(rules) <= first.get_n_leaves()
    shorter = [Rule(rule.cell, rule.low.round(digits - 1), rule.high.round(digits - 1)) for rule in rules]
    assert np.mean(apply(shorter, unseen) == truth) < 0.95 <= np.mean(apply(rules, unseen) == truth)


def test_where_no_tree_agrees_enough_the_best_is_used(published, monkeypatch):
    policy, states, unseen, table = published
    monkeypatch.setattr(rules, "MOST", 20)
    best = describe_rules(policy, states, unseen)
    assert len(best) <= 20 and 0.7 < best.attrs["agreement"] < table.attrs["agreement"]


def test_rules_act_as_the_policy_where_they_agree(published):
    policy, states, unseen, _ = published
    rules, _ = find_rules(policy, states, unseen)
    same = apply(rules, unseen) == policy.cells(unseen)
    actions, none = RulePolicy(policy, rules).predict(unseen)
    assert none is None and np.allclose(actions[same], policy.predict(unseen)[0][same])
    assert not np.allclose(actions[~same], policy.predict(unseen)[0][~same])
