"""Describe cells by axis-aligned rules, such as "x > 0.42 and y <= 0.61", that tell which cell a state is in.

Borders between Voronoi cells are oblique, so the regions are hard to describe; the paper names this as a limitation.
Here a small decision tree (CART, Breiman et al. 1984) learns the cell of visited states. Its leaves are boxes, and each
box is a rule.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vsp.checks import check_array
from vsp.policy import PiecewisePolicy, VoronoiPolicy
from vsp.subpolicies.base import number

AGREEMENT = 0.95  # share of the states in which rules must agree with the look-up
MOST = 200  # leaves of the largest tree to try
_DIGITS = range(1, 17)  # how many digits to try for the numbers in rules, in this order


@dataclass(frozen=True, eq=False)
class Rule:
    """A box assigned to a cell: low < state <= high, infinite where there is no border."""

    cell: int
    low: np.ndarray  # (d,)
    high: np.ndarray  # (d,)

    def holds(self, states: np.ndarray) -> np.ndarray:
        """Return which of the states (n, d) lie in the box, or whether one (d,) does. (n,) bool, or one"""
        return np.all((states > self.low) & (states <= self.high), axis=-1)

    def text(self, names: tuple[str, ...]) -> str:
        """Write the box in words, with the names of the d inputs; "always" if it has no border."""
        conditions = []
        for name, low, high in zip(names, map(_plain, self.low), map(_plain, self.high)):
            if low and high:
                conditions.append(f"{low} < {name} <= {high}")
            elif low or high:
                conditions.append(f"{name} > {low}" if low else f"{name} <= {high}")
        return " and ".join(conditions) or "always"


def describe_rules(policy: VoronoiPolicy, states: np.ndarray, unseen: np.ndarray) -> pd.DataFrame:
    """Describe the cells of `policy` by the fewest rules that agree with its look-up in a share `AGREEMENT` of states.

    Rules are fitted to `states` (n, d). States of other episodes, `unseen` (u, d), both select and evaluate the rules,
    so the agreement is slightly optimistic.

    One row per rule, cell by cell. Columns: cell; share (of all states that are in this cell); rule; coverage (share of
    the cell's states where the rule holds, largest first); fidelity (share of the rule's states that are in the cell).
    A cell without a rule has one row with the rule "none". `attrs` has the agreement that is reached.

    Raises ValueError for arrays of a wrong shape, and for no states.
    """
    rules, _ = find_rules(policy, states, unseen)
    cells, rows = policy.cells(unseen), []
    for cell in range(len(policy)):
        inside = cells == cell
        known = {"cell": cell, "share": inside.mean()}
        for rule in (of_cell := [rule for rule in rules if rule.cell == cell]):
            holds = rule.holds(unseen)
            scores = {"coverage": _share(holds, inside), "fidelity": _share(inside, holds)}
            rows.append({**known, "rule": rule.text(policy.task.inputs), **scores})
        if not of_cell:
            rows.append({**known, "rule": "none", "coverage": _share(~inside, inside), "fidelity": np.nan})
    frame = pd.DataFrame(rows).sort_values(["cell", "coverage"], ascending=[True, False], ignore_index=True)
    frame.attrs["agreement"] = float(np.mean(apply(rules, unseen) == cells))
    return frame


def find_rules(policy: VoronoiPolicy, states: np.ndarray, unseen: np.ndarray) -> tuple[list[Rule], int]:
    """Find the rules, exactly one of which holds in each state, and the number of digits in them.

    Arguments and errors are those of `describe_rules`. If no tree reaches `AGREEMENT`, the best one is used.
    """
    d = len(policy.task.low)
    states, unseen = check_array("states", states, (-1, d)), check_array("unseen", unseen, (-1, d))
    if not (len(states) and len(unseen)):
        raise ValueError(f"{len(states)} states and {len(unseen)} unseen states, expected at least one of each")
    cells = policy.cells(unseen)
    rules, best = _smallest(states, policy.cells(states), unseen, cells)
    places = -np.round(np.log10(np.maximum(np.ptp(states, axis=0), 1e-12))).astype(int)  # decimal place of the range
    for digits in _DIGITS:
        short = _rounded(rules, digits + places)
        if np.mean(apply(short, unseen) == cells) >= min(AGREEMENT, best):
            return short, digits
    return rules, digits


class RulePolicy(PiecewisePolicy):
    """The maps of a policy with rules in place of its look-up, to show what an occasional wrong cell costs.

    A map is good in its own cell, but may be far off beyond the border. So rules that agree in 95 of 100 states can
    describe a policy, but may not be able to replace it.
    """

    def __init__(self, policy: VoronoiPolicy, rules: list[Rule]):
        super().__init__(policy.where, policy.coefficients, task=policy.task, sub_policy=policy.policy_class.name)
        self.rules = rules

    def _cells(self, states: np.ndarray) -> np.ndarray:
        return apply(self.rules, states)


def apply(rules: list[Rule], states: np.ndarray) -> np.ndarray:
    """Return the cell of the rule that holds in each state (n, d). (n,)"""
    holds = np.array([rule.holds(states) for rule in rules])
    return np.array([rule.cell for rule in rules])[holds.argmax(axis=0)]


def _smallest(states, cells, unseen, truth) -> tuple[list[Rule], float]:
    """Return the rules and the agreement of the smallest tree that agrees enough, else of the one that agrees most."""
    from sklearn.tree import DecisionTreeClassifier

    best, most_right = None, -1.0
    for leaves in range(2, MOST + 1):
        tree = DecisionTreeClassifier(max_leaf_nodes=leaves, random_state=0).fit(states, cells)
        right = float(np.mean(tree.predict(unseen) == truth))
        best, most_right = (tree, right) if right > most_right else (best, most_right)
        if right >= AGREEMENT or tree.get_n_leaves() < leaves:  # it agrees enough, or nothing is left to split
            break
    d = states.shape[1]
    return _merged(list(_leaves(best, 0, np.full(d, -np.inf), np.full(d, np.inf)))), most_right


def _leaves(tree, node: int, low: np.ndarray, high: np.ndarray) -> Iterator[Rule]:
    """Yield the leaves below a node as rules. The node is the box from `low` to `high`."""
    inner = tree.tree_
    if inner.children_left[node] < 0:
        yield Rule(int(tree.classes_[inner.value[node, 0].argmax()]), low, high)
        return
    axis, border = inner.feature[node], inner.threshold[node]
    below, above = high.copy(), low.copy()
    below[axis] = above[axis] = border
    yield from _leaves(tree, inner.children_left[node], low, below)
    yield from _leaves(tree, inner.children_right[node], above, high)


def _merged(rules: list[Rule]) -> list[Rule]:
    """Describe the same regions by fewer boxes: merge two boxes of one cell that share a whole face."""
    for i, first in enumerate(rules):
        for j, second in enumerate(rules):
            axes = np.flatnonzero((first.low != second.low) | (first.high != second.high))
            if first.cell == second.cell and len(axes) == 1 and first.high[axes[0]] == second.low[axes[0]]:
                rest = [rule for k, rule in enumerate(rules) if k not in (i, j)]
                return _merged([*rest, Rule(first.cell, first.low, second.high)])
    return sorted(rules, key=lambda rule: (rule.cell, *rule.low, *rule.high))


def _rounded(rules: list[Rule], decimals: np.ndarray) -> list[Rule]:
    """Round the bounds of the rules to `decimals` (d,) and drop boxes that become empty."""
    short = []
    for rule in rules:
        low, high = (np.array([round(b, int(n)) for b, n in zip(ends, decimals)]) for ends in (rule.low, rule.high))
        if (low < high).all():
            short.append(Rule(rule.cell, low, high))
    return _merged(short)


def _plain(bound: float) -> str:
    """Write a bound without trailing zeros; "" for an infinite one."""
    return number(bound + 0.0, None) if np.isfinite(bound) else ""


def _share(part: np.ndarray, whole: np.ndarray) -> float:
    """Return the share of `whole` that is also in `part`, or NaN if `whole` is empty."""
    return float(part[whole].mean()) if whole.any() else float("nan")
