from pathlib import Path

import hypothesis
import measured
import pytest
from support import CurvedTeacher

hypothesis.settings.register_profile("vsp", derandomize=True, database=None, deadline=None, max_examples=60)
hypothesis.settings.register_profile("torture", parent=hypothesis.settings.get_profile("vsp"), max_examples=200)
hypothesis.settings.load_profile("vsp")


def pytest_addoption(parser):
    parser.addoption(
        "--remake-golden", action="store_true", help="write tests/golden/*.json anew from the present code"
    )
    parser.addoption(
        "--record", type=Path, help="the CSV that figures go into, see measured.py; else they are only shown"
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
    """`record(table, what, to_hold, value, held)` shows and keeps a measured figure, then asserts that it holds."""

    def record(table: str, what: str, to_hold: str, value: str, held: bool) -> None:
        with capsys.disabled():
            print(f"\n{what}: {value} (to hold: {to_hold})", end="")
        if path := request.config.getoption("record"):
            measured.record(path, table, what, to_hold, value, held)
        assert held, f"{what}: {value}, expected {to_hold}"

    return record
