"""What readers change in notebooks 06 to 12: parameters, and their *try*; quick, but with `make test-tries`."""

import numpy as np
import pytest
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL
from test_tries import run

from vsp.run.command import CommandError

# The last cell that it concerns
LAST = {"06": "read-figure", "07": "cells", "10": "state", "11": "fit", "12": "film"}


EDITS = [
    ("06", {"task": SIMPLEGOAL}), ("06", {"task": SIMPLEGOAL, "n_cells": 4, "seed": 3}), ("06", {"n_cells": 1}),
    ("06", {"n_cells": 3, "seed": 1}), ("10", {"cell": 1}), ("10", {"cell": 0, "torque": "τff"}),
    ("07", {"at_rest": 0.7, "slope": 20, "task": MOUNTAINCAR}), ("07", {"at_rest": 0.3, "task": PENDULUM}),
    ("11", {"agent": "ppo", "task": PENDULUM, "n_cells": 2}), ("11", {"agent": "ars", "n_cells": 1, "seed": 5}),
    ("12", {"start": 59}),
]  # fmt: skip


@pytest.mark.parametrize(("number", "changes"), EDITS, ids=str)
def test_other_values_run_through(number, changes, tmp_path, capsys):
    names = run(number, tmp_path, last=LAST[number], **changes)
    said = capsys.readouterr().out
    if number == "06":
        by_hand = names["by_hand"]
        assert len(by_hand) == names["n_cells"] and by_hand.task.name == names["policy"].task.name == names["task"]
        assert len(list(tmp_path.rglob("*.png"))) == 2
    if number == "07":
        assert np.isnan(names["dead"]) == (names["at_rest"] == 0.7) and len(list(tmp_path.rglob("*.png"))) == 2
        assert f"dead point of {names['one']}: {'none' if names['at_rest'] == 0.7 else '-0.'}" in said
    if number == "10":
        assert names["why"].cell == names["cell"] and names["terms"]["adds"].abs().is_monotonic_decreasing
        assert names["terms"]["adds"].sum() == pytest.approx(names["why"].raw[names["action"]])
    if number == "11":
        assert len(names["fitted"]) <= names["n_cells"] and "each action within 5% of its range in" in said


@pytest.mark.parametrize(
    ("number", "changes", "said"),
    [
        ("06", {"task": PENDULUM}, "^task is 'Pendulum-v1', expected 'MountainCarContinuous-v0', 'SimpleGoal-v0'$"),
        ("06", {"n_cells": 0}, "^n_cells is 0, expected a whole number from 1 to 16$"),
        ("07", {"task": "LunarLanderContinuous-v3"}, "^task is 'LunarLanderContinuous-v3', expected 'SimpleGoal-v0', "),
        ("10", {"cell": 8}, "^cell is 8, expected a whole number from 0 to 7$"),
        ("10", {"torque": "F"}, "^torque is 'F', expected 'τbt', "),
        ("12", {"start": 60}, "^start is 60, expected a whole number from 0 to 59$"),
        ("11", {"agent": "td3"}, "^agent for MountainCarContinuous-v0 is 'td3', expected 'a2c', 'ars', 'ddpg', "),
        ("11", {"task": SIMPLEGOAL}, "^task is 'SimpleGoal-v0', expected 'MountainCarContinuous-v0', 'Pendulum-v1'$"),
    ],
)
def test_what_is_not_possible_is_one_line(number, changes, said, tmp_path):
    with pytest.raises(CommandError, match=said):
        run(number, tmp_path, last=LAST[number], **changes)
