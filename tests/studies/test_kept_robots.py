import dataclasses

import numpy as np
import pandas as pd
import pytest
from support import WALKER

from studies.comparison import kept, kept_robots, method_rows
from studies.comparison.measure import NEW_SEED
from studies.comparison.method_tables import ROBOTS, Table
from vsp.evaluation import start_states
from vsp.policy import VoronoiPolicy
from vsp.rollouts import rollout


@pytest.fixture
def walker(monkeypatch):
    """A robot without a shipped teacher: only its checksum is asked for."""
    monkeypatch.setattr(method_rows, "WALKERS", (WALKER,))
    monkeypatch.setattr(method_rows, "ROBOT_TABLES", {"robots": Table(ROBOTS, seeds=range(2), fewer=range(1))})
    teacher = type("Teacher", (), {"digest": "0123456789abcdef"})
    monkeypatch.setattr(method_rows, "_teacher", lambda task, agent: teacher)
    return VoronoiPolicy(np.eye(2, 24), np.zeros((2, 25, 4)), task=WALKER, metric="euclidean")


def test_the_kept_policy_of_a_robot_is_the_first_of_its_size(walker):
    job = kept.kept_job(WALKER, "robots")
    assert (job.method, job.size, job.seed) == ("cells, trained further", 8, 0)


def test_a_gait_names_the_policy_that_walks(walker, monkeypatch):
    monkeypatch.setitem(kept_robots.GAIT, "n_steps", 3)
    frame = kept_robots.gait(walker)
    assert frame.step.tolist() == [0, 1, 2] and set(frame.teacher) == {"0123456789"}
    before = kept_robots.provenance_of("gait", WALKER)
    assert dict(frame.loc[0, list(before)]) == before != kept_robots.provenance_of("fewest", WALKER)
    changed = dataclasses.replace(method_rows.preset(WALKER, "walking"), n_steps=7000)
    monkeypatch.setattr(method_rows, "walking_preset", lambda task: changed)
    assert kept_robots.provenance_of("gait", WALKER)["settings"] != before["settings"]


def test_the_last_two_rows_compare_all_numbers_with_the_fewest(walker, monkeypatch):
    coefficients = np.zeros((2, 25, 4))
    coefficients[1, -1] = 0.5
    policy = VoronoiPolicy(walker.codewords, coefficients, task=WALKER, metric="euclidean")
    monkeypatch.setattr(kept_robots, "N_REPORTED", 40)
    monkeypatch.setattr(kept_robots, "fewest_numbers", lambda policy, **settings: shorter(policy))
    frame = kept_robots.fewest(policy)
    assert frame["stage"].tolist() == ["cells", "digits", "all numbers", "fewest"]
    assert frame["nonzero"].tolist()[-2:] == [4, 0] and frame["digits"].tolist()[-2:] == [0, 2]
    starts = start_states(WALKER, 2, NEW_SEED)
    means = [rollout(one, WALKER, starts).returns.mean() for one in (policy, shorter(policy)[0])]
    assert frame["mean"].iloc[-2:].tolist() == pytest.approx(means)
    assert frame["kept"].iloc[-2:].tolist() == [mean >= 0.95 * means[0] for mean in means]


def shorter(policy):
    """What `fewest_numbers` would give: nothing is left."""
    rows = [("cells", 2, 4, 0, 1.0, True), ("digits", 1, 0, 2, 1.0, True)]
    frame = pd.DataFrame(rows, columns=["stage", "cells", "nonzero", "digits", "mean", "kept"])
    return VoronoiPolicy(policy.codewords[:1], np.zeros((1, 25, 4)), task=WALKER, metric="euclidean"), frame
