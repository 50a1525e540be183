"""Compare the committed tables with those just made in another folder: `python .ci/compare.py FOLDER`.

On the CPU type that the committed tables were made on, every table must be the same to the byte. On another, rounding
may send runs down other paths: then the teacher's numbers must agree to 0.1 %, and those of the distilled policies
must lie inside simultaneous 99.9 % intervals, from resampled policies (Bonferroni over all numbers compared).
"""

import filecmp
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import norm

from vsp import experiments, tasks
from vsp.evaluate import spread

METRICS = {
    "Mean": "mean",
    "Std": "std",
    "Q1": "q1",
    "Median/Q2": "median",
    "Q3": "q3",
    "IQR": "iqr",
    "Coverage": "coverage",
}
TABLES = Path("figures/tables")
NAMES = {"SimpleGoal-v0": "simplegoal_spread.csv", "MountainCarContinuous-v0": "mountaincar_spread.csv"}
Z = norm.isf(0.001 / 2 / (len(METRICS) * len(NAMES)))


def same_bytes(made: Path) -> list[str]:
    """Names of the committed tables that are missing in `made` or differ."""
    names = sorted(path.name for path in TABLES.iterdir())
    _, different, missing = filecmp.cmpfiles(TABLES, made / TABLES, names, shallow=False)
    return different + missing


def within_intervals(made: Path, task: str) -> list[str]:
    """The metrics of `task` whose committed value is implausible given the runs in `made`."""
    committed = pd.read_csv(TABLES / NAMES[task]).set_index("metric")
    here = pd.read_csv(made / TABLES / NAMES[task]).set_index("metric")
    returns = experiments.returns(experiments.paper_runs(task, runs=made / "data" / "runs"))
    rng = np.random.default_rng(0)
    resampled = [spread(returns[rng.integers(len(returns), size=len(returns))]) for _ in range(1000)]
    wrong = []
    for metric, name in METRICS.items():
        factor = 100 if metric == "Coverage" else 1
        width = Z * np.sqrt(2) * factor * np.std([facts[name] for facts in resampled])  # both samples vary
        for column, allowed in (
            ("distilled, here", width),
            ("TD3, here", 1e-3 * abs(committed.at[metric, "TD3, here"])),
        ):
            a, b = committed.at[metric, column], here.at[metric, column]
            print(f"{task} {metric} {column}: committed {a}, made {b}, allowed difference {allowed:.4g}")
            if abs(a - b) > allowed:
                wrong.append(f"{task} {metric} {column}")
    return wrong


def main() -> None:
    made = Path(sys.argv[1])
    if (Path("data/results/made_on.txt")).read_text(encoding="utf-8").strip() == experiments.cpu_type():
        wrong, rule = same_bytes(made), "the same bytes (same CPU type)"
    else:
        wrong, rule = (
            sum((within_intervals(made, task) for task in tasks()), []),
            "inside the intervals (other CPU type)",
        )
    sys.exit(f"differ: {', '.join(wrong)}" if wrong else print(f"all tables are {rule}"))


if __name__ == "__main__":
    main()
