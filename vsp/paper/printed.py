"""Values printed in the paper (arXiv:2511.13322): its tables, the numbers in its text, and policies ready to run.

The values are in `data/paper/*.csv`, as printed; column `where` names the place in the paper. A file is read only if
its bytes match the manifest of its folder; the listed files were checked against the paper.
"""

import ast
import io
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
import pandas as pd

from ..checks import check_choice
from ..policy import VoronoiPolicy
from ..run.atomic import data_folder
from ..run.listed import read_listed

FOLDER = data_folder("paper")
TASKS = ("SimpleGoal-v0", "MountainCarContinuous-v0")
PREFIX = {"SimpleGoal-v0": "sg", "MountainCarContinuous-v0": "mc"}  # prefixes of the ids of printed values
SUBJECTS = {"DRL": "teacher", "Ours": "distilled"}  # the paper's names, and ours
SHORT = {"SimpleGoal-v0": "SimpleGoal", "MountainCarContinuous-v0": "MountainCar"}


def printed_hyperparameters(task: str) -> dict[str, int | float | bool]:
    """Return the hyperparameters of `task` by their names in the paper (appendix, first table)."""
    rows = _read("hyperparameters.csv").set_index("hyperparameter")[check_task(task)]
    return {name: ast.literal_eval(text) for name, text in rows.items()}


def printed_spread(task: str) -> pd.DataFrame:
    """Return the spread of the returns on `task`: one row per metric (the index), columns drl, ours, unit, where.
    Coverage, the share of episodes that are not outliers, is in percent; all else is in units of return."""
    frame = _read("spread.csv", numbers=["drl", "ours"])
    return frame[frame["task"] == check_task(task)].drop(columns="task").set_index("metric")


def printed_spread_values(task: str, subject: str) -> dict[str, float]:
    """Return a column of T5 or T6, "drl" or "ours", under the names of `statistics.spread`; coverage in percent."""
    return {metric.lower().partition("/")[0]: value for metric, value in printed_spread(task)[subject].items()}


def printed_text_numbers() -> pd.DataFrame:
    """Return the numbers in running text and captions: one row per number, its id as index. Columns: task ("both" where
    one number serves both), quantity, subject ("DRL", "Ours", "task", "protocol"), value (NaN for a version or a name),
    unit, printed (the paper's spelling), where."""
    return _read("text_numbers.csv", numbers=["value"]).set_index("id")


def printed_value(id: str) -> float:
    """Return the value `id` of `printed_text_numbers()`; shares are in percent. Raises ValueError for other ids."""
    values = printed_text_numbers()["value"]
    check_choice("id", id, values.index)
    return float(values[id])


def spread_id(task: str, subject: str, metric: str) -> str:
    """The id of a value of T5 or T6: spread_id("SimpleGoal-v0", "ours", "Median/Q2") is "sg_spread_ours_median"."""
    return f"{PREFIX[check_task(task)]}_spread_{subject}_{metric.lower().partition('/')[0]}"


def printed_values() -> pd.DataFrame:
    """Return every number that the paper prints, in tables T2 to T6, text and captions: one row per value. Columns: id,
    task, where, quantity, subject, paper (the paper's spelling), value (NaN for a version or a name)."""
    text = _read("text_numbers.csv", numbers=["value"]).rename(columns={"printed": "paper"})
    rows = []
    for row in _read("spread.csv").to_dict("records"):
        for subject, who in (("drl", "DRL"), ("ours", "Ours")):
            name = spread_id(row["task"], subject, row["metric"])
            rows.append((name, row["task"], row["where"], row["metric"], who, row[subject]))
    for task in TASKS:
        for row in _read("hyperparameters.csv").to_dict("records"):
            name = row["hyperparameter"]
            rows.append((f"{PREFIX[task]}_hyper_{name}", task, row["where"], name, "protocol", row[task]))
        for k, row in enumerate(_read(f"{SHORT[task].lower()}_linear_policies.csv").to_dict("records"), start=1):
            for name in _numbers(row):
                if row[name] != "0":  # 0 stands for a term that the paper does not print
                    rows.append((f"{PREFIX[task]}_cell_{k}_{name}", task, row["where"], name, "Ours", row[name]))
    tables = pd.DataFrame(rows, columns=["id", "task", "where", "quantity", "subject", "paper"])
    tables["value"] = [float(ast.literal_eval(printed)) for printed in tables["paper"]]
    return pd.concat([text[tables.columns], tables], ignore_index=True)


def printed_tdavq_comparison() -> pd.DataFrame:
    """Return the paper's comparison with TD-AVQ in words: one row per aspect (index), columns TD-AVQ, Ours, where."""
    return _read("tdavq_comparison.csv").set_index("aspect")


def linear_policies(task: str) -> pd.DataFrame:
    """Return the best partition that the paper found for `task`: one row per cell, in the paper's order. Columns:
    codeword_<input>, then for each output <output>_<input> and <output>_bias (zero where the paper prints no such term)
    and <output>_printed, the expression as the paper prints it; for MountainCar also its colour."""
    frame = _read(f"{SHORT[check_task(task)].lower()}_linear_policies.csv")
    return frame.astype(dict.fromkeys(_numbers(frame), np.float64))


def published_policy(task: str) -> VoronoiPolicy:
    """Return the paper's best distilled policy for `task`, from its printed coefficients, ready to run."""
    frame = linear_policies(task)
    inputs = [name.removeprefix("codeword_") for name in frame if name.startswith("codeword_")]
    outputs = [name.removesuffix("_printed") for name in frame if name.endswith("_printed")]
    codewords = frame[[f"codeword_{name}" for name in inputs]].to_numpy()  # (k, d)
    terms = [*inputs, "bias"]
    coefficients = np.stack([frame[[f"{output}_{term}" for term in terms]] for output in outputs], axis=-1)
    return VoronoiPolicy(codewords=codewords, coefficients=coefficients, task=task)  # (k, d + 1, m)


def _numbers(columns: Iterable[str]) -> list[str]:
    return [name for name in columns if not name.endswith(("_printed", "colour", "where"))]


def check_task(task: str) -> str:
    """Return `task`. Raises ValueError for a task that is not in the paper."""
    check_choice("the paper's task", task, TASKS)
    return task


def _read(file: str, numbers: list[str] | None = None) -> pd.DataFrame:
    """Read the rows of `file` as text, the columns `numbers` as float64 (NaN where empty)."""
    frame = _parse(read_listed(FOLDER / file)).copy()
    for column in numbers or []:
        frame[column] = pd.to_numeric(frame[column]).astype(np.float64)
    return frame


@lru_cache  # the audit and the ledger read the same few tables hundreds of times
def _parse(content: bytes) -> pd.DataFrame:
    return pd.read_csv(io.BytesIO(content), dtype=str, keep_default_na=False, encoding="utf-8")
