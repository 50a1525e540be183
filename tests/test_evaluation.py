import dataclasses
import re

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, CurvedTeacher, PumpingTeacher

import vsp
from vsp import evaluate, likeness, rollout, start_states
from vsp.evaluation import remark
from vsp.run import progress
from vsp.tasks import OUTCOMES, get_task

TWO = vsp.VoronoiPolicy([[-0.5, 0.01], [-0.5, -0.01]], [[[0], [0], [1]], [[0], [0], [-1]]], task=MOUNTAINCAR)
STILL = vsp.VoronoiPolicy([[0.0, 0.0]], np.zeros((1, 3, 1)), task=MOUNTAINCAR)


def test_start_states_repeat_and_the_first_ones_stay():
    assert np.array_equal(start_states(SIMPLEGOAL, 50, 1), start_states(SIMPLEGOAL, 50, 1))
    assert not np.array_equal(start_states(SIMPLEGOAL, 50, 1), start_states(SIMPLEGOAL, 50, 2))
    assert np.array_equal(start_states(SIMPLEGOAL, 10, 1), start_states(SIMPLEGOAL, 50, 1)[:10])


@pytest.mark.parametrize(("task", "player"), [(SIMPLEGOAL, CurvedTeacher()), (MOUNTAINCAR, PumpingTeacher())])
def test_evaluate_is_a_row_per_episode(task, player):
    frame, result = evaluate(player, task, n_episodes=60, seed=3), rollout(player, task, start_states(task, 60, 3))
    assert frame.columns.tolist() == ["return", "length", "outcome"] and frame.index.tolist() == list(range(60))
    assert np.array_equal(frame["return"], result.returns) and np.array_equal(frame["length"], result.lengths)
    assert frame["outcome"].tolist() == [OUTCOMES[code] for code in result.outcomes]
    assert frame.equals(evaluate(player, task, n_episodes=60, seed=3))


def test_how_alike_by_hand():
    """The teacher pushes with the velocity; half of its variance is that of a constant in each direction."""
    same = likeness(PumpingTeacher(), PumpingTeacher(), MOUNTAINCAR, 20)
    assert same.r2 == 1 and not same.errors.any() and same.failures == {"policy": 0, "agent": 0} and not same.poor
    assert [dataclasses.replace(same, r2=r2).poor for r2 in (0.9, 0.899)] == [False, True]
    many = dataclasses.replace(same, returns=dict.fromkeys(same.returns, np.zeros(100)))
    assert [dataclasses.replace(many, failures={"policy": n, "agent": 1}).poor for n in (3, 4)] == [False, True]
    alike = likeness(TWO, PumpingTeacher(), MOUNTAINCAR, 20)
    theirs, ours = (one.predict(alike.states)[0] for one in (PumpingTeacher(), TWO))
    assert alike.r2 == pytest.approx(1 - np.mean((ours - theirs) ** 2) / theirs.var())
    assert np.array_equal(alike.errors, np.abs(ours - theirs) / 2) and same.within.tolist() == [1]
    gentle = likeness(vsp.agent(lambda obs: 0.8 * PumpingTeacher().predict(obs)[0]), PumpingTeacher(), MOUNTAINCAR, 20)
    assert gentle.within == pytest.approx(np.mean(np.abs(theirs) <= 0.5)) and 0 < gentle.within < 1
    assert f"within 5% of its range in {gentle.within[0]:.0%} of them" in str(gentle)
    played = rollout(PumpingTeacher(), MOUNTAINCAR, start_states(MOUNTAINCAR, 20, 7))
    assert np.array_equal(alike.returns["agent"], played.returns)
    assert likeness(STILL, PumpingTeacher(), MOUNTAINCAR, 20).failures["policy"] == 20


def test_a_distillation_ends_with_a_remark_unless_nobody_reads_it(monkeypatch, capsys):
    monkeypatch.delenv("MAKELEVEL", raising=False)
    config = vsp.preset(MOUNTAINCAR).quick()
    vsp.distill(PumpingTeacher(), MOUNTAINCAR, config, seed=0)
    first, last = re.fullmatch(r"(?s)(.*?)([^\n]*)\n", capsys.readouterr().err).groups()
    said = r"(warning: )?R² -?[01]\.\d+ on [\d,]+ new states, each action .* fail \(agent: 0\); closer: vsp_b"
    assert re.match(said, last)
    for progress_wanted, level in ((False, ""), (True, "1")):
        monkeypatch.setenv("MAKELEVEL", level) if level else None
        vsp.distill(PumpingTeacher(), MOUNTAINCAR, config, seed=0, progress=progress_wanted)
        assert not capsys.readouterr().err


@pytest.mark.parametrize(("policy", "said"), [(PumpingTeacher(), "R² 1.000"), (STILL, "warning: R² ")])
def test_a_poor_policy_is_a_warning(monkeypatch, capsys, policy, said):
    monkeypatch.delenv("MAKELEVEL", raising=False)
    with progress.shown():
        remark(policy, PumpingTeacher(), get_task(MOUNTAINCAR), 1000, "n_cells=4")
    text = capsys.readouterr().err
    assert text.startswith(said) and text.endswith("closer: n_cells=4\n") and " of 25 episodes fail" in text
