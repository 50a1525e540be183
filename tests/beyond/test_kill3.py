import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL
import vsp
from vsp.tasks import get_task
from vsp_beyond.few_cells.units import ScaledCells
from vsp_beyond.proofs import check, load_certificate, mountaincar, pendulum, robust
from vsp_beyond.proofs.grid import touches
from vsp_beyond.proofs.simplegoal import follow
from vsp_beyond.proofs.mountaincar import ENDS, Program, run_block


def sg(codewords, coefficients, **more):
    return vsp.VoronoiPolicy(np.array(codewords, float), np.array(coefficients, float), task=SIMPLEGOAL, **more)


def pen(coefficients):
    return vsp.VoronoiPolicy([[0.0, 0.0, 0.0]], np.array(coefficients, float).reshape(1, 4, 1), task=PENDULUM, metric="euclidean")


@pytest.mark.parametrize("sign", [1, -1])
def test_B19(sign):
    states = np.random.default_rng(0).normal(size=(500, 2))
    cells = ScaledCells(np.array([[9.0, -7.0], [-8.5, 7.5]])[::sign], np.zeros((2, 3, 1)))
    assert (cells.among(states).nearest(states) == cells.nearest(states)).all()


def test_C01():
    policy, point = sg([[0.25, 0.5], [0.75, 0.5]], np.zeros((2, 3, 2))), np.array([[0.5], [0.5]])
    assert all(touches(policy, cell, point, point, np.ones(2)).all() for cell in (0, 1))


def test_C02(monkeypatch):
    policy, edges = sg([[0.5, 0.5]], [[[-0.5, 0], [0, -0.5], [0, 0]]]), np.linspace(0, 1, 101)
    low, high = (np.stack(np.meshgrid(e, e, indexing="ij")).reshape(2, -1) for e in (edges[:-1], edges[1:]))
    first = robust._way(policy, 0, low, high, 0.0, 100).first
    monkeypatch.setattr(robust, "SEEN", 0.9)
    assert (first - robust._way(policy, 0, low, high, 0.0, 100).first).max() >= 4


def test_C06():
    policy = sg([[0.5, 0.5]], [[[0, 0], [0, 0], [-1, -1]]])
    n = len(follow(policy))
    with pytest.raises(ValueError, match=f"expected at most {n - 1}"):
        follow(policy, most=n - 1)


def test_C09(monkeypatch):
    ends = lambda self, states, returns: np.array([(1.0, 2.0, 9, 0, 1)] * len(states), ENDS)  # noqa: E731
    monkeypatch.setattr(Program, "play", ends)
    block = run_block(vsp.VoronoiPolicy([[0, 0]], [[[0], [0], [1]]], task=MOUNTAINCAR, metric="euclidean"), 0, 20)
    assert (block.mean_low, block.mean_high) == pytest.approx((1.0, 2.0))


@pytest.mark.parametrize("seed", range(5))
def test_C14_C15(seed, monkeypatch):
    rng, n, kept = np.random.default_rng(seed), 16, []
    monkeypatch.setattr(pendulum, "boxes_between", lambda a, s, n: kept.append((a, s)) or np.zeros((2, 2, n * n), int))
    policy = pen(rng.normal(size=4) * [4, 4, 2, 1])
    pendulum._way(policy, 0, n)
    i, j = rng.integers(n, size=(2, 300_000))
    at = rng.choice([-1.0, 1.0, 0.0], size=(2, 300_000)) / 2 + 0.5
    states = np.stack([(2 * (i + at[0]) / n - 1) * np.pi, (2 * (j + at[1]) / n - 1) * 8], axis=1)
    task = get_task(PENDULUM)
    after = task.step(states, policy.predict(task.see(states).astype(np.float32))[0])[0].T
    for (low, high), value in zip(kept[0], after):
        k = i * n + j
        off = value - low[k]
        off = off % (2 * np.pi) if value is after[0] else off
        assert ((off >= -1e-9) & (off <= high[k] - low[k] + 1e-9) | (off > 2 * np.pi - 1e-6)).all()


def test_C19():
    content = load_certificate("mountaincar_limit")[1]
    content["claim"]["share"] = 1.0
    with pytest.raises(check.Refused, match="but the claim is"):
        check.check_content(content)


def test_C20():
    with pytest.raises(check.Refused, match="too steep"):
        check.check_content(pendulum.prove_pendulum(pen([0, 200, 0, 0]), n=16).certificate())


def test_C03():
    assert not robust.steps_to_goal(sg([[0.5, 0.5]], [[[0, 0], [0, 0], [-1, -1]]]), n=10).any()


def test_A20():
    import dataclasses
    from support import CurvedTeacher
    from vsp.evaluation import likeness
    from vsp_beyond.episodes import episodes
    task = dataclasses.replace(get_task(SIMPLEGOAL), inputs=("</script>", "y"))
    policy = vsp.VoronoiPolicy([[0.5, 0.5]], np.full((1, 3, 2), -0.5), task=task)
    made = episodes(policy, CurvedTeacher(), likeness(policy, CurvedTeacher(), task, 20))
    assert made.count("</script>") == 1
