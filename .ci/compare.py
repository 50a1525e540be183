"""Compare the committed figures, tables and executed notebooks with those in a folder: `python .ci/compare.py FOLDER`.

On the CPU type in data/results/made_on.txt every file must have the same bytes. On another, rounding may change the
path of a run. There only tables are compared: those that do not depend on runs must have the same bytes; the statistics
of the distilled policies and of the teacher (a few of its episodes end differently too) must lie inside simultaneous
99.9 % intervals, from resampled policies and from resampled episodes, with Bonferroni's correction.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import norm

from vsp.paper import runs
from vsp.paper.printed import PREFIX
from vsp.paper.statistics import outlier_numbers, spread
from vsp.run import listed
from vsp.run.machine import cpu_type

FIGURES = Path("figures")
TABLES = FIGURES / "tables"
FIXED = ("hyperparameters", "tdavq_comparison", "audit", "readings_study", "teacher_study")  # made without new runs
SPREAD = {"Mean": "mean", "Std": "std", "Q1": "q1", "Median/Q2": "median", "Q3": "q3", "IQR": "iqr"}
OUTLIERS = ("outliers", "whisker_low", "whisker_high")
Z = norm.isf(0.001 / 2 / (2 * len(PREFIX) * (len(SPREAD) + len(OUTLIERS))))


def different(made: Path, paths: list[Path]) -> list[str]:
    """Those of the committed files `paths` that are missing in `made` or have other bytes."""
    return [str(p) for p in paths if not (made / p).is_file() or (made / p).read_bytes() != p.read_bytes()]


def statistics(returns: np.ndarray) -> dict[str, float]:
    facts, outliers = spread(returns), outlier_numbers(returns)
    return {**{name: facts[name] for name in SPREAD.values()}, **{name: outliers[name] for name in OUTLIERS}}


def committed(task: str) -> tuple[dict[str, float], dict[str, float]]:
    """The committed statistics of the teacher and of the distilled policies."""
    table = pd.read_csv(
        TABLES / f"{task.split('-')[0].lower().removesuffix('continuous')}_spread.csv", index_col="metric"
    )
    text = pd.read_csv(TABLES / "text_numbers.csv", index_col="id")["here"].astype(float)
    both = []
    for column, subject in (("teacher, here", "drl"), ("distilled, here", "ours")):
        values = {name: table.at[metric, column] for metric, name in SPREAD.items()}
        both.append(values | {name: text[f"{PREFIX[task]}_{subject}_{name}"] for name in OUTLIERS})
    return both[0], both[1]


def implausible(made: Path, task: str) -> list[str]:
    """The statistics of `task` whose committed value is implausible given the runs in `made`."""
    results = runs.paper_results(task, runs=made / "data" / "runs")
    rng, wrong = np.random.default_rng(0), []
    made_returns = (results.teacher_returns, results.returns)
    for subject, then, returns in zip(("teacher", "distilled"), committed(task), made_returns, strict=True):
        draws = [statistics(returns[rng.integers(len(returns), size=len(returns))]) for _ in range(1000)]
        for name, value in statistics(returns).items():
            allowed = Z * np.sqrt(2) * np.std([draw[name] for draw in draws]) + (name == "outliers")
            print(f"{task} {subject} {name}: committed {then[name]:.6g}, made {value:.6g}, allowed {allowed:.3g}")
            if abs(then[name] - value) > allowed:
                wrong.append(f"{task} {subject} {name}")
    return wrong


def main() -> None:
    made = Path(sys.argv[1])
    if listed.read_listed("data/results/made_on.txt").decode().strip() == cpu_type():
        paths = sorted(path for path in FIGURES.rglob("*") if path.is_file())
        wrong, right = different(made, paths), f"all {len(paths)} files of {FIGURES}/ have the same bytes"
    else:
        paths = sorted(path for path in TABLES.iterdir() if path.name.startswith(FIXED))
        wrong = different(made, paths) + [name for task in PREFIX for name in implausible(made, task)]
        right = f"another CPU type: {len(paths)} tables have the same bytes, the others are inside the intervals"
    if wrong:
        sys.exit(f"differ: {', '.join(wrong)}")
    print(right)


if __name__ == "__main__":
    main()
