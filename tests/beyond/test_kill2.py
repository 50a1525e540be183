import copy
import dataclasses
import types

import numpy as np
import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, Constant, CurvedTeacher, RandomPolicy
from test_faithful import SMALL, distilled_by
from test_search import planted

import vsp
from studies import comparison
from vsp.rollouts import rollout
from vsp.tasks import GOAL, get_task
from vsp_beyond.few_cells import faithful, search, tune, units
from vsp_beyond.few_cells.config import Faithful, Tuned, faithful_preset
from vsp_beyond.few_cells.units import LabelledStates, ScaledCells, Scaling
from vsp_beyond.proofs import check, dead_points, mountaincar, pendulum
from vsp_beyond.proofs.mountaincar import Program, first_steps, run_block
pytestmark = pytest.mark.filterwarnings("ignore:no policy of")
UNSCALED = Scaling(get_task(SIMPLEGOAL), np.zeros(2), np.ones(2))


def test_B01(monkeypatch):
    losses, (cells, labelled) = [], planted(n=200)
    monkeypatch.setattr(search, "minimize", lambda f, x, **_: losses.append(f) or types.SimpleNamespace(x=x))
    search.descend(labelled, cells, range(3, 4), ridge=0.5)
    gradient, steps = losses[0](np.zeros(cells.vector.size))[1], 1e-6 * np.eye(cells.vector.size)
    assert gradient == pytest.approx([(losses[0](s)[0] - losses[0](-s)[0]) / 2e-6 for s in steps], abs=1e-5)


def test_B03(monkeypatch):
    seen, (cells, labelled) = [], planted(n=300)
    monkeypatch.setattr(search, "FEW", 50)
    monkeypatch.setattr(search, "descend", lambda those, cells, *_, **__: seen.append(len(those.inputs)) or cells)
    search.least_error(labelled, 2, 3, np.random.default_rng(0))
    assert seen[0] == 50 and seen[-1] == 300


def test_B05():
    """A codeword that no state is near may move far."""
    cells, labelled = planted()
    far = ScaledCells(np.vstack([cells.codewords, [[99, 99]]]), np.vstack([cells.coefficients, cells.coefficients[:1]]))
    moved = search.even_moves(labelled, far)(np.ones(far.vector.size)).codewords - far.codewords
    assert moved[3].min() > 3 * moved[:3].max()


def test_B07(monkeypatch):
    asked = []
    monkeypatch.setattr(faithful, "_tune", lambda c, s, cells, pool, goals, rng: asked.append((pool, goals)) or ())
    config = dataclasses.replace(SMALL, failure_penalty=100.0, min_r2=0.5)
    faithful.distill_faithfully(Named(), SIMPLEGOAL, config, seed=1)
    result = rollout(Named(), SIMPLEGOAL, asked[0][0])
    assert asked[0][1] == pytest.approx(result.returns - 100 * (result.outcomes != GOAL)) and (result.outcomes != GOAL).any()


class Named(CurvedTeacher):
    def predict(self, obs):
        return np.column_stack([-np.ones(len(obs)), -0.5 * np.asarray(obs)[:, 1]]), None


def test_B08_B13():
    cost = faithful._cost
    assert cost(np.array([0.1, 0.1]), np.array([-5.0, 2.0]), 1.0, None) == pytest.approx([0.1, 0.1 + 2 * faithful.PRICE])
    assert cost(np.array([0.25, 0.5]), np.zeros(2), 1.0, 0.7) == pytest.approx([0.0, 0.2 / faithful.BEYOND])


def test_B09(monkeypatch):
    missed = []
    monkeypatch.setattr(faithful, "_cost", lambda errors, m, *_: missed.append(m) or errors)
    distilled_by(n_generations=1, margin=100.0)
    assert missed[0].min() > 90


def candidates(penalty, **more):
    config = dataclasses.replace(SMALL, failure_penalty=penalty, **more)
    return faithful._Candidates(config, UNSCALED, None, np.array([[0.9, 0.9], [0.05, 0.05]]), 0.0, 0.1)


def test_B10():
    still = ScaledCells(np.zeros((1, 2)), np.zeros((1, 3, 2)))
    assert candidates(1000.0)._gap(still) == pytest.approx(candidates(0.0)._gap(still) - 500)


