"""Write the policies that are committed beside the rows, each with its provenance.

Each task has one policy that acts like its teacher and one at the limit. Each robot has one policy, and LunarLander
also has a simplified one.
"""

from __future__ import annotations

import os
from dataclasses import asdict

from vsp.evaluation import start_states
from vsp.paper.results import load_made, provenance
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout
from vsp.run import listed, sealed
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import load_teacher
from vsp_beyond.few_cells.simplification import simplify
from vsp_beyond.few_cells.units import METRIC

from .method_rows import Job, jobs_of, preset

LOSS = 0.02  # share of the teacher's mean return that the simplified policy may lose
SIMPLIFY_VERSION = 1  # raise it when `simplify` returns a different policy


# Tables from which one policy is kept, and the method that made it
KEPT = {"faithful": "faithful", "limit": "at the limit", "robots": "cells, trained further"}


def keep(folder: str | os.PathLike, task: str, table: str, path: str | os.PathLike) -> None:
    """Write the policy of `kept_job` to `path` with its provenance, and add it to the manifest.

    `folder` holds the rows.
    """
    job = kept_job(task, table)
    arrays, _ = load_made(job.path(folder), "Row", job.about())
    _keep(VoronoiPolicy(**arrays, task=task, metric=METRIC), path, job.provenance)


def kept_job(task: str, table: str) -> Job:
    """Return the row whose policy is kept: the one with the preset's size and the first seed."""
    jobs = [job for job in jobs_of(task, table) if job.method == KEPT[table]]
    return next(job for job in jobs if (job.size, job.seed) == (preset(task, job.how.preset).n_cells, 0))


def simplest(task: str) -> VoronoiPolicy:
    """Make the simplest policy that loses at most `LOSS` of the teacher's mean return. Takes about ten minutes."""
    teacher, config = load_teacher(task), preset(task, "tuned")
    starts = start_states(get_task(task), config.n_validation, 0)
    own = rollout(teacher, get_task(task), starts).returns.mean()
    return simplify(teacher, task, config, tolerance=LOSS * abs(own), seed=0)[0]


def keep_simplest(task: str, path: str | os.PathLike) -> None:
    """Make the policy of `simplest`, write it to `path` with its provenance, and add it to the manifest."""
    _keep(simplest(task), path, simplest_provenance(task))


def _keep(policy: VoronoiPolicy, path: str | os.PathLike, made_with: dict) -> None:
    policy.save(path)
    arrays, about = sealed.load_arrays(path, kind="VoronoiPolicy")
    sealed.save_arrays(path, arrays, about | made_with)
    listed.list_file(path)


def simplest_provenance(task: str) -> dict[str, str | int]:
    """Return the provenance of the policy of `simplest`: what determines it besides the seed, which is 0."""
    settings = {"task": task, "loss": LOSS, **asdict(preset(task, "tuned"))}
    return provenance(settings, load_teacher(task).digest, SIMPLIFY_VERSION)
