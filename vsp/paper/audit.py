"""The audit: do the numbers that the paper prints agree with each other, with its tables, and with its tasks?

Each finding is a function of the transcribed values in `data/paper`; `audit_findings()` runs them all.
Returns have no unit, shares are in percent. Standard deviations divide by n, as NumPy's do; n - 1 makes a difference
only for the 24 outliers of SimpleGoal's teacher. The rounding of the printed values changes no verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from ..evaluation import fences
from ..geometry import delaunay_neighbours, distances
from ..tasks.registry import get_task
from ..tasks.simplegoal import GOAL_EDGE, STRIDE
from . import printed, statistics
from .printed import PREFIX, SHORT, printed_value, spread_id
from .statistics import Part, rounds_to

VERDICTS = HOLDS, CONTRADICTS, OPEN = "holds", "contradicts itself", "open"
SIMPLEGOAL, MOUNTAINCAR = printed.TASKS


@dataclass(frozen=True)
class Finding:
    """What the paper prints in one place, beside what follows from its other numbers."""

    title: str
    printed: str  # what the paper prints, and where
    arithmetic: str  # the computation with its numbers filled in
    verdict: str  # one of VERDICTS
    concerns: tuple[str, ...] = ()  # ids of the printed values that a contradiction puts in doubt


def finding(title: str, printed: str, text: str, agrees: bool | None, concerns: Sequence[str] = ()) -> Finding:
    """Return a finding that holds if the numbers agree, else puts `concerns` in doubt; None leaves it open."""
    if agrees is None:
        return Finding(title, printed, text, OPEN)
    return Finding(title, printed, text, HOLDS) if agrees else Finding(title, printed, text, CONTRADICTS, (*concerns,))


def quote(*ids: str) -> str:
    """Quote printed values and their places, without the transcription's own remarks after a semicolon."""
    rows = printed.printed_values().set_index("id").loc[list(ids)].itertuples()
    return "; ".join(f"{row.quantity} {row.paper} ({row.where.partition(';')[0]})" for row in rows)


# Columns of T5 and T6


class Column:
    """A column of T5 or T6, and the numbers that the text adds.

    `values` are min, max, mean, std, q1, median, q3, iqr, and coverage in percent. `below` and `above` are the
    outliers that the text describes: at most one part each, none if it gives no mean.
    """

    def __init__(self, task: str, subject: str):
        self.name, self.values = f"{PREFIX[task]}_{subject}", pd.Series(printed.printed_spread_values(task, subject))
        self.label = f"{SHORT[task]} {'DRL' if subject == 'drl' else 'Ours'}"
        episodes = printed_value(f"{PREFIX[task]}_policies") * printed_value("episodes_per_policy")
        self.n = int(printed_value("drl_episodes") if subject == "drl" else episodes)
        self.n_outliers = int(printed_value(f"{self.name}_outliers"))
        self.below = self._parts("outliers", "outliers_min", "outliers_max")
        self.below += self._parts("outliers_below", "min", "whisker_low")
        self.above = self._parts("outliers_above", "whisker_high", "max")
        self.outliers = self.below + self.above
        self.low = self.below[0].high if self.below else self.values["min"]  # lowest and highest return inside
        self.high = self.above[0].low if self.above else self.values["max"]

    def _parts(self, side: str, low: str, high: str) -> list[Part]:
        numbers = printed.printed_text_numbers()["value"]
        if f"{self.name}_{side}_mean" not in numbers:
            return []
        size = round(self.n_outliers * numbers.get(f"{self.name}_{side}_share", 100) / 100)
        return [Part(size, *(numbers[f"{self.name}_{x}"] for x in (f"{side}_mean", f"{side}_std", low, high)))]

    def coverage(self) -> float:
        """Return the share of episodes that are not outliers, in percent, from the printed counts."""
        return 100 * (1 - self.n_outliers / self.n)

    def moments(self, n: int) -> tuple[str, bool]:
        """Describe mean and std of n returns without the outliers; also return whether the quartiles allow them."""
        mean = statistics.remaining_mean(n, self.values["mean"], self.outliers)
        std = statistics.remaining_std(n, self.values["mean"], self.values["std"], self.outliers)
        sizes = [sum(part.size for part in side) for side in (self.below, self.above)]
        groups = statistics.quarters(n, [self.low, *self.values[["q1", "median", "q3"]], self.high], *sizes)
        (a, b), c = statistics.mean_range(groups), statistics.least_std(mean, groups)
        d = statistics.greatest_std(mean, self.low, self.high)
        text = f"of {n} the {n - sum(sizes)} others have mean {mean:.3f} (the quartiles allow {a:.3f} to {b:.3f}) and "
        return f"{text}std {std:.3f} ({c:.3f} to {d:.3f})", bool(a <= mean <= b and c <= std <= d)


