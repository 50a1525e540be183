"""The audit: do the numbers that the paper prints agree with each other, with its tables, and with its tasks?

Each finding is a function of the transcribed values in `data/paper`; `audit_findings()` runs them all.
Returns have no unit, shares are in percent. Standard deviations divide by n, as NumPy's do; n - 1 makes a difference
only for the 24 outliers of SimpleGoal's teacher.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from ..evaluation import fences, start_states
from ..rollouts import rollout
from ..tasks import GOAL, PIT, simplegoal
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
    agrees: bool | None  # None leaves the question open
    concerns: list[str] = field(default_factory=list)  # ids of the printed values that a contradiction puts in doubt

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        return OPEN if self.agrees is None else HOLDS if self.agrees else CONTRADICTS


def quote(*ids: str) -> str:
    """Quote printed values and their places, without the transcription's own remarks after a semicolon."""
    rows = printed.printed_values().set_index("id").loc[list(ids)].itertuples()
    return "; ".join(f"{row.quantity} {row.paper} ({row.where.partition(';')[0]})" for row in rows)


# Columns of T5 and T6


class Column:
    """A column of T5 or T6, and the numbers that the text adds. `values` are min, max, mean, std, q1, median, q3, iqr,
    and coverage in percent. `below` and `above` are the outliers that the text describes: at most one part each, none
    if it gives no mean."""

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
    return Finding("Number of distilled policies", quote(*ids), "; ".join(notes), not wrong, wrong)


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
    return Finding("Which iterations may change the partition", shown, text, agrees)


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
    return Finding("SimpleGoal: coverage and outliers of the distilled policies", shown, text, agrees, wrong)


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
    return Finding("MountainCar: quartiles of the distilled policies, in table and text", shown, text, agrees, wrong)


def outlier_rules() -> Finding:
    """Find the rule for outliers, which the paper does not state. A rule fits a side if the outliers there end beyond
    its bound. Without outliers it fits if no return is beyond it."""
    notes, common = [], {"1.5 IQR", "2 std"}
    for column in (Column(task, subject) for task in printed.TASKS for subject in ("drl", "ours")):
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
    return Finding("The same rule for outliers in every column", shown, "; ".join(notes), bool(common) or None)


def teacher_outliers() -> Finding:
    """Test whether the outliers are k episodes at the minimum, and others that differ little."""
    column, sums = Column(SIMPLEGOAL, "drl"), []
    (p,), n = column.outliers, column.n
    for k in range(1, p.size):
        pit = [Part(k, p.low, 0, p.low, p.low)]
        other = statistics.remaining_mean(p.size, p.mean, pit)
        std = statistics.remaining_std(p.size, p.mean, p.std, pit)
        if std <= p.high - other:  # false for NaN: k at the minimum alone would spread wider than printed
            sums.append(f"{k} at {p.low:g} and {p.size - k} with mean {other:.2f} and std {std:.1f}")
    near, reward = n * (GOAL_EDGE + STRIDE) ** 2, printed_value("sg_goal_reward")
    text = (
        f"{p.size} = {' or '.join(sums) or 'no such sum'}. From {near:.0f} of {n} starts one step can reach the goal, "
        f"which earns exactly {reward:g} if this replaces the reward of the step, and the progress of the step besides "
        "if it is added: a mean so close to it speaks for the first"
    )
    shown = quote(*(f"sg_drl_outliers{name}" for name in ("", "_mean", "_std", "_min", "_max")), "sg_goal_reward")
    return Finding("SimpleGoal: what the teacher's outliers are", shown, text, len(sums) == 1 or None)


def similar_spread() -> Finding:
    """Compare what a caption says of SimpleGoal's spread with T5."""
    drl, ours = (Column(SIMPLEGOAL, subject).values for subject in ("drl", "ours"))
    text = f"standard deviation {drl['std']} and {ours['std']}, mean {drl['mean']} and {ours['mean']}"
    shown = '"similar spread and performance in both settings" (caption of SimpleGoal\'s box plot)'
    return Finding("SimpleGoal: the caption on spread and performance", shown, text, ours["std"] < 2 * drl["std"])


def authors_environment() -> Finding:
    """Replay the published policy in SimpleGoal as the paper's first author published it later. In
    github.com/SenneDeproost/CM-GP, envs/simple_envs.py (commit 1cf9c35, March 2026), goal and pit replace the reward of
    the step, as here; but to touch the border ends an episode with -10."""

    def bordered(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moved, rewards, outcomes = simplegoal.step(states, actions)
        hit = ((moved == 0) | (moved == 1)).any(axis=1) & (outcomes != GOAL)
        return moved, np.where(hit, -10.0, rewards), np.where(hit, PIT, outcomes)

    policy, starts = printed.published_policy(SIMPLEGOAL), start_states(SIMPLEGOAL, 1000, 1)
    tasks = simplegoal.TASK, replace(simplegoal.TASK, step=bordered)
    here, there = (100 * np.mean(rollout(policy, task, starts).outcomes == GOAL) for task in tasks)
    coverage = spread_id(SIMPLEGOAL, "ours", "coverage")
    text = (
        f"the printed policy reaches the goal from {here:.1f} % of 1000 starts; from {there:.1f} % if the border ended "
        "an episode, as in the first author's later file (CM-GP, envs/simple_envs.py, 1cf9c35): the paper's experiment "
        "had no such rule. There goal and pit replace the reward of the step; the text adds them. Its TD3 "
        "(scripts/TD3.py) explores with noise and has layers of 256"
    )
    shown = quote("sg_goal_reward", "sg_pit_reward", coverage)
    return Finding("SimpleGoal: the border, and what goal and pit pay", shown, text, None)


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
    return Finding("Published policies: coefficients rounded to four digits", quote(*ids), text, agrees, ids)


def dimensions() -> Finding:
    """Compare the coordinates and outputs counted in T3 and T4 with those that the text states."""
    frames = [printed.linear_policies(task) for task in printed.TASKS]
    states, actions = ([frame.filter(like=like).shape[1] for frame in frames] for like in ("codeword_", "_printed"))
    text = f"coordinates of codewords (T3, T4): {states}; outputs: {actions}"
    agrees = set(states) == {printed_value("state_dimensions")} and set(actions) == {printed_value("action_dimensions")}
    shown = quote("state_dimensions", "action_dimensions")
    return Finding("Dimensions of states and actions", shown, text, agrees, ["action_dimensions"])


CHECKS = (  # in the order in which the findings are shown
    run_counts, simplegoal_coverage, similar_spread, mountaincar_quartiles, outlier_rules, teacher_outliers,
    authors_environment, printed_digits, dimensions, frozen_iterations,
)  # fmt: skip


def audit_findings() -> list[Finding]:
    """Compute all findings."""
    return [check() for check in CHECKS]


def in_doubt() -> set[str]:
    """Return the ids of the printed values that a contradiction puts in doubt."""
    return {id for finding in audit_findings() if finding.verdict == CONTRADICTS for id in finding.concerns}


def audit_table(findings: list[Finding]) -> pd.DataFrame:
    """Return one row per finding: number, finding, printed, arithmetic, verdict."""
    rows = [(i, f.title, f.printed, f.arithmetic, f.verdict) for i, f in enumerate(findings, start=1)]
    return pd.DataFrame(rows, columns=["number", "finding", "printed", "arithmetic", "verdict"])
