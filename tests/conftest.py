import hypothesis
import pytest
from support import CurvedTeacher

hypothesis.settings.register_profile("vsp", derandomize=True, database=None, deadline=None, max_examples=60)
hypothesis.settings.load_profile("vsp")


def pytest_addoption(parser):
    parser.addoption(
        "--remake-golden", action="store_true", help="write tests/golden/*.json anew from the present code"
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