def all_columns() -> list[Column]:
    """Return the columns of T5 and T6."""
    return [Column(task, subject) for task in printed.TASKS for subject in ("drl", "ours")]


def mean_inside(task: str, subject: str) -> float:
    """Return the mean return of the episodes without the outliers, from the printed totals and the printed outliers."""
    column = Column(task, subject)
    return statistics.remaining_mean(column.n, column.values["mean"], column.outliers)


# The protocol: how many policies, how many steps, and when the partition may change


def run_counts() -> Finding:
    """Compare the numbers of distilled policies that the protocol, the text and the coverage imply."""
    notes, ids, wrong = [], [], []
    for task, name in PREFIX.items():
        protocol, text = printed_value(f"{name}_policies"), printed_value(f"{name}_text_policies")
        needed = printed_value(f"{name}_ours_outliers") / (1 - Column(task, "ours").values["coverage"] / 100)
        notes.append(f"{SHORT[task]}: {protocol:.0f} and {text:.0f}; the coverage asks for {needed:.0f} episodes")
        ids += [f"{name}_policies", f"{name}_text_policies"]
        wrong += [f"{name}_text_policies"] * (text != protocol)
    return finding("Number of distilled policies", quote(*ids), "; ".join(notes), not wrong, wrong)


def truncation() -> Finding:
    """Compare the longest episode as printed with that of the registered environment."""
    steps, limit, lowest = get_task(MOUNTAINCAR).max_steps, printed_value("mc_max_steps"), printed_value("mc_ours_min")
    text = (
        f"{limit:.0f} and {steps} of the registered environment. No printed return depends on it: the lowest, "
        f"{lowest:.3f}, is positive, and an episode without the goal earns at most 0"
    )
    return finding("MountainCar: truncation", quote("mc_max_steps"), text, limit == steps or None)


def frozen_iterations() -> Finding:
    """Count the iterations that may alter the partition, by each of the three places that state it."""
    notes, agrees, ids = [], True, []
    for task, name in PREFIX.items():
        hyper = printed.printed_hyperparameters(task)
        epochs, split, freeze = (hyper[f"n_{what}"] for what in ("epochs", "split", "freeze"))
        agrees &= epochs - freeze == freeze == epochs - split
        counts = f"{epochs} - {freeze} = {epochs - freeze}, {freeze}, {epochs} - {split} = {epochs - split}"
        notes.append(f"{SHORT[task]} {counts}")
        ids += [f"{name}_hyper_n_{what}" for what in ("epochs", "freeze", "split")]
    shown = "last n_freeze iterations frozen (Partitioning the state space); altered while n is below n_freeze "
    shown += f"(Algorithm 1); last n_split frozen (Learning subpolicies); {quote(*ids)}"
    text = f"iterations that may alter the partition: {'; '.join(notes)}"
    return finding("Which iterations may change the partition", shown, text, agrees)


# The returns: T5 and T6, and what the text says of them


def simplegoal_coverage() -> Finding:
    """Show that coverage and outliers need different totals; the moments decide which total is right."""
    ours, episodes = Column(SIMPLEGOAL, "ours"), printed_value("episodes_per_policy")
    n, size, coverage = ours.n, ours.n_outliers, ours.values["coverage"]
    share = 1 - coverage / 100
    other = int(round(size / share / episodes) * episodes)  # episodes of a whole number of policies
    text = (
        f"1 - {size}/{n} = {ours.coverage():.2f} %; {coverage:g} % asks for {share * n:.0f} outliers or {other} "
        f"episodes. By the moments, {ours.moments(other)[0]}; {ours.moments(n)[0]}"
    )
    wrong = [spread_id(SIMPLEGOAL, "ours", "coverage")]
    shown, agrees = quote(*wrong, "sg_ours_outliers", "sg_total_episodes"), rounds_to(ours.coverage(), coverage)
    return finding("SimpleGoal: coverage and outliers of the distilled policies", shown, text, agrees, wrong)


