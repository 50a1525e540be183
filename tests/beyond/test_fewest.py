import dataclasses
import signal
import time

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, CurvedTeacher, PumpingTeacher

import vsp
from vsp_beyond import Faithful
from vsp_beyond.few_cells import fewest as module

QUICK = Faithful(
    n_cells=8, n_episodes=20, n_states=2000, n_restarts=2, n_generations=2, n_tuning_episodes=3, n_validation=20
)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(module, "faithful_preset", lambda task: QUICK)


def numbers(tried):
    return [(one.stage.name, one.policy.to_json(), one.alike.r2, one.level) for one in tried]


def test_a_linear_agent_is_one_equation_and_a_clock_decides_only_where_it_stops(monkeypatch, tmp_path):
    agent = vsp.agent(lambda obs: 5 * obs[:, 1:] + 0.3, name="line")
    chosen, tried, left = module.fewest(agent, vsp.get_task(MOUNTAINCAR), seed=0, folder=tmp_path / "all", sizes=(1, 2))
    assert (chosen.stage.n_cells, len(tried), left) == (1, 2, []) and chosen.alike.r2 > 0.9999
    assert chosen.policy.coefficients == pytest.approx(np.array([[[0], [5], [0.3]]]), abs=1e-3)
    make = module.Stage.make
    slow = lambda stage: time.sleep(20) if stage.n_cells == 2 else make(stage)  # noqa: E731
    monkeypatch.setattr(module.Stage, "make", slow)
    until = time.monotonic() + 5
    some = module.fewest(agent, vsp.get_task(MOUNTAINCAR), seed=0, folder=tmp_path / "some", until=until, sizes=(1, 2))
    assert (numbers(some[1]), some[2]) == (numbers(tried[:1]), ["2 cells"]) and time.monotonic() < until + 5
    monkeypatch.setattr(module.Stage, "make", make)
    again = module.fewest(agent, vsp.get_task(MOUNTAINCAR), seed=0, folder=tmp_path / "some", sizes=(1, 2))
    assert numbers(again[1]) == numbers(tried)
    with pytest.raises(module.TimeUp, match="1 cell: not finished in time, allow more minutes"):
        module.fewest(agent, vsp.get_task(MOUNTAINCAR), seed=1, folder=tmp_path, until=time.monotonic())


def test_kept_stages_are_made_once(monkeypatch, tmp_path):
    ask = {"seed": 0, "folder": tmp_path, "sizes": (1,)}
    module.fewest(CurvedTeacher(), vsp.get_task(SIMPLEGOAL), **ask)
    monkeypatch.setattr(module.Stage, "make", None)
    module.fewest(CurvedTeacher(), vsp.get_task(SIMPLEGOAL), **ask)


def judged(r2, ours, theirs, n_cells, level):
    returns = {"policy": np.array(ours, float), "agent": np.array(theirs, float)}
    alike = vsp.Likeness(r2, np.zeros((1, 2)), np.zeros((1, 1)), returns, {"policy": 0, "agent": 0})
    return module.Tried(module.Stage(None, n_cells, 0), None, alike, level)


def test_by_hand_the_fewest_that_are_alike_and_level_else_the_best_is_tuned(monkeypatch, tmp_path):
    found = {(1, False): (0.985, 9, True), (2, False): (0.992, 7, False), (4, False): (0.99, 8, True),
             (8, False): (1.0, 6, True)}  # fmt: skip
    made = []

    def of(stage, folder):
        made.append(stage.name)
        r2, returned, level = found[stage.n_cells, stage.tuned]
        return dataclasses.replace(judged(r2, [returned], [9], stage.n_cells, level), stage=stage)

    monkeypatch.setattr(module.Tried, "of", of)
    assert module.fewest(PumpingTeacher(), vsp.get_task(MOUNTAINCAR), seed=0, folder=tmp_path)[0].stage.n_cells == 4
    assert made == ["1 cell", "2 cells", "4 cells", "8 cells"]
    found |= {(4, False): (0.99, 8, False), (8, False): (1.0, 6, False), (4, True): (0.95, 8.9, True)}
    chosen, tried, _ = module.fewest(PumpingTeacher(), vsp.get_task(MOUNTAINCAR), seed=0, folder=tmp_path)
    assert len(tried) == 5 and made[-1] == "4 cells, tuned" and (chosen.stage.n_cells, chosen.stage.tuned) == (4, False)
    found[4, True] = 0.99, 8.9, True
    chosen = module.fewest(PumpingTeacher(), vsp.get_task(MOUNTAINCAR), seed=0, folder=tmp_path)[0]
    assert chosen.stage.name == "4 cells, tuned"


