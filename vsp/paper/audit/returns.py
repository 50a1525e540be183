"""Findings about the returns: tables T5 and T6, and what the text says of them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...evaluation import fences
from ...tasks.simplegoal import GOAL_EDGE, STRIDE
from .. import printed, statistics
from ..printed import PREFIX, SHORT, printed_value, spread_id
from ..statistics import Part, greatest_std, remaining_mean, remaining_std, rounds_to
from .columns import Column, columns
from .finding import HOLDS, OPEN, Finding, compared, quote

SIMPLEGOAL, MOUNTAINCAR = printed.TASKS


def simplegoal_coverage() -> Finding:
    """Show that coverage and outliers need different totals; the moments decide which total is right."""
    ours, episodes = Column(SIMPLEGOAL, "ours"), printed_value("episodes_per_policy")
    n, size, printed = ours.n, ours.n_outliers, ours.values["coverage"]
    share = 1 - printed / 100
    other = int(round(size / share / episodes) * episodes)  # episodes of a whole number of policies
    text = (
        f"1 - {size}/{n} = {ours.coverage():.2f} %; {printed:g} % asks for {share * n:.0f} outliers or {other} "
        f"episodes. By the moments, {ours.moments(other)[0]}; {ours.moments(n)[0]}"
    )
    wrong = [spread_id(SIMPLEGOAL, "ours", "coverage")]
    shown = quote(*wrong, "sg_ours_outliers", "sg_total_episodes")
    agrees = rounds_to(ours.coverage(), printed)
    return compared("SimpleGoal: coverage and outliers of the distilled policies", shown, text, agrees, wrong)


def other_columns() -> Finding:
    """Check the coverage of all columns but SimpleGoal's Ours, and the moments of all but MountainCar's Ours."""
    notes, good, ids = [], True, []
    for column in columns():
        if column.name != "sg_ours":
            notes.append(f"{column.label}: 1 - {column.n_outliers}/{column.n} = {column.coverage():g} %")
            ids += [f"{column.name}_outliers", column.name.replace("_", "_spread_") + "_coverage"]
            good &= rounds_to(column.coverage(), column.values["coverage"])
        if column.name != "mc_ours":
            text, possible = column.moments(column.n)
            notes.append(f"{column.label}: {text}")
            good &= possible
    return compared("Coverage and moments of the other columns", quote(*ids), "; ".join(notes), good)


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
    return compared(
        "MountainCar: quartiles of the distilled policies, in table and text", shown, text, bool(agrees), wrong
    )


def outlier_rules() -> Finding:
    """Find the rule for outliers, which the paper does not state.

    A rule fits a side if the outliers there end beyond its bound. Without outliers it fits if no return is beyond it.
    """
    notes, common = [], {"1.5 IQR", "2 std"}
    for column in columns():
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
    return Finding("The same rule for outliers in every column", shown, "; ".join(notes), HOLDS if common else OPEN)


def teacher_outliers() -> Finding:
    """Test whether the outliers are k episodes at the minimum, and others that differ little."""
    column, found = Column(SIMPLEGOAL, "drl"), []
    (p,), n = column.outliers, column.n
    for k in range(1, p.size):
        pit = [Part(k, p.low, 0, p.low, p.low)]
        other, std = remaining_mean(p.size, p.mean, pit), remaining_std(p.size, p.mean, p.std, pit)
        if std <= p.high - other:  # false for NaN: k at the minimum alone would spread wider than printed
            found.append(f"{k} at {p.low:g} and {p.size - k} with mean {other:.2f} and std {std:.1f}")
    near, reward = n * (GOAL_EDGE + STRIDE) ** 2, printed_value("sg_goal_reward")
    text = (
        f"{p.size} = {' or '.join(found) or 'no such sum'}. From {near:.0f} of {n} starts one step can reach the goal, "
        f"which earns exactly {reward:g} if this replaces the reward of the step, and the progress of the step besides "
        "if it is added: a mean so close to it speaks for the first"
    )
    shown = quote(*(f"sg_drl_outliers{name}" for name in ("", "_mean", "_std", "_min", "_max")), "sg_goal_reward")
    return Finding("SimpleGoal: what the teacher's outliers are", shown, text, HOLDS if len(found) == 1 else OPEN)


def outlier_moments() -> Finding:
    """Check that shares of outliers are whole numbers of episodes, and that deviations are possible in their ranges."""
    ours, notes, good = Column(MOUNTAINCAR, "ours"), [], True
    for side, part in zip(("below", "above"), ours.outliers):
        share = 100 * part.size / ours.n_outliers
        notes.append(f"{part.size}/{ours.n_outliers} = {share:.3f} %")
        good &= rounds_to(share, printed_value(f"mc_ours_outliers_{side}_share"))
    for column in columns():
        for part in column.outliers:
            most = greatest_std(part.mean, part.low, part.high)
            notes.append(f"{column.label}, {part.size} outliers: std {part.std:.3f} of at most {most:.3f}")
            good &= part.std <= most
    shown = quote("mc_ours_outliers", "mc_ours_outliers_below_share", "mc_ours_outliers_above_share")
    return compared("Shares and moments of outliers", shown, "; ".join(notes), bool(good))


def printed_twice() -> Finding:
    """Compare, digit by digit, the numbers that the paper prints in two places."""
    pairs = {}
    for column in columns():
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
    return compared("Numbers printed twice", shown + "cells (text; T3, T4)", text, not differ)


def simplegoal_wording() -> Finding:
    """Compute ratios of the printed columns that the text calls similar. This is a judgement, so it is left open."""
    ours, drl = (Column(SIMPLEGOAL, subject).values for subject in ("ours", "drl"))
    lost, spread, iqr = drl["mean"] - ours["mean"], ours["std"] / drl["std"], ours["iqr"] / drl["iqr"]
    text = (
        f"std {ours['std']:.3f} / {drl['std']:.3f} = {spread:.2f}, IQR {ours['iqr']:.3f} / {drl['iqr']:.3f} = "
        f"{iqr:.2f}, mean lower by {lost:.3f}, which is {lost / drl['std']:.2f} std of DRL or "
        f"{100 * lost / drl['mean']:.1f} %, median lower by {drl['median'] - ours['median']:.3f}"
    )
    shown = "similar spread and performance (Navigation task, caption of the box plot), slight decrease (Performance)"
    return Finding("SimpleGoal: the similar spread and the slight decrease, by the table", shown, text, OPEN)


def return_limits() -> Finding:
    """Compare the returns with their limits.

    On SimpleGoal an episode earns its progress to the last state before the goal, and then the goal's reward.
    """
    goal, factor, *sides = map(printed_value, ("sg_goal_reward", "sg_reward_factor", "sg_size_x", "sg_size_y"))
    x, y = np.meshgrid(*((np.arange(1000) + 0.5) / 1000 * side for side in sides))  # starts
    limits = np.maximum(goal, goal + factor * (np.hypot(x, y) - GOAL_EDGE))
    best = goal + factor * (np.hypot(*sides) - GOAL_EDGE)
    table = pd.DataFrame({column.name: column.values for column in columns()}).T
    highest, mean = table.loc[["sg_drl", "sg_ours"], ["max", "mean"]].max()
    lowest, top = table.loc[["mc_drl", "mc_ours"], "min"].min(), table.loc[["mc_drl", "mc_ours"], "max"].max()
    reward = printed_value("mc_goal_reward")
    text = (
        f"SimpleGoal: {highest:.3f} of at most {goal:g} + {factor:g} * ({np.hypot(*sides):.4f} - {GOAL_EDGE:g}) = "
        f"{best:.3f}, the mean over uniform starts {mean:.3f} of {limits.mean():.3f}. MountainCar: {top:.3f} of at "
        f"most {reward:g}; every episode reached the goal, for without it none earns more than 0, and the lowest "
        f"return is {lowest:.3f}"
    )
    agrees = highest <= best and mean <= limits.mean() and 0 < lowest and top <= reward
    shown = quote("sg_ours_max", "sg_drl_mean", "mc_ours_min", "mc_ours_max")
    return compared("Returns within the limits of the tasks", shown, text, bool(agrees))
