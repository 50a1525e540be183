"""Compare the committed tables with those just made in another folder: `python .ci/compare.py FOLDER`.

On the CPU type that the committed tables were made on, every table must be the same to the byte. On another, rounding
may send runs down other paths: then what does not come from runs must be the same to the byte, and the numbers of the
distilled policies and of the teacher must lie inside simultaneous 99.9 % intervals, from resampled policies and from
resampled episodes (Bonferroni over all numbers compared): a few episodes of a network end elsewhere too.
"""

import filecmp
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import norm

from vsp import experiments, store
from vsp.evaluate import outlier_numbers, spread
from vsp.machine import cpu_type
from vsp.paper import PREFIX

TABLES = Path("figures/tables")
FIXED = (  # tables that no run of this machine enters
    "hyperparameters", "tdavq_comparison", "audit", "readings_study", "teacher_study", "trust", "scale", "cluster",
)  # fmt: skip
SPREAD = {"Mean": "mean", "Std": "std", "Q1": "q1", "Median/Q2": "median", "Q3": "q3", "IQR": "iqr"}
OUTLIERS = ("outliers", "whisker_low", "whisker_high")
Z = norm.isf(0.001 / 2 / (2 * len(PREFIX) * (len(SPREAD) + len(OUTLIERS))))


def different(made: Path, names: list[str]) -> list[str]:
    """Those of the committed tables `names` that are missing in `made` or differ in a byte."""
    _, differing, missing = filecmp.cmpfiles(TABLES, made / TABLES, names, shallow=False)
    return differing + missing


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
    for column, subject in (("TD3, here", "drl"), ("distilled, here", "ours")):
        values = {name: table.at[metric, column] for metric, name in SPREAD.items()}
        both.append(values | {name: text[f"{PREFIX[task]}_{subject}_{name}"] for name in OUTLIERS})
    return both[0], both[1]


def implausible(made: Path, task: str) -> list[str]:
    """The statistics of `task` whose committed value is implausible given the runs in `made`."""
    results = experiments.paper_results(task, runs=made / "data" / "runs")
    rng, wrong = np.random.default_rng(0), []
    made_returns = (results.teacher_returns, results.returns)
    for subject, then, returns in zip(("TD3", "distilled"), committed(task), made_returns, strict=True):
        draws = [statistics(returns[rng.integers(len(returns), size=len(returns))]) for _ in range(1000)]
        for name, value in statistics(returns).items():
            allowed = Z * np.sqrt(2) * np.std([draw[name] for draw in draws]) + (name == "outliers")
            print(f"{task} {subject} {name}: committed {then[name]:.6g}, made {value:.6g}, allowed {allowed:.3g}")
            if abs(then[name] - value) > allowed:
                wrong.append(f"{task} {subject} {name}")
    return wrong


def main() -> None:
    made = Path(sys.argv[1])
    names = sorted(path.name for path in TABLES.iterdir())
    if store.read_listed("data/results/made_on.txt").decode().strip() == cpu_type():
        wrong, rule = different(made, names), "the same bytes, on the same CPU type"
    else:
        wrong = different(made, [name for name in names if name.startswith(FIXED)])
        wrong += [name for task in PREFIX for name in implausible(made, task)]
        rule = "inside the intervals, on another CPU type"
    if wrong:
        sys.exit(f"differ: {', '.join(wrong)}")
    print(f"all tables are {rule}")


if __name__ == "__main__":
    main()