def other_columns() -> Finding:
    """Check the coverage of all columns but SimpleGoal's Ours, and the moments of all but MountainCar's Ours."""
    notes, agrees, ids = [], True, []
    for column in all_columns():
        if column.name != "sg_ours":
            notes.append(f"{column.label}: 1 - {column.n_outliers}/{column.n} = {column.coverage():g} %")
            ids += [f"{column.name}_outliers", column.name.replace("_", "_spread_") + "_coverage"]
            agrees &= rounds_to(column.coverage(), column.values["coverage"])
        if column.name != "mc_ours":
            text, possible = column.moments(column.n)
            notes.append(f"{column.label}: {text}")
            agrees &= possible
    return finding("Coverage and moments of the other columns", quote(*ids), "; ".join(notes), agrees)


def mountaincar_quartiles() -> Finding:
    """Compare T6 with three statements of the text: bounds, moments, and a higher median with a larger spread."""
    column = Column(MOUNTAINCAR, "ours")
    ours, drl = column.values, Column(MOUNTAINCAR, "drl").values
    bounds = ["mc_ours_whisker_low", "mc_ours_whisker_high"]
    (q1, q3), (a, b) = statistics.quartiles_from_fences(*map(printed_value, bounds)), fences(ours["q1"], ours["q3"])
    note, possible = column.moments(column.n)
    text = (
        f"the bounds in the text need Q1 {q1:.3f}, Q3 {q3:.3f}, IQR {q3 - q1:.3f}; T6 has bounds {a:.3f} and {b:.3f}. "
        f"By the moments, {note}. Median and IQR are above DRL's by {ours['median'] - drl['median']:.3f} and "
        f"{ours['iqr'] - drl['iqr']:.3f} in T6, by {q1 - drl['median']:.3f} at least and {q3 - q1 - drl['iqr']:.3f} "
        "with the bounds in the text"
    )
    wrong = [spread_id(MOUNTAINCAR, "ours", metric) for metric in ("q1", "median", "q3", "iqr")]
    shown = quote(*wrong, *bounds) + "; a higher median and a larger spread than DRL (caption of the box plot)"
    agrees = possible and rounds_to(q3 - q1, ours["iqr"]) and ours["median"] > drl["median"]
    return finding("MountainCar: quartiles of the distilled policies, in table and text", shown, text, agrees, wrong)


def outlier_rules() -> Finding:
    """Find the rule for outliers, which the paper does not state.

    A rule fits a side if the outliers there end beyond its bound. Without outliers it fits if no return is beyond it.
    """
    notes, common = [], {"1.5 IQR", "2 std"}
    for column in all_columns():
        c, end, start = column.values, column.low, column.high
        rules = {"1.5 IQR": fences(c["q1"], c["q3"]), "2 std": (c["mean"] - 2 * c["std"], c["mean"] + 2 * c["std"])}
        if column.above:  # the quartiles of this column are wrong, but the text prints the bounds
            rules["1.5 IQR"] = end, start
        fits = {
            rule
            for rule, (low, high) in rules.items()
            if (end <= low if column.below else end >= low) and (start >= high if column.above else start <= high)
        }
        bounds = " or ".join(f"{low:.3f} ({rule})" for rule, (low, _) in rules.items())
        edge = f"{column.label}: {'outliers up to' if column.below else 'none down to'} {end:.3f}"
        notes.append(f"{edge}, lower bound {bounds}: {' and '.join(sorted(fits)) or 'neither'}")
        common &= fits
    shown = quote("sg_drl_outliers_max", "sg_ours_outliers_max", "mc_ours_whisker_low", "mc_drl_outliers")
    return finding("The same rule for outliers in every column", shown, "; ".join(notes), bool(common) or None)


def teacher_outliers() -> Finding:
    """Test whether the outliers are k episodes at the minimum, and others that differ little."""
    column, sums = Column(SIMPLEGOAL, "drl"), []
    (p,), n = column.outliers, column.n
    for k in range(1, p.size):
        pit = [Part(k, p.low, 0, p.low, p.low)]
        other, std = (
            statistics.remaining_mean(p.size, p.mean, pit),
            statistics.remaining_std(p.size, p.mean, p.std, pit),
        )
        if std <= p.high - other:  # false for NaN: k at the minimum alone would spread wider than printed
            sums.append(f"{k} at {p.low:g} and {p.size - k} with mean {other:.2f} and std {std:.1f}")
    near, reward = n * (GOAL_EDGE + STRIDE) ** 2, printed_value("sg_goal_reward")
    text = (
        f"{p.size} = {' or '.join(sums) or 'no such sum'}. From {near:.0f} of {n} starts one step can reach the goal, "
        f"which earns exactly {reward:g} if this replaces the reward of the step, and the progress of the step besides "
        "if it is added: a mean so close to it speaks for the first"
    )
    shown = quote(*(f"sg_drl_outliers{name}" for name in ("", "_mean", "_std", "_min", "_max")), "sg_goal_reward")
    return finding("SimpleGoal: what the teacher's outliers are", shown, text, len(sums) == 1 or None)


