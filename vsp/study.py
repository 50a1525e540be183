"""Results that take minutes or more, on disk: notebooks draw what is committed. `make study` makes two of them.

data/results/readings.csv and teachers.csv name the settings and the code they were made with, so that `stale` can tell.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from . import paper, readings_study, store, teachers_study, workers

RESULTS = store.ROOT / "data" / "results"
STUDIES = {"readings": readings_study, "teachers": teachers_study}


def read(name: str) -> pd.DataFrame:
    """The committed results called `name`: "readings", "teachers", or what other modules have put beside them."""
    return store.read_table(RESULTS / f"{name}.csv", dtype={"settings": str, "code": str})


def stale() -> list[str]:
    """Which committed results were made with other settings or code than today's, in words; empty if none."""
    tried = readings_study.variants().values()
    today = {
        "readings": {readings_study.experiment(task, change).id for task in paper.TASKS for change in tried},
        "teachers": {experiment.id for experiment in teachers_study.experiments().values()},
    }
    found = []
    for name, settings in today.items():
        path = RESULTS / f"{name}.csv"
        if not path.exists():
            found.append(f"data/results/{name}.csv is missing: `make study` makes it")
            continue
        try:
            frame = read(name)
        except store.DamagedFile as error:
            found.append(str(error))
            continue
        parts = {
            "settings": set(frame["settings"].dropna()) != settings,
            "code": set(frame["code"].dropna()) != {STUDIES[name].code()},
        }
        if old := [part for part, differs in parts.items() if differs]:
            found.append(f"data/results/{name}.csv was made with other {' and '.join(old)}: `make study` makes it anew")
    return found


def main() -> None:
    """Make the runs of both studies, or those that are missing, and write their results."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="results go to OUT/data/results, runs to OUT/build/study")
    parser.add_argument("--jobs", type=workers.jobs, default=-1, help=workers.JOBS)
    parser.add_argument("--check", action="store_true", help="only say which results are stale")
    arguments = parser.parse_args()
    if arguments.check:
        from . import beyond

        found = [*stale(), *beyond.stale(RESULTS)]
        print(*found, sep="\n", end="\n" if found else "")
        return
    runs, results = Path(arguments.out) / "build" / "study", Path(arguments.out) / "data" / "results"
    for name, study in STUDIES.items():
        frame = study.study(runs, jobs=arguments.jobs)
        store.write_listed(results / f"{name}.csv", frame.to_csv(index=False, float_format="%.6f", lineterminator="\n"))


if __name__ == "__main__":
    with workers.in_one_line():
        main()
