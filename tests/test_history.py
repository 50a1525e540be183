import numpy as np
import pytest
from support import SIMPLEGOAL, TINY, CurvedTeacher, partition_of

from vsp import History, distill
from vsp.history import SNAPSHOT_EVERY, SNAPSHOTS


@pytest.fixture(scope="module")
def run():
    return distill(CurvedTeacher(), SIMPLEGOAL, TINY, seed=0)


def observed(n):
    """The history of n iterations without events; the coefficients of iteration i are i."""
    history, partition = History(n), partition_of([[0.5, 0.5]])
    for i in range(n):
        partition.models.coefficients = np.full((1, 3, 2), float(i))
        history.observe(i, 0.0, partition)
    return history


def test_the_frame_counts_what_the_events_say(run):
    _, history = run
    frame = history.to_frame()
    assert frame.columns.tolist() == ["cells", "loss", "splits", "merges"] and frame.index.name == "iteration"
    assert len(frame) == TINY.n_epochs and not frame.isna().any().any()
    assert frame["splits"].sum() == sum(e.kind == "split" for e in history.events) > 0
    assert frame["merges"].sum() == sum(e.kind == "merge" for e in history.events) > 0
    assert (1 + (frame["splits"] - frame["merges"]).cumsum() == frame["cells"]).all()
    assert all(e.codeword.base is None or len(e.codeword.base) < 100 for e in history.events), "keeps its episodes"
    splits, merges = ([e.cause for e in history.events if e.kind == kind] for kind in ("split", "merge"))
    assert min(splits) > TINY.max_pol_loss and 0 <= min(merges) <= max(merges) < TINY.min_param_distance
    assert observed(3).to_frame()[["splits", "merges"]].to_numpy().tolist() == [[0, 0]] * 3


def test_policy_at_follows_the_partition_in_every_iteration(run):
    policy, history = run
    codewords = {tuple(history.policy_at(0).codewords[0])}
    for n, cells in enumerate(history.cells):
        for event in (e for e in history.events if e.iteration == n):
            (codewords.add if event.kind == "split" else codewords.remove)(tuple(event.codeword))
        assert {tuple(c) for c in history.policy_at(n).codewords} == codewords and len(codewords) == cells
    assert np.array_equal(history.policy_at(len(history.cells) - 1).codewords, policy.codewords)


def test_policy_at_is_right_where_one_cell_comes_and_another_goes():
    history = History()
    for n, x in enumerate((0.9, 0.5)):
        history.add_events(n, "split", [(np.array([x, 0.9]), 1.5)])
        history.observe(n, 1.0, partition_of([[0.1, 0.1], [x, 0.9]]))
    assert history.policy_at(1).codewords.tolist() == [[0.1, 0.1], [0.5, 0.9]]


@pytest.mark.parametrize("n", [35, 5500])
def test_a_snapshot_is_at_most_so_many_iterations_old(n):
    """A long run keeps no more snapshots than a short one."""
    history = observed(n)
    every = max(SNAPSHOT_EVERY, n // SNAPSHOTS)
    ages = [i - history.policy_at(i).coefficients[0, 0, 0] for i in range(n)]
    assert min(ages) == 0 and max(ages) == every - 1
    assert ages.count(0) <= 1.1 * SNAPSHOTS


def test_snapshots_do_not_change_afterwards():
    history, partition = History(), partition_of([[0.5, 0.5]])
    history.observe(0, 0.0, partition)
    partition.models.coefficients[:] = 9.0
    partition.codewords[:] = 9.0
    assert not (history.policy_at(0).coefficients == 9).any() and not (history.policy_at(0).codewords == 9).any()
