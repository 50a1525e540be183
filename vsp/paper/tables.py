"""Tables: frames in, LaTeX (booktabs) and CSV out. The CSV holds the numbers, the LaTeX the text for readers."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pandas as pd

from ..checks import check_array, check_count
from ..config import paper_preset
from ..export import codeword_latex, equations_latex, symbol
from ..policy import VoronoiPolicy
from ..run import atomic
from ..show.captions import caption_of
from ..show.style import FORCE_MAP
from .printed import PREFIX, SHORT, check_task, printed_hyperparameters, printed_spread, printed_text_numbers
from .readings import defaults
from .results import write_results
from .runs import SHARES, Experiment, Results, Run, outcome_shares
from .shown import as_text, present, show_table
from .statistics import interval, outlier_numbers, spread

if TYPE_CHECKING:
    from IPython.display import HTML

PAGE = 40  # rows that fit on one page


def save_table(
    frame: pd.DataFrame, name: str, *, out: str | os.PathLike, shown: pd.DataFrame | None = None,
    caption: str | None = None,
) -> HTML:  # fmt: skip
    """Write OUT/figures/tables/NAME.csv and .tex; return the table as HTML for a notebook.

    `shown` replaces the whole table for readers: a part of it, or equations as LaTeX code. The default `caption` is in
    notebooks/captions.toml. The LaTeX needs the packages booktabs and xcolor, and longtable for more than `PAGE` rows.
    """
    path, shown = Path(out) / "figures" / "tables" / name, frame if shown is None else shown
    rounded = frame.map(lambda value: float(f"{value:.8g}") if isinstance(value, float) else value)
    atomic.write_text(path.with_suffix(".csv"), rounded.to_csv(index=False, lineterminator="\n"))
    about, code = caption_of("tables", name, text=caption), as_text(present(shown)).map(_escape).rename(columns=_escape)
    place = {"environment": "longtable"} if len(code) > PAGE else {"position": "t", "position_float": "centering"}
    styled = code.style.hide(axis="index")
    body = styled.to_latex(hrules=True, caption=_escape(about.text), label=f"tab:{name}", **place)
    atomic.write_text(path.with_suffix(".tex"), body)
    return show_table(shown, name, caption=caption)


def hyperparameter_table(tasks: list[str]) -> pd.DataFrame:
    """Return T2 as printed and as configured here: one row per hyperparameter, two columns per task."""
    names = printed_hyperparameters(tasks[0])
    columns = {"hyperparameter": list(names)}
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


def equation_table(policy: VoronoiPolicy, *, digits: int | None = 3, swatch: bool = False) -> pd.DataFrame:
    """Return T3 or T4: one row per cell, with its codeword and one equation per action, in LaTeX.

    `swatch` puts a patch before each equation, in the force map's colour of the action at the codeword (one action).
    """
    rows = []
    for i, codeword in enumerate(policy.codewords):
        row = {"codeword": codeword_latex(policy, i, digits)}
        patches = [_patch(action) if swatch else "" for action in policy.predict(codeword)[0]]
        for output, patch, equation in zip(policy.task.outputs, patches, equations_latex(policy, i, digits)):
            row[f"${symbol(output)}$"] = patch + equation
        rows.append(row)
    return pd.DataFrame(rows)


def show_policy(policy: VoronoiPolicy, *, digits: int | None = 3, caption: str = "") -> HTML:
    """Return the policy as HTML for a notebook: its equations, below `caption`, the distance and the action limits.

    `digits`: decimals of the numbers; None: as many as they have. Raises ValueError unless the sub-policies are linear.
    """
    policy.check_linear()
    frame, task = equation_table(policy, digits=digits), policy.task
    where = "Each row holds where its codeword is the nearest" if len(policy) > 1 else "One map for all states"
    units = (
        "" if (policy.scale == 1).all() else f" of states divided by ({', '.join(f'{u:.3g}' for u in policy.scale)})"
    )
    distance = f" ({policy.metric.capitalize()} distance{units})" if len(policy) > 1 else ""
    limits = ", ".join(f"{name} from {low:g} to {high:g}" for name, low, high in
                       zip(task.outputs, task.action_low, task.action_high))  # fmt: skip
    about = f"{caption} {where}{distance}. Limits: {limits}.".strip()
    return show_table(frame if len(policy) > 1 else frame.drop(columns="codeword"), caption=about)


def spread_table(task: str, teacher: np.ndarray, runs: np.ndarray) -> pd.DataFrame:
    """Return T5 or T6: the paper's columns beside the rerun's. `teacher` (n,) and `runs` (p, n) are returns.

    Coverage is in percent.
    """
    printed, columns = printed_spread(task), {}
    teacher, runs = _returns(teacher, runs)
    for name, values in (("drl", teacher), ("ours", runs)):
        here = spread(values) | {"median/q2": spread(values)["median"]}
        found = [here[metric.lower()] * (100 if metric == "Coverage" else 1) for metric in printed.index]
        label = {"drl": "teacher", "ours": "distilled"}[name]
        columns |= {f"{label}, paper": printed[name].to_numpy(), f"{label}, here": found}
    return pd.DataFrame({"metric": printed.index, **columns})


def text_number_table(task: str, teacher: np.ndarray, runs: np.ndarray, *, cells: int) -> pd.DataFrame:
    """Return N: the numbers of the running text beside the rerun's; NaN where the paper gives none.

    `teacher` (n,) and `runs` (p, n) are returns, `cells` the number of cells of the best policy.
    """
    known, rows = printed_text_numbers(check_task(task)), []
    teacher, runs = _returns(teacher, runs)
    check_count("cells", cells)
    printed = known["value"]
    for subject, values in (("drl", teacher), ("ours", runs)):
        numbers = outlier_numbers(values)
        if subject == "ours":
            means = runs.mean(axis=1)
            numbers |= {"lowest_run_mean": means.min(), "highest_run_mean": means.max()}
            numbers["runs_above_teacher_share"] = 100 * np.mean(means > teacher.mean())
        rows += [(task, f"{PREFIX[task]}_{subject}_{name}", value) for name, value in numbers.items()]
    rows.append((task, f"{PREFIX[task]}_cells", cells))
    rows = [(task, name, _like(printed.get(name, np.nan), value), value) for task, name, value in rows]
    frame = pd.DataFrame(rows, columns=["task", "id", "paper", "here"], dtype=object)
    for place, column in ((2, "subject"), (3, "quantity")):
        frame.insert(place, column, frame["id"].map(known[column]).fillna(""))
    return frame


def _returns(teacher: np.ndarray, runs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Check and return the returns of the teacher (n,) and of the runs (p, n). Raises ValueError."""
    return check_array("teacher's returns", teacher, (-1,)), check_array("runs' returns", runs, (-1, len(teacher)))


