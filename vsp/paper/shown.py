"""Tables for readers: headings in words, percentages, each interval in one column, no row numbers."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..checks import check_count
from ..show.captions import caption_of

if TYPE_CHECKING:
    from IPython.display import HTML

MISSING = "–"  # where there is no number
INTERVAL = "95 % interval"
HEADINGS = {
    "mean": "mean return",
    "std": "std of the returns",
    "r2": "R²",
    "r2_least": "lowest R²",
    "index": "sameness",
    "least": "lowest mean",
    "most": "highest mean",
    "worst": "worst 1 %",
    "error_teacher": "action error",
    "linear_error": "error of one map",
    "teacher_mean": "teacher's mean",
    "teacher_std": "teacher's std",
    "own": "teacher's return",
    "gap": "minus the teacher's",
    "parameters": "numbers",
    "untuned mean": "untuned: mean return",
    "untuned r2": "untuned: R²",
}
QUANTITIES = {"quantity", "statistic", "score", "of a run", "best run", "setting", "hyperparameter"}
PERCENT = {
    "failing": "failed (%)",
    "reached": "as good (%)",
    "rival reached": "rival as good (%)",
    "good": "as good (%)",
    "both": "both (%)",
    "off": "off by a tenth (%)",
    "near": "near the best (%)",
}


def present(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the frame for readers.

    Row names become a column, tasks get their short names, true or false becomes "yes" or nothing ("no" among other
    values), and shares become percentages. `low` and `high` become one column of text, and headings are in words. Where
    each row is another quantity (`QUANTITIES`), a row of whole numbers has no decimals: they are counts.
    """
    index = frame.index
    if index.names != [None] or (len(index) and isinstance(index[0], str)):
        frame = frame.reset_index(names=[name or " " * i for i, name in enumerate(index.names)])
    frame = frame.reset_index(drop=True).apply(_in_words)
    frame = _counts(frame) if QUANTITIES & {*frame} else frame
    for name in [name for name in frame if _about(name) in PERCENT]:
        frame[name] = [MISSING if value != value else f"{100 * value:.3g}" for value in frame[name].astype(float)]
    for low in [name for name in frame if re.search(r"(^|[_ ])low$", str(name))]:
        high, about = low.removesuffix("low") + "high", low.removesuffix("low")
        ends = as_text(frame[[low, high]])
        joined = (ends[low] + " to " + ends[high]).where(ends[low] != MISSING, MISSING)
        heading = f"{_heading(about[:-1])}: {INTERVAL}" if about else INTERVAL
        frame = frame.assign(**{low: joined}).drop(columns=high).rename(columns={low: heading})
    return frame.rename(columns=_heading)


def _in_words(column: pd.Series) -> pd.Series:
    no = "" if column.map(lambda value: isinstance(value, bool | np.bool_)).all() else "no"

    def said(value: object) -> object:
        if isinstance(value, bool | np.bool_):
            return "yes" if value else no
        return re.sub(r"^(\w+?)(Continuous)?-v\d$", r"\1", value) if isinstance(value, str) else value

    return column.map(said)


def _counts(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the frame with integers in the rows that have no other numbers."""
    numbers = frame.map(lambda value: isinstance(value, float) and math.isfinite(value))
    whole = (~numbers | frame.where(numbers, 0.0).map(lambda value: value == int(value))).all(axis=1)
    counts = numbers.mul(whole, axis=0)
    return frame.astype(object).mask(counts, frame.where(counts, 0).map(int))


def _about(column: str) -> str:
    """Return the quantity that a column or an end of its interval belongs to."""
    return re.sub(r"_(low|high)$", "", str(column))


def _heading(column: str) -> str:
    return PERCENT.get(column, HEADINGS.get(column, column))


def show_table(frame: pd.DataFrame, name: str = "", *, caption: str | None = None) -> HTML:
    """Return the frame as HTML for a notebook, below `caption` or that of table `name` in notebooks/captions.toml."""
    from IPython.display import HTML

    above = caption_of("tables", name, text=caption).to_html("caption")
    with pd.option_context("display.max_colwidth", None):
        page = as_text(present(frame)).to_html(index=False, border=0)
    return HTML(page.replace(">", f">\n  {above}", 1) if above else page)


def as_text(frame: pd.DataFrame, *, digits: int = 3) -> pd.DataFrame:
    """Return the frame as text.

    Floats have `digits` decimals, or fewer if these hold the whole column. From 100 on they have fewer, so that five
    digits remain. All else stays as it is, apart from thousands separators.
    """
    check_count("digits", digits, least=0)
    return frame.apply(lambda column: column.map(lambda value: _text(value, min(digits, _decimals(column)))))


def _decimals(column: pd.Series) -> int:
    """Return the fewest decimals that hold all floats of a column, at most 9: counts are floats if one is missing."""
    values = np.array([value for value in column if isinstance(value, float) and math.isfinite(value)])
    return next((n for n in range(9) if (values.round(n) == values).all()), 9)


def _text(value: object, digits: int) -> str:
    if not isinstance(value, float):
        return f"{value:,}" if isinstance(value, int | np.integer) and abs(value) >= 10_000 else str(value)
    if np.isnan(value):
        return MISSING
    if value and abs(value) < 0.001:
        return np.format_float_positional(value, 2, fractional=False)
    before = int(math.log10(abs(value))) + 1 if abs(value) >= 100 and math.isfinite(value) else 2
    thousands = "," if abs(value) >= 10_000 else ""
    return f"{value:{thousands}.{max(digits - before + 2, 0)}f}"