def test_B11(monkeypatch):
    monkeypatch.setattr(faithful._Candidates, "_gap", lambda *_: -5.0)
    those = candidates(0.0)
    those.rows.append({"cells": None, "r2": 0.9, "gap": -5.0})
    assert those.returns_enough(None)


def test_B12():
    starts = get_task(PENDULUM).start(np.random.default_rng(np.random.SeedSequence(1).spawn(4)[2]), 20)
    config = Faithful(n_cells=1, n_episodes=5, n_states=500, n_restarts=1, n_generations=0, n_validation=20, margin=1e4)
    missed = 1e4 - 0.01 * abs(rollout(Constant(1.0), PENDULUM, starts).returns.mean())
    found = []
    with pytest.warns(UserWarning) as found:
        faithful.distill_faithfully(Constant(1.0), PENDULUM, dataclasses.replace(config), seed=1)
    import re
    assert any(f"expected {missed:+.4g} or more" in str(w.message) for w in found), [str(w.message) for w in found]


def test_B14():
    assert [i for i in range(7) if tune.is_snapshot(i, 7, 3)] == [2, 4, 6]


def test_B15():
    a, b = (np.array(tune.cma_es(np.zeros(3), 1.0, np.random.default_rng(0)).ask()) for _ in range(2))
    assert np.array_equal(a, b)


def test_B15b():
    np.random.seed(5)
    expected = np.random.RandomState(5).random_sample()
    tune.cma_es(np.zeros(3), 1.0, np.random.default_rng(0)).ask()
    assert np.random.random_sample() == expected


def test_B16(monkeypatch):
    told = []
    search_ = types.SimpleNamespace(ask=lambda: [np.zeros(8)], tell=lambda v, c: told.append(c), result=types.SimpleNamespace(xfavorite=np.zeros(8)))
    monkeypatch.setattr(tune, "cma_es", lambda *_, **__: search_)
    still = ScaledCells(np.zeros((1, 2)), np.zeros((1, 3, 2)))
    for penalty in (0.0, 1000.0):
        config = Tuned(n_cells=1, n_generations=1, n_tuning_episodes=20, failure_penalty=penalty)
        list(tune.tune(UNSCALED.policy, UNSCALED.task, still, config, np.random.default_rng(0)))
    assert told[1][0] > told[0][0] + 900


def test_B17():
    with pytest.warns(UserWarning, match="1 of 2 observations leave the box"):
        units.warn_outside(get_task(SIMPLEGOAL), np.array([[0.5, 0.5], [1.001, 0.5]]))


def test_B18():
    states = np.array([[1.0, 2], [-1, 2], [1, -2], [-1, -2]])
    labelled = LabelledStates(np.column_stack([states, np.ones(4)]), np.zeros((4, 1)))
    assert units.temperature_unit(labelled, 4) == pytest.approx(5 / 4)


def test_B19():
    states = np.random.default_rng(0).normal(size=(500, 2))
    cells = ScaledCells(np.array([[9.0, -7.0], [-8.5, 7.5]]), np.zeros((2, 3, 1)))
    moved = cells.among(states)
    assert (moved.nearest(states) == cells.nearest(states)).all()


