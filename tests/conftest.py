from pathlib import Path

import hypothesis
import measured
import pandas as pd
import pytest
from support import CurvedTeacher

from vsp import store

hypothesis.settings.register_profile("vsp", derandomize=True, database=None, deadline=None, max_examples=60)
hypothesis.settings.register_profile("torture", parent=hypothesis.settings.get_profile("vsp"), max_examples=200)
hypothesis.settings.load_profile("vsp")


def pytest_addoption(parser):
    parser.addoption(
        "--remake-golden", action="store_true", help="write tests/golden/*.json anew from the present code"
    )
    parser.addoption(
        "--record", type=Path, help="the folder that figures go into, see measured.py; else they are only shown"
    )


@pytest.fixture
def teacher():
    return CurvedTeacher()


@pytest.fixture
def ax():
    """Axes to draw into."""
    import matplotlib.pyplot as plt

    from vsp.figures import panels

    fig, axes = panels()
    yield axes[0]
    plt.close(fig)


@pytest.fixture
def record(request, capsys):
    """`record(table, what, to_hold, value, held)` shows and keeps a measured figure, then asserts that it holds.

    `why` explains, in the table too, what did not hold and is not expected to.
    """

    def record(table: str, what: str, to_hold: str, value: str, held: bool, *, why: str = "") -> None:
        verdict = "yes" if held else f"no: {why}" if why else "no"
        with capsys.disabled():
            print(f"\n{what}: {value} (to hold: {to_hold}; {verdict})", end="")
        if folder := request.config.getoption("record"):
            measured.record(folder / "trust.csv", table, what, to_hold, value, verdict)
        assert held or why, f"{what}: {value}, expected {to_hold}"

    return record


@pytest.fixture
def keep(request):
    """`keep(name, frame)` writes a whole table beside the one of `record`."""

    def keep(name: str, frame: pd.DataFrame) -> None:
        if folder := request.config.getoption("record"):
            text = frame.to_csv(index=False, float_format="%.4g", lineterminator="\n")
            store.write_listed(folder / f"{name}.csv", text)

    return keep