def outlier_moments() -> Finding:
    """Check that shares of outliers are whole numbers of episodes, and that deviations are possible in their ranges."""
    ours, notes, agrees = Column(MOUNTAINCAR, "ours"), [], True
    for side, part in zip(("below", "above"), ours.outliers):
        share = 100 * part.size / ours.n_outliers
        notes.append(f"{part.size}/{ours.n_outliers} = {share:.3f} %")
        agrees &= rounds_to(share, printed_value(f"mc_ours_outliers_{side}_share"))
    for column in all_columns():
        for part in column.outliers:
            most = statistics.greatest_std(part.mean, part.low, part.high)
            notes.append(f"{column.label}, {part.size} outliers: std {part.std:.3f} of at most {most:.3f}")
            agrees &= part.std <= most
    shown = quote("mc_ours_outliers", "mc_ours_outliers_below_share", "mc_ours_outliers_above_share")
    return finding("Shares and moments of outliers", shown, "; ".join(notes), agrees)


def printed_twice() -> Finding:
    """Compare, digit by digit, the numbers that the paper prints in two places."""
    pairs = {}
    for column in all_columns():
        task, subject = column.name.split("_")
        total = "total_episodes" if subject == "ours" else "drl_episodes"
        for metric in ("min", "max", "mean", "std"):
            pairs[f"{column.label} {metric}"] = printed_value(f"{column.name}_{metric}"), column.values[metric]
        pairs[f"{column.label} IQR"] = round(column.values["q3"] - column.values["q1"], 3), column.values["iqr"]
        pairs[f"{column.label} episodes"] = column.n, printed_value(f"{task}_caption_{total}")
    for task, name in PREFIX.items():
        pairs[f"{SHORT[task]} cells"] = printed_value(f"{name}_cells"), len(printed.linear_policies(task))
    differ = [f"{name} {a:g} and {b:g}" for name, (a, b) in pairs.items() if a != b]
    text = f"{len(pairs) - len(differ)} of {len(pairs)} pairs are equal; others: {', '.join(differ) or 'none'}"
    shown = "min, max, mean, std (text; T5, T6); Q3 - Q1 and IQR (T5, T6); episodes (protocol; captions); "
    return finding("Numbers printed twice", shown + "cells (text; T3, T4)", text, not differ)


def return_limits() -> Finding:
    """Compare the returns with their limits.

    On SimpleGoal an episode earns its progress to the last state before the goal, and then the goal's reward.
    """
    goal, factor, *sides = map(printed_value, ("sg_goal_reward", "sg_reward_factor", "sg_size_x", "sg_size_y"))
    x, y = np.meshgrid(*((np.arange(1000) + 0.5) / 1000 * side for side in sides))  # starts
    bound = np.maximum(goal, goal + factor * (np.hypot(x, y) - GOAL_EDGE)).mean()
    best = goal + factor * (np.hypot(*sides) - GOAL_EDGE)
    table = pd.DataFrame({column.name: column.values for column in all_columns()}).T
    highest, mean = table.loc[["sg_drl", "sg_ours"], ["max", "mean"]].max()
    lowest, top = table.loc[["mc_drl", "mc_ours"], "min"].min(), table.loc[["mc_drl", "mc_ours"], "max"].max()
    reward = printed_value("mc_goal_reward")
    text = (
        f"SimpleGoal: {highest:.3f} of at most {goal:g} + {factor:g} * ({np.hypot(*sides):.4f} - {GOAL_EDGE:g}) = "
        f"{best:.3f}, the mean over uniform starts {mean:.3f} of {bound:.3f}. MountainCar: {top:.3f} of at "
        f"most {reward:g}; every episode reached the goal, for without it none earns more than 0, and the lowest "
        f"return is {lowest:.3f}"
    )
    agrees = highest <= best and mean <= bound and 0 < lowest and top <= reward
    shown = quote("sg_ours_max", "sg_drl_mean", "mc_ours_min", "mc_ours_max")
    return finding("Returns within the limits of the tasks", shown, text, agrees)