def test_B20():
    labelled = LabelledStates(np.column_stack([np.arange(100.0), np.ones(100)]), np.arange(100.0)[:, None])
    thin = labelled.thinned(10, np.random.default_rng(0))
    assert (thin.states // 10).ravel().astype(int).tolist() != [0] * 10 and np.sort(thin.states.ravel() // 10).tolist() == list(range(10))
    assert np.array_equal(thin.states, thin.actions)


def test_B21():
    with pytest.raises(ValueError, match="n_generations is False"):
        Tuned(n_cells=3, n_generations=False)


def test_B22():
    assert Tuned(n_cells=3, initial_temperature=1.0, final_temperature=1.0).final_temperature == 1.0


def test_B23():
    with pytest.raises(ValueError, match="failure_penalty is -1"):
        Faithful(n_cells=3, failure_penalty=-1.0)


def test_B24():
    short = dataclasses.replace(get_task(PENDULUM), name="Short-v0", max_steps=5)
    assert faithful_preset(short).n_episodes == 30_000


# ---- proofs
@pytest.fixture(scope="module")
def policy():
    return vsp.VoronoiPolicy.load(comparison.RESULTS / f"limit_{MOUNTAINCAR}.policy")


def mc(codewords, coefficients):
    return vsp.VoronoiPolicy(codewords, coefficients, task=MOUNTAINCAR, metric="euclidean")


def listed(policy, first=100_000, n=50):
    edges = np.array([check.mountaincar.edge(first + i, -1) for i in range(n + 1)])
    seen = mountaincar._floats(mountaincar._numbers(np.float32(-0.6)) + np.arange(first, first + n))
    states, owner, _ = first_steps(Program(policy), seen, edges[:-1], edges[1:])
    return set(zip(owner.tolist(), *states.T.tolist()))


def test_C07(policy, monkeypatch):
    exact = listed(policy)
    monkeypatch.setattr(mountaincar, "SUMS", 1e-4)
    assert len(listed(policy)) > 2 * len(exact) and exact <= listed(policy)


def test_C08():
    pushing = mc([[-0.5, -0.01], [-0.5, 0.01 + 1e-13]], [[[0], [0], [-1]], [[0], [0], [1]]])
    ways = [run_block(mc([[0, 0]], [[[0], [0], [side]]]), 0, 100).n_states for side in (-1, 1)]
    assert run_block(pushing, 0, 100).n_states == sum(ways)


def test_C09():
    pushing = mc([[-0.5, -0.01], [-0.5, 0.01]], [[[0], [0], [-1]], [[0], [0], [1]]])
    block = run_block(pushing, 0, 100)
    assert block.mean_high > block.mean_low + 1e-3


def test_C10(policy, monkeypatch):
    exact = listed(policy)
    monkeypatch.setattr(mountaincar, "COSINE", 1e-7)
    assert exact <= listed(policy)


def test_C11(policy):
    block = run_block(policy, 0, 20)
    assert block.width == pytest.approx((check.mountaincar.edge(20, -1) + 0.6) / 0.2)


def test_C12(monkeypatch):
    monkeypatch.setattr(dead_points, "PULL", 0.0)
    assert dead_points.at_rest(mc([[0, 0]], [[[1], [0], [0.4]]]))["dead"].tolist() == [True]


def test_C13(ax):
    from vsp_beyond.proofs import figures

    figures.upright(ax, np.zeros((4, 4), int), most=10)
    assert ax.images[0].get_extent() == pytest.approx([-np.pi, np.pi, -8, 8])


@pytest.mark.parametrize("seed", range(5))
def test_C14_C15(seed):
    rng, n = np.random.default_rng(seed), 48
    policy = vsp.VoronoiPolicy([[0, 0, 0]], rng.normal(size=(1, 4, 1)) * [[4], [4], [2], [1]], task=PENDULUM)
    way, states = pendulum._way(policy, 0, n), rng.uniform([-np.pi, -8], [np.pi, 8], size=(200_000, 2))
    of = lambda s: ((((s[:, 0] + np.pi) % (2 * np.pi)) / (2 * np.pi) * n).astype(int), ((s[:, 1] + 8) / 16 * n).astype(int).clip(0, n - 1))
    task = get_task(PENDULUM)
    i, j = of(states)
    a, b = of(task.step(states, policy.predict(task.see(states).astype(np.float32))[0])[0])
    first, last = way.first[:, i * n + j], way.last[:, i * n + j]
    assert ((a - first[0]) % n < last[0] - first[0]).all() and ((first[1] <= b) & (b < last[1])).all()


def test_C16(monkeypatch):
    seen = []
    monkeypatch.setattr(pendulum, "invariant", lambda near, *_, **__: seen.append(near) or near)
    still = vsp.VoronoiPolicy([[0.0, 0.0, 0.0]], np.zeros((1, 4, 1)), task=PENDULUM, metric="euclidean")
    pendulum.prove_pendulum(still, n=48)
    assert np.flatnonzero(seen[0].all(axis=1)).tolist() == list(range(21, 27))


def test_C21():
    still = vsp.VoronoiPolicy([[0.0, 0.0, 0.0]], np.zeros((1, 4, 1)), task=PENDULUM, metric="euclidean")
    content = pendulum.prove_pendulum(still, n=16).certificate()
    content |= {"pieces": [[5, 16]] * 16, "claim": {**content["claim"], "proved": content["claim"]["starts"], "longest": 5}}
    with pytest.raises(check.Refused, match="may lead to one with 5"):
        check.check_content(content)
