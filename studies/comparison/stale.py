"""`python -m studies.comparison.stale` prints which committed results are out of date, or nothing.

Which results there are, and what they were made with, follows from the table of methods. Not checked are proofs, times
and measurements.
"""

from collections.abc import Iterator

from vsp.run import atomic, command

from .. import drone, zoo
from ..committed import differing
from .beside import beside
from .methods import LONG, TABLES
from .rows import jobs_of


def stale() -> list[str]:
    """List the results in data/beyond that are missing, damaged or out of date, one message each."""
    messages = []
    for name, target, today in committed():
        try:
            if columns := differing(name, today):
                what = f"data/beyond/{name} lacks today's {' and '.join(columns)}"
                messages.append(f"{what}: `make {target}` makes what is missing")
        except FileNotFoundError:
            messages.append(f"data/beyond/{name} is missing: `make {target}` makes it")
        except atomic.DamagedFile as error:
            messages.append(str(error))
    return messages


def committed() -> Iterator[tuple[str, str, list[dict]]]:
    """Yield the committed files: name, make target, and what each row, or the whole file, is made with today."""
    for task, tables in TABLES.items():
        target = "beyond-long" if task in LONG else "beyond"
        for table in tables:
            yield f"{table}_{task}.csv", target, [job.about() for job in jobs_of(task, table)]
            for file in beside(task, table):
                yield file.name, target, file.today
    for name in zoo.TABLES:
        yield f"{name}.csv", "agents", zoo.current(name)[1]
    yield "drone.csv", "drone", drone.current()


def main() -> None:
    """Print which committed results are stale, one line each."""
    for line in stale():
        print(line)


if __name__ == "__main__":
    with command.in_one_line():
        main()