# The printed policies: T3 and T4


def printed_digits() -> Finding:
    """Test three meanings of "rounded to 4 digits" on all coefficients and codewords of T3 and T4."""
    ids = ["sg_table_digits", "mc_table_digits"]
    rows, digits = printed.printed_values(), printed_value(ids[0])
    numbers = rows.loc[rows["id"].str.contains("_cell_"), "paper"].str.lstrip("-")
    counts = {
        "decimals": numbers.str.partition(".")[2].str.len(),
        "digits": numbers.str.replace(".", "").str.len(),
        "significant digits": numbers.str.replace(".", "").str.lstrip("0").str.len(),
    }
    notes = [f"{(n == digits).sum()} have {digits:g} {kind} (all {n.min()} to {n.max()})" for kind, n in counts.items()]
    agrees = any((n == digits).all() for n in counts.values())
    text = f"Of {len(numbers)} numbers {', '.join(notes)}"
    return finding("T3 and T4: coefficients rounded to four digits", quote(*ids), text, agrees, ids)


def close_pairs(task: str, table: str) -> Finding:
    """Find pairs of codewords, and neighbours' parameters, closer than the thresholds of splits and merges."""
    policy, limits = printed.published_policy(task), printed.printed_hyperparameters(task)
    codewords, (i, j) = policy.codewords, np.triu_indices(len(policy), 1)
    gaps, neighbours = np.abs(policy.coefficients[i] - policy.coefficients[j]), delaunay_neighbours(codewords)[i, j]
    close = {
        norm: distances(codewords, codewords, norm)[i, j] < limits["min_pol_distance"]
        for norm in ("manhattan", "euclidean")
    }
    for name, terms in (("parameters", gaps), ("weights", gaps[:, :-1])):
        alike = terms.max(axis=(1, 2)) < limits["min_param_distance"]
        close[f"L-infinity of all {name}, neighbours"] = neighbours & alike
    notes = []
    for name, mask in close.items():
        rows = ", ".join(f"{a + 1}-{b + 1}" for a, b in zip(i[mask], j[mask]))
        notes.append(f"{name}: {mask.sum()}" + f" (rows {rows})" * bool(rows))
    ids = [f"{PREFIX[task]}_hyper_{name}" for name in ("min_pol_distance", "min_param_distance")]
    text = f"of {len(i)} pairs, {neighbours.sum()} of them Delaunay neighbours, are closer in {'; '.join(notes)}"
    return finding(f"{table}: pairs closer than the thresholds", quote(*ids), text, None)


def dimensions() -> Finding:
    """Compare the coordinates and outputs counted in T3 and T4 with those that the text states."""
    frames = [printed.linear_policies(task) for task in printed.TASKS]
    states, actions = ([frame.filter(like=like).shape[1] for frame in frames] for like in ("codeword_", "_printed"))
    text = f"coordinates of codewords (T3, T4): {states}; outputs: {actions}"
    agrees = set(states) == {printed_value("state_dimensions")} and set(actions) == {printed_value("action_dimensions")}
    shown = quote("state_dimensions", "action_dimensions")
    return finding("Dimensions of states and actions", shown, text, agrees, ["action_dimensions"])


CHECKS = (  # in the order in which the findings are shown
    run_counts, simplegoal_coverage, other_columns, mountaincar_quartiles, outlier_rules, teacher_outliers,
    outlier_moments, printed_twice, return_limits, printed_digits, partial(close_pairs, SIMPLEGOAL, "T3"),
    partial(close_pairs, MOUNTAINCAR, "T4"), dimensions, truncation, frozen_iterations,
)  # fmt: skip


def audit_findings() -> list[Finding]:
    """Compute all findings."""
    return [check() for check in CHECKS]


def in_doubt() -> set[str]:
    """Return the ids of the printed values that a contradiction puts in doubt."""
    return {id for check in audit_findings() for id in check.concerns}


def audit_table(findings: list[Finding]) -> pd.DataFrame:
    """Return one row per finding: number, finding, printed, arithmetic, verdict."""
    rows = [(i, f.title, f.printed, f.arithmetic, f.verdict) for i, f in enumerate(findings, start=1)]
    return pd.DataFrame(rows, columns=["number", "finding", "printed", "arithmetic", "verdict"])
