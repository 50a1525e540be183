"""The columns of T5 and T6, with the outliers that the text describes."""

from __future__ import annotations

import pandas as pd

from .. import printed
from ..printed import PREFIX, SHORT, printed_value
from ..statistics import Part, greatest_std, least_std, mean_range, quarters, remaining_mean, remaining_std


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
        mean = remaining_mean(n, self.values["mean"], self.outliers)
        std = remaining_std(n, self.values["mean"], self.values["std"], self.outliers)
        sizes = [sum(part.size for part in side) for side in (self.below, self.above)]
        groups = quarters(n, [self.low, *self.values[["q1", "median", "q3"]], self.high], *sizes)
        (a, b), (c, d) = mean_range(groups), (least_std(mean, groups), greatest_std(mean, self.low, self.high))
        text = f"of {n} the {n - sum(sizes)} others have mean {mean:.3f} (the quartiles allow {a:.3f} to {b:.3f}) and "
        return f"{text}std {std:.3f} ({c:.3f} to {d:.3f})", bool(a <= mean <= b and c <= std <= d)


def columns() -> list[Column]:
    """Return the columns of T5 and T6."""
    return [Column(task, subject) for task in printed.TASKS for subject in ("drl", "ours")]


def mean_inside(task: str, subject: str) -> float:
    """Return the mean return of the episodes without the outliers, from the printed totals and the printed outliers."""
    column = Column(task, subject)
    return remaining_mean(column.n, column.values["mean"], column.outliers)