def test_by_hand_a_return_is_level_within_a_share_of_the_distance_to_the_best_constant(monkeypatch, tmp_path):
    seen = module.Seen(None, vsp.get_task(MOUNTAINCAR), QUICK, 0)
    assert seen.best_constant == 0.0  # that of no push
    vars(seen)["best_constant"] = 60.0
    arrays = {"codewords": [[0, 0]], "coefficients": np.zeros((1, 3, 1)), "scale": np.ones(2)}
    monkeypatch.setattr(module, "make_all", lambda *_: None)
    monkeypatch.setattr(module.Stage, "load", lambda *_: (dict(arrays), {}))
    for ours, level in ((99.3, True), (99.1, False)):
        alike = judged(1.0, [ours] * 4, [100.0] * 4, 1, None).alike
        monkeypatch.setattr(module, "likeness", lambda *_, alike=alike: alike)
        assert module.Tried.of(module.Stage(seen, 1, 0), tmp_path).level == level


def test_a_stage_of_another_agent_size_or_way_has_a_file_of_its_own(tmp_path):
    agents = CurvedTeacher(), vsp.agent(lambda obs: 0 * obs, name="still")
    one, other = (module.Stage(module.Seen(agent, vsp.get_task(SIMPLEGOAL), QUICK, 0), 2, 0) for agent in agents)
    stages = one, other, dataclasses.replace(one, tuned=True), dataclasses.replace(one, n_cells=4)
    assert len({stage.path(tmp_path) for stage in stages}) == 4


def test_a_tuning_asks_for_the_cells_of_its_stage_and_for_no_margin(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "faithful_preset", lambda task: dataclasses.replace(QUICK, margin=3.0))
    monkeypatch.setattr(module, "distill_faithfully", lambda agent, task, config, seed: asked.append(config) or 1 / 0)
    monkeypatch.setattr(module.Tried, "of", lambda stage, folder: dataclasses.replace(stage, tuned=True).make())
    with pytest.raises(ZeroDivisionError):
        module.fewest(PumpingTeacher(), vsp.get_task(MOUNTAINCAR), seed=0, folder="", sizes=(2,))
    assert (asked[0].n_cells, asked[0].margin) == (2, 0.0)


def test_no_alarm_is_left_after_what_was_in_time():
    with module.limited(60.0):
        pass
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_states_are_spread_in_units_of_their_deviations(monkeypatch):
    points = []
    monkeypatch.setattr(module, "spread", lambda those, n, rng: points.append(those) or np.arange(5))
    assert module.Seen(PumpingTeacher(), vsp.get_task(MOUNTAINCAR), QUICK, 0).labelled
    assert points[0].std(axis=0) == pytest.approx(1.0)


def test_an_input_that_hardly_varies_gets_no_large_weight(tmp_path):
    """Descents without a ridge let such a weight grow, balanced by the bias; one that never varies gets none."""
    rng = np.random.default_rng(0)
    states = np.column_stack([rng.normal(size=3000), rng.random(3000) < 0.996, np.ones(3000)])
    actions = np.tanh(states[:, :1]) + 0.02 * rng.normal(size=(3000, 1)) * (states[:, 1:2] == 0)
    labelled = module.Scaling(None, states.mean(axis=0), np.append(states.std(axis=0)[:2], 1.0))
    task = dataclasses.replace(vsp.get_task(PENDULUM), action_low=-np.ones(1), action_high=np.ones(1))
    labelled = dataclasses.replace(labelled, task=task).labelled(states, actions)
    labelled = dataclasses.replace(labelled, ridge=module.RIDGE)
    for k in (1, 2):
        cells = module.least_error(labelled, k, 2, np.random.default_rng(0))
        assert np.abs(cells.coefficients[:, 1]).max() < 0.1 and np.abs(cells.coefficients[:, 2]).max() < 1e-9


@pytest.mark.parametrize(("ours", "poor"), [(95.1, False), (94.9, True), (120.0, False)])
def test_where_failures_are_not_defined_a_lost_return_warns(ours, poor):
    returns = {"policy": np.full(4, ours), "agent": np.full(4, 100.0)}
    alike = vsp.Likeness(0.99, np.zeros((1, 2)), np.zeros((1, 1)), returns, dict.fromkeys(returns))
    assert alike.poor == poor == str(alike).startswith("warning: ")
    wide = alike.returns | {"policy": np.array([0, 180, 0, 180.0])}
    assert not dataclasses.replace(alike, returns=wide, failures={"policy": 0, "agent": 0}).poor
