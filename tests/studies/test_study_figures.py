import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.colors import to_hex

from studies import figures as show
from studies.comparison.methods import METHODS
from studies.figures.curves import MARKED
from vsp.show import style


def test_the_map_marks_every_method_and_joins_ours(ax):
    points = pd.DataFrame({"method": list(MARKED), "r2": np.arange(7.0), "mean": 10.0})
    show.fidelity_map(ax, points)
    _, line, *marks = ax.lines
    assert line.get_xdata().tolist() == [1, 2, 3]
    assert {mark.get_xdata()[0]: mark.get_color() for mark in marks} == {i: MARKED[m][2] for i, m in enumerate(MARKED)}
    assert [text.get_text() for text in ax.texts] == [label for label, *_ in MARKED.values()]


TRIED = pd.DataFrame(
    [(name, size, seed, -gap / size * (1 + seed)) for name, gap in (("our cells, tuned", 1.0), ("CART", 4.0))
     for size in (1, 2, 8) for seed in range(3)]
    + [("teacher", 0, 0, 10.0), ("our cells, no annealing", 3, 0, -50.0)],
    columns=["method", "size", "seed", "gap"],
)  # fmt: skip


def test_lines_are_medians_and_our_band_spans_the_seeds(ax):
    show.over_cells(ax, TRIED, "gap", {"our cells, tuned": {"color": style.OURS}, "CART": {"color": "0.4"}})
    lines = {name: line.get_xydata().tolist() for line, name in zip(*ax.get_legend_handles_labels())}
    assert lines == {"our cells, tuned": [[1, -2], [2, -1], [8, -0.25]], "CART": [[1, -8], [2, -4], [8, -1]]}
    (band,) = (drawn for drawn in ax.collections if isinstance(drawn, FillBetweenPolyCollection))  # ours alone
    edge = band.get_paths()[0].vertices
    ends = edge[edge[:, 0] == 1, 1]
    assert (ends.min(), ends.max()) == pytest.approx((-2.8, -1.2)) and to_hex(band.get_facecolor()[0]) == style.OURS
    assert ax.get_ylim()[0] > -40  # what is not drawn stretches nothing
    assert ax.get_xticks().tolist() == [1, 2, 8]


@pytest.mark.parametrize("looks", [show.TUNING, show.LIMITS, show.ROBOTS], ids=["tuning", "limits", "robots"])
def test_every_method_has_a_look_and_a_name_of_its_own(looks):
    assert set(looks) <= set(METHODS)
    assert len({(s["color"], s.get("ls"), s.get("marker")) for s in looks.values()}) == len(looks)
    assert len({s["label"] for s in looks.values()}) == len(looks)
