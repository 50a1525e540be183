"""The committed results were made with today's settings, teachers and versions; and what is stale."""

import dataclasses
import shutil
from types import SimpleNamespace

import pandas as pd
import pytest
from support import CHEETAH, LUNARLANDER, MOUNTAINCAR, SIMPLEGOAL

from studies import drone
from studies.committed import RESULTS
from studies.comparison import beside, rows, stale
from studies.comparison.methods import METHODS, PRESETS, TASKS
from vsp.run import listed


def test_the_committed_results_are_those_of_todays_settings_teachers_and_versions():
    messages = stale.stale()
    assert not messages, "\n".join(messages)


def test_every_committed_row_and_policy_is_checked():
    named = {name for name, _, _ in stale.committed()}
    unchecked = {path.name for path in RESULTS.iterdir() if path.is_file()} - named - {listed.MANIFEST}
    assert not [name for name in unchecked if not name.startswith(("proofs", "zoo")) and "seconds" not in name]


@pytest.fixture
def patch(monkeypatch):
    """Leaves out methods that have no committed rows yet: the first test asks for these."""
    made = {name for path in RESULTS.glob("*_seconds*.csv") for name in pd.read_csv(path)["method"]}
    for name in {*METHODS} - made:
        monkeypatch.delitem(METHODS, name)
    return monkeypatch


@pytest.fixture
def results(tmp_path, patch):
    """A copy of the committed results, to spoil."""
    shutil.copytree(RESULTS, tmp_path / "beyond")
    patch.setattr("studies.committed.RESULTS", tmp_path / "beyond")
    return tmp_path / "beyond"


def says(name, what, target="beyond"):
    return f"data/beyond/{name} lacks today's {what}: `make {target}` makes what is missing"


def test_a_missing_or_damaged_file_is_named(results):
    (results / f"limit_{SIMPLEGOAL}.csv").unlink()
    with open(results / f"starts_{MOUNTAINCAR}.csv", "ab") as file:
        file.write(b"\n")
    missing, damaged = stale.stale()
    assert missing == f"data/beyond/limit_{SIMPLEGOAL}.csv is missing: `make beyond` makes it"
    assert damaged.startswith(f"{results / f'starts_{MOUNTAINCAR}.csv'}: SHA-256 is ")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda frame: frame.assign(version=9), "version"),
        (lambda frame: frame.drop(columns="settings"), "settings"),
        (lambda frame: frame.iloc[1:], "rows"),
        (lambda frame: pd.concat([frame, frame[:1]]), "rows"),
    ],
    ids=["version", "column", "row", "twice"],
)
def test_other_rows_are_stale(results, change, what):
    path = results / f"demanded_{SIMPLEGOAL}.csv"
    listed.write_listed(path, change(pd.read_csv(path, dtype=str)).to_csv(index=False))
    assert stale.stale() == [says(path.name, what)]


def raised(name):
    return lambda patch: patch.setitem(METHODS, name, dataclasses.replace(METHODS[name], version=9))


OF_CART = [says(f"methods_{task}.csv", "version") for task in TASKS]
OF_CART.append(says(f"methods_{LUNARLANDER}.csv", "version", "beyond-long"))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (raised("CART"), OF_CART),
        (lambda patch: patch.setattr(beside, "OPTIMUM_VERSION", 2), [says("optimum.csv", "version")]),
        (lambda patch: patch.setattr(beside, "GAIT_VERSION", 9),
         [says(f"gait_{CHEETAH}.csv", "version", "beyond-long")]),
        (lambda patch: patch.setattr(drone, "HARD", drone.HARD[1:]), [says("drone.csv", "settings", "drone")]),
    ],
    ids=["CART", "optimum", "gait", "drone"],
)  # fmt: skip
def test_results_of_another_version_are_stale(patch, change, expected):
    change(patch)
    assert stale.stale() == expected


def test_results_of_another_preset_are_stale(patch):
    before, changed = PRESETS["tuned"], dataclasses.replace(PRESETS["tuned"](SIMPLEGOAL), n_steps=99)
    patch.setitem(PRESETS, "tuned", lambda task: changed if task == SIMPLEGOAL else before(task))
    assert stale.stale() == [says(f"{table}_{SIMPLEGOAL}.csv", "settings") for table in ("methods", "teachers")]


def test_all_results_of_another_teacher_are_stale(patch):
    other = SimpleNamespace(digest="f" * 64)
    patch.setattr(rows, "_digest", lambda task, agent: other.digest)
    patch.setattr(beside, "load_teacher", lambda task: other)
    named = [message.split()[0].removeprefix("data/beyond/") for message in stale.stale()]
    assert named == [name for name, _, _ in stale.committed() if not name.startswith(("optimum", "agents", "drone"))]
