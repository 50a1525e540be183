import gc
import resource
import sys
from pathlib import Path

import hypothesis
import measured
import pytest
from support import CurvedTeacher

hypothesis.settings.register_profile("vsp", derandomize=True, database=None, deadline=None, max_examples=60)
hypothesis.settings.register_profile("many", parent=hypothesis.settings.get_profile("vsp"), max_examples=200)
hypothesis.settings.load_profile("vsp")


def pytest_addoption(parser):
    parser.addoption(
        "--remake-golden", action="store_true", help="write tests/golden/*.json anew from the present code"
    )
    parser.addoption(
        "--record", type=Path, help="write measurements into this folder, see measured.py; default: only print them"
    )


@pytest.fixture
def teacher():
    return CurvedTeacher()


@pytest.fixture
def ax():
    """Axes to draw into."""
    import matplotlib.pyplot as plt

    from vsp.show import panels

    fig, axes = panels()
    yield axes[0]
    plt.close(fig)


@pytest.fixture
def record(request, capsys):
    """`record(table, what, measured, unit, at_least=...)`, or `at_most=`: show and keep a measurement, then assert it.

    Arguments are those of `measured.row`. `why` explains a target that is known to be missed, and lets the test pass.
    """

    def record(*about, why: str = "", note: str = "", **numbers) -> None:
        row = measured.row(*about, note=note, **numbers)
        if row["met"] == "no" and why:
            row["note"] = "; ".join(filter(None, (note, why)))
        text = "{what}: {measured:g} {unit}, expected {rule} {target:g}; {note}".format(**row)
        with capsys.disabled():
            print(f"\n{text}", end="")
        if folder := request.config.getoption("record"):
            measured.add(folder / "trust.csv", row)
        assert row["met"] == "yes" or why, text

    return record


@pytest.fixture
def no_collection():
    """No garbage is collected meanwhile: what is collected in a deep recursion fails there, without a word of why."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.fixture
def limit_files(monkeypatch):
    """`limit_files(size)`: no file grows beyond `size` bytes until the test ends.

    Nor does Python compile any module meanwhile: it would leave a cut one in the environment, for every later import.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
