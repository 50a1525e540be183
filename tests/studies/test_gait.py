from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest
from support import CHEETAH, PENDULUM, WALKER

from studies.robots.gait import phases, record_gait
from vsp.policy import VoronoiPolicy
from vsp.rollouts import visited_states
from vsp.tasks.registry import get_task


def standing():
    """Two cells that do nothing: leaning forwards and backwards."""
    codewords = np.zeros((2, 24))
    codewords[:, 0] = -1, 1
    return VoronoiPolicy(codewords, np.zeros((2, 25, 4)), task=WALKER, metric="euclidean")


def test_a_gait_is_the_episode_from_the_same_seed():
    task, policy = get_task(WALKER), standing()
    gait = record_gait(policy, WALKER, start=3, n_steps=30)
    states = visited_states(policy, task, np.array([[3.0]]))[:30]
    assert gait.step.tolist() == list(range(30)) and gait.cell.tolist() == policy.cells(states).tolist()
    assert np.array_equal(gait[["back", "front"]], states[:, [8, 13]])  # contacts, as the robot feels them


def test_lines_meet_at_the_joints():
    gait = record_gait(standing(), WALKER, start=3, n_steps=5)
    for leg in (1, 2):
        knee = [gait[[f"thigh {leg} x0", f"thigh {leg} z0"]], gait[[f"shin {leg} x1", f"shin {leg} z1"]]]
        assert np.abs(knee[0].to_numpy() - knee[1].to_numpy())[1:].max() < 0.01  # a step pulls the joints together
    corners = gait[[f"hull {i} {end}" for i in range(5) for end in ("x0", "z0")]].to_numpy().reshape(5, 5, 2)
    ends = gait[[f"hull {i} {end}" for i in range(5) for end in ("x1", "z1")]].to_numpy().reshape(5, 5, 2)
    assert np.array_equal(np.roll(corners, -1, axis=1), ends)


@pytest.mark.skipif(not find_spec("mujoco"), reason="needs mujoco")
def test_the_cheetah_stands_on_its_feet_and_is_as_long_as_its_torso():
    policy = VoronoiPolicy(np.zeros((1, 17)), np.zeros((1, 18, 6)), task=CHEETAH)
    gait = record_gait(policy, CHEETAH, start=0, n_steps=40)
    last = gait.iloc[-1]
    assert (last.back, last.front) == (1, 1) and len(gait) == 40 and gait.columns.str.endswith(" x0").sum() == 8
    assert np.hypot(last["torso x1"] - last["torso x0"], last["torso z1"] - last["torso z0"]) == pytest.approx(
        1, abs=1e-3
    )


def test_phases_by_hand():
    gait = pd.DataFrame({"cell": [0, 0, 0, 1], "back": [1, 1, 0, 0], "front": [1, 0, 0, 0]})
    found = phases(gait)
    assert found.loc[0].tolist() == [0.75, 2 / 3, 1 / 3, 1 / 3, 1 / 3] and found.loc[1].tolist() == [0.25, 0, 0, 0, 1]


def test_a_body_that_is_not_known_is_refused():
    with pytest.raises(ValueError, match="task is Pendulum-v1, expected one of .*: no other body is known"):
        record_gait(VoronoiPolicy(np.zeros((1, 3)), np.zeros((1, 4, 1)), task=PENDULUM), PENDULUM, start=0, n_steps=1)
