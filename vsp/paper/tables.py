"""The tables of the paper beside the rerun's, and tables for readers.

`save_table` writes CSV, which holds the numbers, and LaTeX (booktabs), which holds the text for readers: headings in
words, percentages, each interval in one column, no row numbers.
"""

import math
import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..config import paper_preset
from ..export import codeword_latex, equations_latex, symbol
from ..policy import VoronoiPolicy
from ..protocol.intervals import interval
from ..run import atomic
from ..show.captions import caption_of, file_of, headings
from .printed import PREFIX, SHORT, check_task, printed_hyperparameters, printed_spread, printed_text_numbers
from .readings import defaults
from .results import write_results
from .runs import SHARES, Experiment, Results, Run
from .statistics import outlier_numbers, spread

if TYPE_CHECKING:
    from IPython.display import HTML

PAGE = 40  # rows that fit on one page
ROWS = 12  # a longer table is folded in a notebook
MISSING = "–"  # where there is no number
INTERVAL = "95 % interval"
_MINUS = r"(?<![\w.)-])-(?=\d)"
_FOR_NOTEBOOKS = {_MINUS: "−", r"(?<=\d) (?=%)": "\xa0", r"(?<=\d) to (?=[−\d])": "\xa0to\xa0"}
QUANTITIES = {"quantity", "statistic", "score", "of a run", "best run", "setting", "hyperparameter"}


# Tables for readers


def save_table(
    frame: pd.DataFrame, name: str, *, out: str | os.PathLike, shown: pd.DataFrame | None = None,
    caption: str | None = None,
) -> "HTML":  # fmt: skip
    """Write OUT/figures/tables/NAME.csv and .tex; return the table as HTML for a notebook.

    A name "beyond/x" writes OUT/figures/beyond/tables/x. `shown` replaces the whole table for readers: a part of it, or
    equations as LaTeX code. The default `caption` is in notebooks/captions.toml. The LaTeX needs the package booktabs,
    and longtable for more than `PAGE` rows."""
    path, shown = file_of("tables", name, out), frame if shown is None else shown
    rounded = frame.map(lambda value: float(f"{value:.8g}") if isinstance(value, float) else value)
    atomic.write_text(path.with_suffix(".csv"), rounded.to_csv(index=False, lineterminator="\n"))
    about, code = caption_of("tables", name, text=caption), as_text(present(shown)).map(_escape).rename(columns=_escape)
    place = {"environment": "longtable"} if len(code) > PAGE else {"position": "t", "position_float": "centering"}
    styled = code.style.hide(axis="index")
    body = styled.to_latex(hrules=True, caption=_escape(about.text), label=f"tab:{path.name}", **place)
    atomic.write_text(path.with_suffix(".tex"), body)
    return show_table(shown, name, caption=caption)


def show_table(frame: pd.DataFrame, name: str = "", *, caption: str | None = None) -> "HTML":
    """Return the frame as HTML for a notebook, below `caption` or that of table `name` in notebooks/captions.toml. A
    table of more than `ROWS` rows is folded below its caption. Numbers have true minus signs, and intervals do not
    wrap."""
    from IPython.display import HTML

    about, fold = caption_of("tables", name, text=caption), len(frame) > ROWS
    above = f"<caption>All {len(frame)} rows</caption>" if fold else about.to_html("caption")
    with pd.option_context("display.max_colwidth", None):
        page = as_text(present(frame)).map(_typeset).rename(columns=_typeset).to_html(index=False, border=0)
    page = page.replace(">", f">\n  {above}", 1) if above else page
    return HTML(f"<details>{about.to_html('summary')}\n{page}\n</details>" if fold else page)