def _like(printed: float, here: float) -> float | int:
    """Return the paper's value, as an integer if the rerun's is a count."""
    return int(printed) if isinstance(here, int) and not np.isnan(printed) else float(printed)


def _escape(text: str) -> str:
    """Escape text for LaTeX and typeset minus signs; mathematics between dollars stays as it is."""
    parts = re.split(r"(\$[^$]*\$|\\textcolor.*?}} )", text)
    parts[::2] = [re.sub(r"([_%&])", r"\\\1", part) for part in parts[::2]]
    parts[::2] = [re.sub(r"(?<![\w.)-])-(?=\d)", "$-$", part) for part in parts[::2]]
    return "".join(parts)


def _patch(force: float) -> str:
    colour = mpl.colors.to_hex(mpl.colormaps[FORCE_MAP]((force + 1) / 2)).lstrip("#").upper()
    return rf"\textcolor[HTML]{{{colour}}}{{\rule{{1.2em}}{{1.4ex}}}} "


def run_summary(runs: list[Run], experiment: Experiment) -> pd.DataFrame:
    """Return one row per run: seed, cells, splits, merges, spread of the returns and shares of the outcomes."""
    rows = []
    for run in runs:
        counts = {"seed": run.seed, "cells": len(run.policy), "splits": run.splits, "merges": run.merges}
        scores = {"validation_mean": run.validation_mean, **spread(run.outcomes.returns)}
        rows.append({**experiment.provenance, **counts, **scores, **outcome_shares(run.outcomes.outcomes)})
    return pd.DataFrame(rows)


def run_overview(results: Results) -> pd.DataFrame:
    """Return mean, lowest and highest value over the runs, one row per property of a run."""
    frame = run_summary(results.runs, results.experiment).rename(columns={"mean": "mean return"})
    found = frame[["cells", "splits", "merges", "mean return", *SHARES]].agg(["mean", "min", "max"]).T
    return found.set_axis(["mean over runs", "lowest", "highest"], axis=1)


def teacher_beside_runs(results: Results) -> dict[str, float]:
    """Compare the teacher with the distilled policies: means, and 95 % intervals that resample policies.

    Differences are taken start by start. "± if independent" is the half-width for independent episodes, which these
    are not.
    """
    teacher, runs = results.teacher_returns, results.returns
    means = runs.mean(axis=1)
    low, high = interval(means, np.mean, vectorized=True)
    gap_low, gap_high = interval((runs - teacher).mean(axis=1), np.mean, vectorized=True)
    return {
        "teacher, mean": teacher.mean(), "distilled, mean": runs.mean(),
        "95 % interval from": low, "to": high, "± of it": (high - low) / 2,
        "± if independent": 1.96 * runs.std(ddof=1) / np.sqrt(runs.size),
        "difference, from": gap_low, "difference, to": gap_high,
        "runs above the teacher": np.mean(means > teacher.mean()),
        "lowest run": means.min(), "median run": np.median(means), "highest run": means.max(),
    }  # fmt: skip


def write_summary(results: Results, *, out: str | os.PathLike) -> None:
    """Write the summary of the runs to OUT/data/results/TASK.csv."""
    write_results(run_summary(results.runs, results.experiment), results.experiment.task, out=out)
