import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from studies import show
from vsp.show import panels

POINTS = pd.DataFrame(
    [("teacher", 0, 10.0, 1.0), ("refined", 2, 11.0, -3.0), ("faithful", 2, 10.1, 0.9), ("faithful", 4, 10.0, 0.97),
     ("CART, DAgger", 4, 8.0, 0.8), ("CART, DAgger, tuned", 4, 12.0, -5.0), ("CART", 32, 9.9, 0.9999),
     ("oblique tree, linear leaves, DAgger", 13, 10.0, 0.998), ("one linear map", 0, 1.0, 0.3)],
    columns=["method", "size", "mean", "r2"],
)  # fmt: skip


@pytest.fixture(autouse=True)
def closed():
    """Other tests count the open figures."""
    yield
    plt.close("all")


def drawn(ax):
    """The places of all marks and of the ends of lines, but of the two lines across."""
    marks = [np.asarray(marks.get_offsets()) for marks in ax.collections]
    lines = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) and line.get_ls() not in ("--", ":")]
    return np.vstack([*marks, *lines])


def test_every_method_lies_on_the_map():
    _, (ax,) = panels(1)
    show.fidelity_map(ax, POINTS, 10.0, linear=0.1)
    places = drawn(ax)
    ax.figure.canvas.draw()
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert (places[:, 0] < left).all() and (places[:, 0] > right).all()
    assert (places[:, 1] > low).all() and (places[:, 1] < high).all()
    found = {tuple(place) for place in places.round(6).tolist()}
    assert {(6.0, 2.0), (0.03, 0.0), (0.7, -9.0), (4.0, 1.0)} <= found
    assert not any(place[0] < 0.001 for place in found)  # 32 leaves are left out


def test_ours_are_joined_from_the_closest_to_the_highest_return():
    _, (ax,) = panels(1)
    show.fidelity_map(ax, POINTS, 10.0, linear=0.1)
    (line,) = (line for line in ax.lines if line.get_label() == "ours, 2 cells")
    assert np.allclose(line.get_xydata(), [[0.1, 0.1], [4.0, 1.0]])


def test_likeness_is_drawn_whole():
    _, (ax,) = panels(1)
    table = pd.DataFrame({"size": [1, 2, 4], "r2": [0.2, 0.8, 0.9], "r2_least": [-0.4, 0.7, 0.8],
                          "index": [np.nan, 0.9, 0.5], "ratio": [0.3, 0.7, 1.3]})  # fmt: skip
    show.likeness_over_cells(ax, table)
    assert ax.get_ylim()[0] <= -0.4 and ax.get_ylim()[1] >= 1.3
    assert [line.get_ydata().tolist() for line in ax.lines][0] == [0.2, 0.8, 0.9]
