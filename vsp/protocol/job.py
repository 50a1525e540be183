"""`Job`: one file of results, made once. The paper's runs, the comparisons and the studies of agents are jobs.

A file states its provenance, so that a changed configuration, agent or method never loads old results, nor a file that
was copied to another folder:

- settings: an id of everything else that determines the result, including presets and start states;
- teacher: the first ten hexadecimal digits of the agent's digest;
- version: the method's version number in the code, raised by hand when the same arguments give other results;
- the seed, where a result has one.
"""

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..run import atomic, sealed, workers

N_EPISODES, EVALUATION_SEED = 1000, 1  # of every reported result, from the same start states for all
PROVENANCE = ("settings", "teacher", "version")
LIBRARIES = {"numpy": np.__version__, "scipy": scipy.__version__}  # a result may depend on them


class Job:
    """What determines one file of results, and how to make it; a subclass states kind, task, seed and provenance."""

    kind: str
    seed: int

    if TYPE_CHECKING:  # a subclass has these as fields or as properties

        @property
        def task(self) -> str: ...  # noqa: D102

        @property
        def provenance(self) -> dict[str, str | int]: ...  # noqa: D102

    def make(self) -> tuple[dict[str, np.ndarray], dict]:
        """Make the result: arrays, and what else the file says."""
        raise NotImplementedError

    def about(self) -> dict:
        """Return what identifies the file."""
        return {"task": self.task, **self.provenance, "seed": self.seed}

    def path(self, folder: str | os.PathLike) -> Path:
        """Return the path of the file below `folder`."""
        made_with = "{settings}-{teacher}-v{version}".format(**self.provenance)
        return Path(folder, self.task, made_with, f"{self.seed:04d}.run")

    def load(self, folder: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict]:
        """Read the file: its arrays and all that it says. Raises `atomic.DamagedFile`, also for another job's file."""
        return load_made(self.path(folder), self.kind, self.about())


def make_all(
    work: Iterable[Job], folder: str | os.PathLike, label: str, *, jobs: int | str = 1, unit: str = "runs"
) -> None:
    """Make the files of `work` that are missing below `folder`; `jobs` as in `run.workers`."""
    asked = {job.path(folder): job for job in work}
    missing = [path for path in asked if not path.exists()]
    arguments = [(asked[path],) for path in missing]
    for i, (arrays, about) in workers.results(_make, arguments, label, jobs=jobs, total=len(asked), unit=unit):
        sealed.save_arrays(missing[i], arrays, about)


def _make(job: Job) -> tuple[dict[str, np.ndarray], dict]:
    arrays, about = job.make()
    return arrays, {"kind": job.kind, **job.about(), **about}


def provenance(settings: dict, digest: str, version: int | str) -> dict[str, str | int]:
    """Return the columns `PROVENANCE` of a result; `digest` is the checksum of the teacher's weights."""
    return {"settings": settings_id(settings), "teacher": digest[:10], "version": version}


def settings_id(settings: dict | list) -> str:
    """Return ten hexadecimal digits that identify JSON-able settings."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:10]


def load_made(path: str | os.PathLike, kind: str, expected: dict) -> tuple[dict, dict]:
    """Return the arrays and about of a sealed file. Raises `atomic.DamagedFile`, also if about differs from `expected`,
    as in a swapped or old file."""
    arrays, about = sealed.load_arrays(path, kind=kind)
    for name, value in expected.items():
        if about.get(name) != value:
            raise atomic.DamagedFile(
                f"{path}: made with {name} {about.get(name)!r}, expected {value!r}: delete it to make it again"
            )
    return arrays, about