def present(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the frame for readers.

    A named index becomes a column, tasks get their short names, true or false becomes "yes" or nothing ("no" among
    other values), and shares become percentages. `low` and `high` become one column of text, and headings are in words.
    Where each row is another quantity (`QUANTITIES`), a row of whole numbers has no decimals: they are counts."""
    frame = frame.reset_index(drop=frame.index.names == [None]).apply(_in_words)
    frame = _counts(frame) if QUANTITIES & {*frame} else frame
    for name in frame:
        if re.sub(r"_(low|high)$", "", str(name)) in headings()["percent"]:
            frame[name] = [MISSING if np.isnan(value) else f"{100 * value:.3g}" for value in frame[name].astype(float)]
    for low in [name for name in frame if re.search(r"(^|[_ ])low$", str(name))]:
        about = low.removesuffix("low")
        ends = as_text(frame[[low, f"{about}high"]]).set_axis(["low", "high"], axis=1)
        joined = (ends["low"] + " to " + ends["high"]).where(ends["low"] != MISSING, MISSING)
        heading = f"{_heading(about[:-1])}: {INTERVAL}" if about else INTERVAL
        frame = frame.assign(**{low: joined}).drop(columns=f"{about}high").rename(columns={low: heading})
    return frame.rename(columns=_heading)


def _in_words(column: pd.Series) -> pd.Series:
    no = "" if column.map(lambda value: isinstance(value, bool | np.bool_)).all() else "no"

    def word(value: object) -> object:
        if isinstance(value, bool | np.bool_):
            return "yes" if value else no
        return re.sub(r"^(\w+?)(Continuous)?-v\d$", r"\1", value) if isinstance(value, str) else value

    return column.map(word)


def _counts(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the frame with integers in the rows that have no other numbers."""
    numbers = frame.map(lambda value: isinstance(value, float) and math.isfinite(value))
    whole = (~numbers | frame.where(numbers, 0.0).map(lambda value: value == int(value))).all(axis=1)
    counts = numbers.mul(whole, axis=0)
    return frame.astype(object).mask(counts, frame.where(counts, 0).map(int))


def _heading(column: str) -> str:
    return (headings()["words"] | headings()["percent"]).get(column, column)


def as_text(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the frame as text. Floats have three decimals, or fewer if these hold the whole column. From 100 on they
    have fewer, so that five digits remain. All else stays as it is, apart from thousands separators."""
    return frame.apply(lambda column: column.map(lambda value: _text(value, _decimals(column))))


def _decimals(column: pd.Series) -> int:
    """Return the fewest decimals that hold all floats of a column, at most 3: counts are floats if one is missing."""
    values = np.array([value for value in column if isinstance(value, float) and math.isfinite(value)])
    return next((n for n in range(3) if np.array_equal(values.round(n), values)), 3)


def _text(value: Any, digits: int) -> str:
    if not isinstance(value, float):
        return f"{value:,}" if isinstance(value, int | np.integer) and abs(int(value)) >= 10_000 else str(value)
    if np.isnan(value):
        return MISSING
    if value and abs(value) < 0.001:
        return np.format_float_positional(value, 2, fractional=False)
    before = int(math.log10(abs(value))) + 1 if abs(value) >= 100 and math.isfinite(value) else 2
    thousands = "," if abs(value) >= 10_000 else ""
    return f"{value:{thousands}.{max(digits - before + 2, 0)}f}"


def _escape(text: str) -> str:
    """Escape text for LaTeX and typeset minus signs; mathematics between dollars stays as it is."""
    return _typeset(text, {r"([_%&])": r"\\\1", _MINUS: "$-$"})


def _typeset(text: str, signs: dict[str, str] = _FOR_NOTEBOOKS) -> str:
    """Replace `signs` (patterns) in text outside of mathematics: minus signs, and spaces where a line must not end."""
    parts = re.split(r"(\$[^$]*\$)", text)
    for pattern, sign in signs.items():
        parts[::2] = [re.sub(pattern, sign, part) for part in parts[::2]]
    return "".join(parts)


# The paper's tables


def hyperparameter_table(tasks: list[str]) -> pd.DataFrame:
    """Return T2 as printed and as configured here: one row per hyperparameter, two columns per task."""
    names = printed_hyperparameters(tasks[0])
    columns: dict[str, list] = {"hyperparameter": list(names)}
    for task in tasks:
        printed, here = printed_hyperparameters(task), paper_preset(task)
        columns[f"{SHORT[task]}, paper"] = [printed[name] for name in names]
        columns[f"{SHORT[task]}, here"] = [getattr(here, name) for name in names]
    return pd.DataFrame(columns, dtype=object)


def interpretation_table(task: str) -> pd.DataFrame:
    """List what the paper leaves open, apart from what T2 prints: one row per reading, with its default."""
    answers = defaults(paper_preset(task))
    rows = [(name, value) for name, value in answers.items() if name not in printed_hyperparameters(task)]
    return pd.DataFrame(rows, columns=["reading", "default"], dtype=object)


def equation_table(policy: VoronoiPolicy, *, digits: int | None = 3) -> pd.DataFrame:
    """Return T3 or T4: one row per cell, with its codeword and one equation per action, in LaTeX."""
    codewords = [codeword_latex(policy, i, digits) for i in range(len(policy))]
    equations = zip(*(equations_latex(policy, i, digits) for i in range(len(policy))))
    columns = {f"${symbol(name)}$": column for name, column in zip(policy.task.outputs, equations)}
    return pd.DataFrame({"codeword": codewords, **columns})


def show_policy(policy: VoronoiPolicy, *, caption: str = "") -> "HTML":
    """Return the policy as HTML for a notebook: its equations, below `caption`, the distance and the action limits.
    Raises ValueError unless the sub-policies are linear."""
    policy.check_linear()
    frame, task, where = equation_table(policy), policy.task, "One map for all states"
    if len(policy) > 1:
        sizes = ", ".join(f"{size:.3g}" for size in policy.scale)
        units = "" if (policy.scale == 1).all() else f" of states divided by ({sizes})"
        where = f"Each row holds where its codeword is the nearest ({policy.metric.capitalize()} distance{units})"
    else:
        frame = frame.drop(columns="codeword")
    boxes = zip(task.outputs, task.action_low, task.action_high)
    limits = ", ".join(f"{name} from {low:g} to {high:g}" for name, low, high in boxes)
    return show_table(frame, caption=f"{caption} {where}. Limits: {limits}.".strip())


def spread_table(task: str, teacher: np.ndarray, runs: np.ndarray) -> pd.DataFrame:
    """Return T5 or T6: the paper's columns beside the rerun's. `teacher` (n,) and `runs` (p, n) are returns. Coverage
    is in percent."""
    printed = printed_spread(task)
    table = pd.DataFrame({"metric": printed.index})
    for name, label, values in zip(("drl", "ours"), ("teacher", "distilled"), (teacher, runs)):
        here = spread(values)
        here |= {"coverage": 100 * here["coverage"], "median/q2": here["median"]}
        table[f"{label}, paper"] = printed[name].to_numpy()
        table[f"{label}, here"] = [here[metric.lower()] for metric in printed.index]
    return table


def text_number_table(task: str, teacher: np.ndarray, runs: np.ndarray, *, cells: int) -> pd.DataFrame:
    """Return N: the numbers of the running text beside the rerun's; NaN where the paper gives none. `teacher` (n,) and
    `runs` (p, n) are returns, `cells` the number of cells of the best policy."""
    known, prefix = printed_text_numbers(), PREFIX[check_task(task)]
    means = runs.mean(axis=1)
    distilled = outlier_numbers(runs) | {"lowest_run_mean": means.min(), "highest_run_mean": means.max()}
    distilled["runs_above_teacher_share"] = 100 * np.mean(means > teacher.mean())
    here = {f"{prefix}_drl_{name}": value for name, value in outlier_numbers(teacher).items()}
    here |= {f"{prefix}_ours_{name}": value for name, value in distilled.items()} | {f"{prefix}_cells": cells}
    frame = pd.DataFrame({"task": task, "id": [*here]})
    for column in ("subject", "quantity"):
        frame[column] = frame["id"].map(known[column]).fillna("")
    printed = [known["value"].get(name, np.nan) for name in here]
    counts = [isinstance(value, int) and not np.isnan(other) for value, other in zip(here.values(), printed)]
    frame["paper"] = pd.Series([int(x) if count else float(x) for x, count in zip(printed, counts)], dtype=object)
    return frame.assign(here=pd.Series([*here.values()], dtype=object))


# The runs


def run_summary(runs: list[Run], experiment: Experiment) -> pd.DataFrame:
    """Return one row per run: seed, cells, splits, merges, spread of the returns and shares of the outcomes."""
    rows = []
    for run in runs:
        counts = {"seed": run.seed, "cells": len(run.policy), "splits": run.splits, "merges": run.merges}
        scores = {"validation_mean": run.validation_mean, **spread(run.outcomes.returns)}
        shares = {name: np.mean(run.outcomes.outcomes == code) for name, code in SHARES.items()}
        rows.append({**experiment.provenance, **counts, **scores, **shares})
    return pd.DataFrame(rows)


def write_summary(results: Results, *, out: str | os.PathLike) -> None:
    """Write the summary of the runs to OUT/data/results/TASK.csv."""
    write_results(run_summary(results.runs, results.experiment), results.experiment.task, out=out)


def run_overview(results: Results) -> pd.DataFrame:
    """Return mean, lowest and highest value over the runs, one row per property of a run."""
    frame = run_summary(results.runs, results.experiment).rename(columns={"mean": "mean return"})
    table = frame[["cells", "splits", "merges", "mean return", "goal"]].agg(["mean", "min", "max"]).T
    return table.set_axis(["mean over runs", "lowest", "highest"], axis=1)


def teacher_beside_runs(results: Results) -> pd.DataFrame:
    """Compare the teacher with the distilled policies: means, and 95 % intervals (low, high) that resample policies.

    Differences are taken start by start. The interval for independent episodes is too short: they are not independent.
    """
    teacher, runs = results.teacher_returns, results.returns
    means, half = runs.mean(axis=1), 1.96 * runs.std(ddof=1) / np.sqrt(runs.size)
    gap = (runs - teacher).mean(axis=1)
    rows = {
        "teacher": (teacher.mean(), np.nan, np.nan),
        "distilled": (runs.mean(), *interval(means, np.mean, vectorized=True)),
        "  as if all episodes were independent": (runs.mean(), runs.mean() - half, runs.mean() + half),
        "distilled minus teacher": (gap.mean(), *interval(gap, np.mean, vectorized=True)),
        "median of the runs' means": (np.median(means), np.nan, np.nan),
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=["mean", "low", "high"])
