import tracemalloc

import numpy as np
import pytest
from support import SIMPLEGOAL, TINY, CurvedTeacher, partition_of, tiny

from vsp import algorithms, distill
from vsp import history as history_module
from vsp.history import SNAPSHOT_EVERY, SNAPSHOTS, History


@pytest.fixture(scope="module")
def run():
    return distill(CurvedTeacher(), SIMPLEGOAL, TINY, seed=0)


def test_the_frame_counts_what_the_events_say(run):
    _, history = run
    frame = history.to_frame()
    assert frame.columns.tolist() == ["cells", "loss", "splits", "merges"] and frame.index.name == "iteration"
    assert len(frame) == TINY.n_epochs and not frame.isna().any().any()
    assert frame["splits"].sum() == sum(e.kind == "split" for e in history.events) > 0
    assert frame["merges"].sum() == sum(e.kind == "merge" for e in history.events) > 0
    assert (1 + (frame["splits"] - frame["merges"]).cumsum() == frame["cells"]).all()


def test_policy_at_follows_the_partition_in_every_iteration(run):
    policy, history = run
    codewords = {tuple(history.policy_at(0).codewords[0])}
    for n, cells in enumerate(history.cells):
        for event in (e for e in history.events if e.iteration == n):
            (codewords.add if event.kind == "split" else codewords.remove)(tuple(event.codeword))
        assert {tuple(c) for c in history.policy_at(n).codewords} == codewords and len(codewords) == cells
    assert np.array_equal(history.policy_at(len(history.cells) - 1).codewords, policy.codewords)


def test_policy_at_is_right_where_one_cell_comes_and_another_goes():
    history, old = History(), partition_of([[0.1, 0.1], [0.9, 0.9]])
    history.observe(0, 1.0, old)
    new = partition_of([[0.1, 0.1], [0.5, 0.9]])
    history.add_events(1, "split", [np.array([0.5, 0.9])])
    history.add_events(1, "merge", [np.array([0.9, 0.9])])
    history.observe(1, 1.0, new)
    assert history.policy_at(1).codewords.tolist() == new.codewords.tolist()


def test_a_snapshot_is_at_most_so_many_iterations_old():
    history, partition = History(), partition_of([[0.5, 0.5]])
    for n in range(35):
        partition.models.parameters = np.full((1, 3, 2), float(n))
        history.observe(n, 0.0, partition)
    ages = [n - history.policy_at(n).coefficients[0, 0, 0] for n in range(35)]
    assert min(ages) == 0 and max(ages) == SNAPSHOT_EVERY - 1


@pytest.mark.parametrize("n", [100, 5000, 5500, 80_000])
def test_a_long_run_keeps_no_more_snapshots_than_a_short_one(n):
    history, partition = History(n), partition_of([[0.5, 0.5]])
    for i in range(n):
        history.observe(i, 0.0, partition)
    assert history.every == max(SNAPSHOT_EVERY, n // SNAPSHOTS)
    assert len(history._snapshots) == -(-n // history.every) <= 1.1 * SNAPSHOTS
    assert history.policy_at(n - 1) is history._snapshots[-1][1]


def test_events_do_not_keep_the_episodes_that_they_come_from(run):
    assert all(event.codeword.base is None or len(event.codeword.base) < 100 for event in run[1].events)


def test_memory_of_a_run_grows_by_what_the_history_notes(run, monkeypatch):
    """Two numbers an iteration, and less than a snapshot for each tenth; `make bench` measures whole runs."""
    monkeypatch.setattr(algorithms, "EPISODES_AHEAD", 25)
    monkeypatch.setattr(history_module, "SNAPSHOTS", 20)
    peaks = {}
    for n in (400, 1400):
        config = tiny(n_epochs=n, n_freeze=n - 100)
        tracemalloc.start()
        distill(CurvedTeacher(), SIMPLEGOAL, config, seed=0)
        peaks[n] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks[1400] - peaks[400] < 150 * 1000


def test_snapshots_do_not_change_afterwards(run):
    history, partition = History(), partition_of([[0.5, 0.5]])
    history.observe(0, 0.0, partition)
    partition.models.parameters[:] = 9.0
    partition.codewords[:] = 9.0
    assert not (history.policy_at(0).coefficients == 9).any() and not (history.policy_at(0).codewords == 9).any()


def test_a_run_without_events_has_a_frame():
    _, history = distill(CurvedTeacher(), SIMPLEGOAL, tiny(n_epochs=3, n_freeze=3), seed=0)
    assert history.to_frame()[["splits", "merges"]].to_numpy().tolist() == [[0, 0]] * 3
