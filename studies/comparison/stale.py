"""Find committed results that were made with other settings, another teacher or another version than today's.

`python -m studies.comparison.stale` prints them, or nothing if all are up to date. Which results there are, and what
they were made with, follows from the table of methods. Not checked are proofs, times and measurements.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import pandas as pd

from vsp.protocol.job import PROVENANCE
from vsp.run import atomic, command, sealed

from .. import agents
from ..results import RESULTS, read_results
from .methods import LONG, TABLES
from .rows import WAYS, best_provenance, by_seed, extras, jobs_of


def stale() -> list[str]:
    """List the results in data/beyond that are missing, damaged or out of date, one message each.

    The list is empty if all are up to date.
    """
    messages = []
    for name, target, today in committed():
        try:
            differing = _differing(name, today)
        except FileNotFoundError:
            messages.append(f"data/beyond/{name} is missing: `make {target}` makes it")
        except atomic.DamagedFile as error:
            messages.append(str(error))
        else:
            if differing:
                what = f"data/beyond/{name} was made with other {' and '.join(differing)}"
                messages.append(f"{what}: `make {target}` makes it anew")
    return messages


def committed() -> Iterator[tuple[str, str, list[dict]]]:
    """Yield the committed files: name, make target, and the provenance today, of each row or of the whole file."""
    for task, tables in TABLES.items():
        target = "beyond-long" if task in LONG else "beyond"
        for table in tables:
            made_with = ((jobs, kind.provenance) for kind, jobs in by_seed(jobs_of(task, table)).items())
            yield f"{table}_{task}.csv", target, [{"seed": job.seed, **now} for jobs, now in made_with for job in jobs]
            for name, today, _ in extras(task, table):
                yield name, target, today
    yield "optimum.csv", "beyond", [best_provenance(*way) for way in WAYS]
    yield from agents.committed()


def _differing(name: str, today: list[dict]) -> list[str]:
    """Return the columns in which the provenance in a file differs from today's; none if it is up to date."""
    now, path = pd.DataFrame(today), RESULTS / name
    columns = [column for column in (*PROVENANCE, "seed", "other") if column in now]
    kept = [sealed.load_arrays(path, kind="VoronoiPolicy")[1]] if path.suffix == ".policy" else read_results(path.stem)
    now, then = now[columns].astype(str), pd.DataFrame(kept).reindex(columns=columns).astype(str)
    count = Counter if "seed" in columns else set  # with a seed, each row stands for one job
    if count(map(tuple, now.to_numpy())) == count(map(tuple, then.to_numpy())):
        return []
    return [column for column in columns if set(now[column]) != set(then[column])] or ["rows"]


def main() -> None:
    """Print which committed results are stale, one line each."""
    for line in stale():
        print(line)


if __name__ == "__main__":
    with command.in_one_line():
        main()
