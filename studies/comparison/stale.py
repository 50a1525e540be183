"""Find committed results that were made with other settings, another teacher or another version than today's.

`python -m studies.comparison.stale` prints them, or nothing if all are up to date. Not checked are the
tables that `make paper-figures` rewrites each time, and those of proofs, times, faults and speed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path

import pandas as pd

from vsp.paper import results
from vsp.paper.studies import interpretations, teachers
from vsp.run import atomic, command, sealed

from ..benchmarks import fits, lookup
from . import kept_robots, regret
from .kept import KEPT, kept_job, simplest_provenance
from .method_rows import Job, jobs_of, tables_of
from .method_tables import LONG, TASKS, WALKERS


def stale() -> list[str]:
    """List the results in data/beyond that are missing, damaged or out of date, one message each.

    The list is empty if all are up to date.
    """
    found = []
    for name, target, today in committed():
        try:
            differing = _differing(_provenance(results.RESULTS / name), today)
        except FileNotFoundError:
            found.append(f"data/beyond/{name} is missing: `make {target}` makes it")
        except atomic.DamagedFile as error:
            found.append(str(error))
        else:
            if differing:
                what = f"data/beyond/{name} was made with other {' and '.join(differing)}"
                found.append(f"{what}: `make {target}` makes it anew")
    return found


def committed() -> Iterator[tuple[str, str, Callable[[pd.DataFrame], Iterable[dict]]]]:
    """Yield the committed files: name, make target, and a function from a file's rows to their provenance today."""
    yield "readings.csv", "study", _readings
    yield "teachers.csv", "study", _teachers
    for task in (*TASKS, *LONG, *WALKERS):
        target = "beyond" if task in TASKS else "beyond-long"
        for table in tables_of(task):
            yield f"{table}_{task}.csv", target, partial(_rows, task, table)
            if table == "faithful":
                yield f"same_{task}.csv", target, partial(_pairs, task)
            if table in KEPT:
                yield f"{table}_{task}.policy", target, lambda _, about=(task, table): [kept_job(*about).provenance]
    yield "optimum.csv", "beyond", lambda _: [regret.provenance_of(*way) for way in regret.WAYS]
    for task in LONG:
        yield f"methods_{task}.policy", "beyond-long", lambda _, task=task: [simplest_provenance(task)]
    for task in WALKERS:
        for name in ("gait", "fewest"):
            yield f"{name}_{task}.csv", "beyond-long", lambda _, about=(name, task): [kept_robots.provenance_of(*about)]
    for benchmark in (lookup, fits):
        name = f"{benchmark.__name__.rpartition('.')[2]}.csv"
        yield name, "lookup", lambda _, benchmark=benchmark: [benchmark.made_with()]


def _differing(frame: pd.DataFrame, today: Callable[[pd.DataFrame], Iterable[dict]]) -> list[str]:
    """Return the columns in which the provenance of the rows differs from today's; none if it is up to date."""
    now = pd.DataFrame(list(today(frame)))
    columns = [name for name in (*results.PROVENANCE, "seed", "other") if name in now]
    now, then = now[columns].astype(str), frame.reindex(columns=columns).dropna(how="all").astype(str)
    count = Counter if "seed" in now else set  # with a seed, each row stands for one job
    if count(map(tuple, now.to_numpy())) == count(map(tuple, then.to_numpy())):
        return []
    return [name for name in columns if set(now[name]) != set(then[name])] or ["rows"]


def _provenance(path: Path) -> pd.DataFrame:
    """Read the rows of a table, or the metadata of a policy as one row."""
    if path.suffix == ".policy":
        return pd.DataFrame([sealed.load_arrays(path, kind="VoronoiPolicy")[1]])
    frame = results.read_results(path.stem, path.parent)
    return frame.assign(teacher=frame["checksum"]) if "checksum" in frame else frame


def _readings(frame: pd.DataFrame) -> Iterable[dict]:
    """Yield today's provenance of the readings. All variants are ranked; the rows show which were also confirmed."""
    seeds = {"choosing": interpretations.CHOOSING, "confirming": interpretations.CONFIRMING}
    confirmed = set(frame.loc[frame["phase"] == "confirming", "variant"])
    for (name, _), experiment in interpretations.experiments(interpretations.variants()).items():
        for phase in seeds if name in confirmed else ("choosing",):
            yield interpretations.provenance_of(experiment, seeds[phase])


def _teachers(frame: pd.DataFrame) -> Iterable[dict]:
    for experiment in teachers.experiments().values():
        yield from ({**teachers.provenance_of(experiment), "seed": seed} for seed in teachers.SEEDS)


def _rows(task: str, table: str, frame: pd.DataFrame) -> Iterable[dict]:
    made_with: dict[Job, dict] = {}  # the same for all seeds
    for job in jobs_of(task, table):
        kind = replace(job, seed=0)
        if kind not in made_with:
            made_with[kind] = kind.provenance
        yield {"seed": job.seed, **made_with[kind]}


def _pairs(task: str, frame: pd.DataFrame) -> Iterable[dict]:
    """Yield today's provenance of each pair of seeds whose faithful policies are compared."""
    seeds: dict[Job, list[int]] = {}
    for job in jobs_of(task, "faithful"):
        seeds.setdefault(replace(job, seed=0), []).append(job.seed)
    for kind, found in seeds.items():
        made_with = kind.provenance
        yield from ({**made_with, "seed": one, "other": other} for one, other in combinations(found, 2))


def main() -> None:
    """Print which committed results are stale, one line each."""
    for line in stale():
        print(line)


if __name__ == "__main__":
    with command.in_one_line():
        main()
