"""Whether the committed tables of the studies were made with the code and the settings of today."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from .. import printed
from ..results import PROVENANCE, read_results
from ..runs import paper_experiment
from . import interpretations, simpler, teachers


def stale() -> list[str]:
    """List the tables of the studies that were made with other settings, teachers or versions than today's.

    One message each; the list is empty if all are up to date. Raises as `read_results` does.
    """
    messages = []
    for name, today in {"readings": _readings, "teachers": _teachers, "simpler": _simpler}.items():
        frame = read_results(name)
        now = pd.DataFrame(today(frame)).astype(str)
        made = frame.assign(teacher=frame["checksum"]) if "checksum" in frame else frame
        made = made[[*now]].dropna(subset=[*PROVENANCE]).astype(str)
        if {*now.itertuples(index=False)} != {*made.itertuples(index=False)}:
            differing = [column for column in now if {*now[column]} != {*made[column]}] or ["rows"]
            what = f"data/results/{name}.csv was made with other {' and '.join(differing)}"
            messages.append(f"{what}: `make study` makes it anew")
    return messages


def _readings(frame: pd.DataFrame) -> Iterator[dict]:
    """Yield today's provenance of the readings. All variants are ranked; the rows show which were also confirmed."""
    seeds = {"choosing": interpretations.CHOOSING, "confirming": interpretations.CONFIRMING}
    confirmed = set(frame.loc[frame["phase"] == "confirming", "variant"])
    for (name, _), experiment in interpretations.experiments(interpretations.variants()).items():
        for phase in seeds if name in confirmed else ("choosing",):
            yield interpretations.provenance_of(experiment, seeds[phase])


def _teachers(_: pd.DataFrame) -> Iterator[dict]:
    for experiment in teachers.experiments().values():
        yield from ({**teachers.provenance_of(experiment), "seed": seed} for seed in teachers.SEEDS)


def _simpler(_: pd.DataFrame) -> Iterator[dict]:
    return (simpler.provenance_of(paper_experiment(task)) for task in printed.TASKS)
