import numpy as np
import pandas as pd
import pytest
from drawn import hexes, named
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.colors import to_rgb

from studies import figures as show
from studies.comparison.methods import METHODS
from studies.figures import gaits as gait_module
from studies.figures.curves import MARKED
from vsp.show import style

# Return over likeness, and likeness over cells


def test_the_map_marks_every_method_and_joins_ours(ax):
    points = pd.DataFrame({"method": list(MARKED), "r2": np.arange(7.0), "mean": 10.0})
    show.fidelity_map(ax, points)
    _, line, *marks = ax.lines
    assert line.get_xdata().tolist() == [1, 2, 3]
    assert {mark.get_xdata()[0]: mark.get_color() for mark in marks} == {i: MARKED[m][2] for i, m in enumerate(MARKED)}
    assert [text.get_text() for text in ax.texts] == [label for label, *_ in MARKED.values()]


def test_likeness_is_a_line_per_task(ax):
    show.likeness_over_cells(ax, {"One": pd.DataFrame({"size": [1, 2, 4], "r2": [0.2, 0.8, 0.9]})})
    assert ax.lines[1].get_ydata().tolist() == [0.2, 0.8, 0.9] and ax.texts[1].get_text() == "One"


# Returns over cells

TRIED = pd.DataFrame(
    [(name, size, seed, -gap / size * (1 + seed)) for name, gap in (("our cells, tuned", 1.0), ("CART", 4.0))
     for size in (1, 2, 8) for seed in range(3)]
    + [("teacher", 0, 0, 10.0), ("our cells, no annealing", 3, 0, -50.0)],
    columns=["method", "size", "seed", "gap"],
)  # fmt: skip


def test_lines_are_medians_and_our_band_spans_the_seeds(ax):
    show.over_cells(ax, TRIED, "gap", {"our cells, tuned": {"color": style.OURS}, "CART": {"color": "0.4"}})
    lines = {name: line.get_xydata().tolist() for name, line in named(ax).items()}
    assert lines == {"our cells, tuned": [[1, -2], [2, -1], [8, -0.25]], "CART": [[1, -8], [2, -4], [8, -1]]}
    (band,) = (drawn for drawn in ax.collections if isinstance(drawn, FillBetweenPolyCollection))  # ours alone
    edge = band.get_paths()[0].vertices
    ends = edge[edge[:, 0] == 1, 1]
    assert (ends.min(), ends.max()) == pytest.approx((-2.8, -1.2)) and hexes(band.get_facecolor()) == [style.OURS]
    assert ax.get_ylim()[0] > -40  # what is not drawn stretches nothing
    assert ax.get_xticks().tolist() == [1, 2, 8]


@pytest.mark.parametrize("looks", [show.TUNING, show.LIMITS, show.ROBOTS], ids=["tuning", "limits", "robots"])
def test_every_method_has_a_look_and_a_name_of_its_own(looks):
    assert set(looks) <= set(METHODS)
    assert len({(s["color"], s.get("ls"), s.get("marker")) for s in looks.values()}) == len(looks)
    assert len({s["label"] for s in looks.values()}) == len(looks)


# Gaits

LEG = {"leg x0": np.arange(6.0), "leg z0": 0.0, "leg x1": np.arange(6.0) + 0.5, "leg z1": 1.0}
FEET = {"back": [1, 0, 0, 1, 0, 1], "front": [0, 0, 0, 1, 1, 0]}
GAIT = pd.DataFrame({"step": range(6), "cell": [2, 2, 2, 0, 0, 5], **FEET, **LEG})


def test_bands_are_the_cells_and_bars_the_feet_on_the_ground(ax):
    gait_module.footfall(ax, GAIT, step_seconds=0.5)
    band, front, back = (list(bars) for bars in ax.containers)
    colors = gait_module.cell_colors(GAIT)
    assert [bar.get_facecolor()[:3] for bar in band] == [to_rgb(colors[cell]) for cell in GAIT.cell]
    for foot, bars in (("back", back), ("front", front)):
        assert [bar.get_height() > 0 for bar in bars] == [bool(down) for down in GAIT[foot]]
    assert ax.get_xlim() == (0, 3)


def test_every_other_pose_is_drawn_in_the_colour_of_its_cell(ax):
    gait_module.poses(ax, GAIT, every=2)
    colors, middles = gait_module.cell_colors(GAIT), gait_module.APART * np.array([0.5, 1.5, 2.5])
    for pose, step, middle in zip(ax.collections, (1, 3, 5), middles, strict=True):
        assert pose.get_color()[0][:3] == pytest.approx(to_rgb(colors[GAIT.cell[step]]))
        (line,) = pose.get_segments()
        assert np.allclose(line, [[middle - 0.25, 0], [middle + 0.25, 1]])
