import json

import numpy as np
import pandas as pd
import pytest

from studies import drone
from studies.batched import Batched
from studies.committed import read_results
from studies.figures.flights import MIXES, mixed
from vsp.evaluation import rollout_from_seed
from vsp.tasks import PIT
from vsp_beyond.drone import imitation
from vsp_beyond.drone.flights import command_of, fly
from vsp_beyond.drone.quadrotor import Starts, quadrotor

RNG = np.random.default_rng(0)


def test_the_teacher_is_what_its_card_says():
    card = json.loads(drone.TEACHER.with_suffix(".json").read_text("utf-8"))
    played = rollout_from_seed(drone.own_teacher(), quadrotor(), 300, seed=0)
    assert played.returns.mean() == pytest.approx(card["score"]["mean"], abs=0.3)
    assert (played.outcomes == PIT).mean() == card["score"]["lost"] == 0


def test_environments_advance_as_the_task_does():
    task, rng = quadrotor(Starts(3.0, 2.0, 0.0, 0.0)), np.random.default_rng(0)
    many = Batched(task, 50, rng)
    seen, ends, whole = many.reset(), 0, 0
    before = many._states.copy()
    for _ in range(450):
        many.step_async(np.zeros((50, 4), np.float32))
        after, rewards, outcomes = task.step(before, np.zeros((50, 4)))
        seen, earned, ended, infos = many.step_wait()
        assert np.array_equal(earned, rewards.astype(np.float32)) and ended[outcomes != 0].all()
        assert np.array_equal(seen[~ended], task.observe(after)[~ended])
        for i in np.flatnonzero(ended):
            assert np.array_equal(infos[i]["terminal_observation"], task.observe(after)[i])
            assert infos[i]["TimeLimit.truncated"] == (outcomes[i] != PIT)
            whole += infos[i]["TimeLimit.truncated"]
        ends += ended.sum()
        before = many._states.copy()
    assert ends > whole > 0


BLIND = "one map without past commands"


def test_the_regulator_costs_least_and_stays():
    policy = drone.regulator()
    here, steer, seen = imitation.loop_of(drone.CRAZYFLIE)
    begin = np.append(RNG.normal(size=12), np.tile(RNG.normal(size=4), 2))

    def cost(gain):
        state, total = begin, 0.0
        for _ in range(3000):
            inputs, command = seen @ state, gain @ seen @ state
            total += inputs @ np.diag(np.repeat([1, 10, 1, 1, 0.1, 0], [3, 2, 1, 3, 3, 4])) @ inputs + command @ command
            state = here @ state + steer @ command
        return total

    gain = policy.coefficients[0, :16].T
    assert cost(gain) < min(cost(gain * (1 + 0.05 * RNG.normal(size=gain.shape))) for _ in range(5))
    flown = fly(command_of(policy), Starts(tilt=120.0)(RNG, 50))
    assert flown.kept.all() and flown.distance.max() < 0.05


@pytest.mark.parametrize(("condition", "rests"), [("motor lag x 1.5", True), ("mass - 20 %", False)])
def test_the_loop_at_rest_has_the_eigenvalue_of_the_linear_step(condition, rests):
    """With another mass the regulator drifts and never rests."""
    policy, body = drone.regulator(), drone.BODIES[condition]
    at_rest, linear = drone.radius_at_rest(command_of(policy), body), imitation.loop_of(body)
    by_hand = imitation.radius(policy.coefficients[0, :16], linear)[0] if rests else np.nan
    assert at_rest == pytest.approx(by_hand, abs=1e-9, nan_ok=True)


def test_rows_of_small_maps(monkeypatch, tmp_path):
    for module, name, value in (
        (drone, "N", 20), (imitation, "FLIGHTS", 40), (imitation, "OWN_FLIGHTS", 20), (imitation, "ROUNDS", 1),
        (imitation, "N_STEPS", 200), (drone, "HARD", drone.HARD[:1]), (drone, "EASY", drone.EASY[:2]),
        (drone, "CONDITIONS", ("as built", drone.CONDITIONS[-1])), (drone, "BODIES", {"as built": drone.CRAZYFLIE}),
        (imitation, "BODIES", {"as built": drone.CRAZYFLIE}),
        (drone, "SEEDS", {"network": range(1), "LQR": range(1), "one map": range(2), BLIND: range(1)}),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr("sys.argv", ["drone", "--jobs=1", f"--out={tmp_path}"])
    (tmp_path / "drone.csv").touch()
    monkeypatch.setattr(drone, "RESULTS", tmp_path)
    monkeypatch.setattr(drone, "read_results", lambda name: pd.DataFrame({"agent": ["flown", "own"], "kept": [2, 3]}))
    drone.main()
    rows = read_results("drone", tmp_path / "data/beyond")
    assert rows["agent"].tolist() == ["flown"] + ["own"] * 20 and rows["kept"][0] == 2
    mine = rows[1:].set_index(["flies", "condition", "starts", "tilt"])
    numbers = mine["numbers"].groupby("flies").first()
    assert numbers.to_dict() == {"network": 5508, "LQR": 68, "one map": 68, BLIND: 52}
    network, ours, blind = (mine.loc[flies, "as built", "easy", 60] for flies in ("network", "one map", BLIND))
    assert network["kept"] == 1 and network["more"] == 0 and network["r2"] == 1
    assert ours["more_low"] <= ours["more"] <= ours["more_high"]
    assert blind["more"] == pytest.approx(blind["kept"] - 1) and blind["kept"] < 0.5
    assert mine.loc["network", drone.CONDITIONS[-1], "easy", 60]["change"] > 2 * network["change"]
    made = (drone.Measured("", "one map", i).load(tmp_path / "build/drone")[1]["radii"]["as built"] for i in range(2))
    assert ours["radius"] == pytest.approx(max(made), abs=1e-6)


def test_every_push_is_as_long_as_it_says(monkeypatch):
    monkeypatch.setattr(drone, "fly", lambda *about, pushes: np.linalg.norm(pushes, axis=1))
    assert np.allclose(drone._flights(command_of(drone.regulator()), drone.CONDITIONS[-1], drone.EASY[0]), 0.5)


@pytest.mark.parametrize(("agent", "fewest"), [("flown", "one map"), ("own", "four cells")])
def test_committed_rows_reach_the_goal(agent, fewest):
    rows = read_results("drone").query("agent == @agent")
    assert set(rows["flies"]) == set(drone.SEEDS)
    ours = rows[rows["flies"] == fewest]
    assert len(ours) == 56 and (ours["numbers"] <= 350).all() and (ours["seeds"] == 10).all()
    assert (ours["more_high"] >= 0).all() and (agent == "own" or (ours["more"] >= 0).all())
    assert ours["radius"][ours["condition"] == "as built"].max(skipna=False) < 0.995
    kept = rows.pivot_table(index=["condition", "starts", "tilt"], columns="flies", values="kept")
    assert (kept["LQR"] == kept.max(axis=1)).all()


def test_mixed_numbers_say_what_the_map_does():
    policy = drone.regulator().with_maps(RNG.normal(size=(1, 17, 4)) / 100)
    inputs, mixes = RNG.uniform(-1, 1, 16), np.array(list(MIXES.values()))
    shown = np.concatenate([inputs[:12], mixes @ inputs[12:] / 4, [1]])
    assert np.allclose(shown @ mixed(policy).to_numpy(), mixes @ policy.predict(inputs[None])[0][0] / 4)
