import numpy as np
import pandas as pd
import pytest
from drawn import hexes, named
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.colors import to_rgb
from PIL import Image

from studies import show
from studies.comparison.methods import FOUND, METHODS
from studies.show import gait as gait_module
from studies.show.methods import IMITATIONS
from vsp.show import style

POINTS = pd.DataFrame(
    [("teacher", 0, 10.0, 1.0), ("our cells, tuned", 2, 11.0, -3.0), ("faithful", 2, 10.1, 0.9),
     ("faithful", 4, 10.0, 0.97),
     ("CART, DAgger", 4, 8.0, 0.8), ("CART, DAgger, tuned", 4, 12.0, -5.0), ("CART", 32, 9.9, 0.9999),
     ("oblique tree, linear leaves, DAgger", 13, 10.0, 0.998), ("one linear map", 0, 1.0, 0.3)],
    columns=["method", "size", "mean", "r2"],
)  # fmt: skip


def drawn(ax):
    """The places of all marks and of the ends of lines, but of the two lines across."""
    marks = [np.asarray(marks.get_offsets()) for marks in ax.collections]
    lines = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) and line.get_ls() not in ("--", ":")]
    return np.vstack([*marks, *lines])


def test_every_method_lies_on_the_map(ax):
    show.fidelity_map(ax, POINTS, 10.0, linear=0.1)
    places = drawn(ax)
    ax.figure.canvas.draw()
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert (places[:, 0] < left).all() and (places[:, 0] > right).all()
    assert (places[:, 1] > low).all() and (places[:, 1] < high).all()
    found = {tuple(place) for place in places.round(6).tolist()}
    assert {(6.0, 2.0), (0.03, 0.0), (0.7, -9.0), (4.0, 1.0)} <= found
    assert not any(place[0] < 0.001 for place in found)  # 32 leaves are left out


def test_ours_are_joined_from_the_closest_to_the_highest_return(ax):
    show.fidelity_map(ax, POINTS, 10.0, linear=0.1)
    (line,) = (line for line in ax.lines if line.get_label() == "ours, 2 cells")
    assert np.allclose(line.get_xydata(), [[0.1, 0.1], [4.0, 1.0]])


def test_likeness_is_drawn_whole(ax):
    table = pd.DataFrame({"size": [1, 2, 4], "r2": [0.2, 0.8, 0.9], "r2_least": [-0.4, 0.7, 0.8],
                          "index": [np.nan, 0.9, 0.5], "ratio": [0.3, 0.7, 1.3]})  # fmt: skip
    show.likeness_over_cells(ax, table)
    assert ax.get_ylim()[0] <= -0.4 and ax.get_ylim()[1] >= 1.3
    assert [line.get_ydata().tolist() for line in ax.lines][0] == [0.2, 0.8, 0.9]


# Return over cells

TRIED = pd.DataFrame(
    [(name, size, seed, 10 - gap / size * (1 + seed), size) for name, gap in (("our cells, tuned", 1.0), ("CART", 4.0))
     for size in (1, 2, 8) for seed in range(3)]
    + [("the paper's method", 0, seed, 7.0 + seed, 12 + seed) for seed in range(3)]
    + [("teacher", 0, 0, 10.0, 0), ("our cells, no annealing", 3, 0, -50.0, 3)],
    columns=["method", "size", "seed", "mean", "cells"],
)  # fmt: skip


def test_return_over_cells_by_hand(ax):
    looks = {
        "our cells, tuned": {"color": style.DISTILLED},
        "CART": {"color": "0.4"},
        "the paper's method": {"color": "black", "marker": "D"},
    }
    show.return_over_cells(ax, TRIED, 10.0, linear=0.1, looks=looks)
    drawn_as = named(ax)
    assert list(drawn_as) == ["our cells, tuned", "CART", "teacher", "the paper's method"]
    assert drawn_as["our cells, tuned"].get_xydata().tolist() == [[1, -2], [2, -1], [8, -0.25]]
    assert drawn_as["CART"].get_xydata().tolist() == [[1, -8], [2, -4], [8, -1]]
    assert set(drawn_as["teacher"].get_ydata()) == {0.0} and drawn_as["teacher"].get_color() == style.TEACHER
    mark = drawn_as["the paper's method"].lines[0]
    assert mark.get_xydata().tolist() == [[13, -2]]
    (band,) = (drawn for drawn in ax.collections if isinstance(drawn, FillBetweenPolyCollection))  # ours alone
    edge = band.get_paths()[0].vertices
    ends = edge[edge[:, 0] == 1, 1]
    assert (ends.min(), ends.max()) == pytest.approx((-2.8, -1.2)) and hexes(band.get_facecolor()) == [style.DISTILLED]
    assert (ax.get_xscale(), ax.get_yscale(), ax.yaxis.get_transform().linthresh) == ("log", "symlog", 0.1)
    assert ax.get_ylim()[0] > -40  # what is not drawn does not stretch the view


@pytest.mark.parametrize("looks", [IMITATIONS, show.LIMITS, show.ROBOTS], ids=["imitations", "limits", "robots"])
def test_every_method_has_a_look_and_a_name_of_its_own(looks):
    assert set(looks) <= set(METHODS)
    assert len({(s["color"], s.get("ls"), s.get("marker")) for s in looks.values()}) == len(looks)
    assert len({s["label"] for s in looks.values()}) == len(looks)
    # A method with one size only has no curve: without a marker one would not see it
    assert all("marker" in look for name, look in looks.items() if METHODS[name].sizes == FOUND)


# Gaits

LEG = {"leg x0": np.arange(6.0), "leg z0": 0.0, "leg x1": np.arange(6.0) + 0.5, "leg z1": 1.0}
FEET = {"back": [1, 0, 0, 1, 0, 1], "front": [0, 0, 0, 1, 1, 0]}
GAIT = pd.DataFrame({"step": range(6), "cell": [2, 2, 2, 0, 0, 5], **FEET, **LEG})


def test_bands_are_the_cells_and_bars_the_feet_on_the_ground(ax):
    show.footfall(ax, GAIT, step_seconds=0.5)
    band, front, back = (list(bars) for bars in ax.containers)
    colors = gait_module.cell_colors(GAIT)
    assert [bar.get_facecolor()[:3] for bar in band] == [to_rgb(colors[cell]) for cell in GAIT.cell]
    for foot, bars in (("back", back), ("front", front)):
        assert [bar.get_height() > 0 for bar in bars] == [bool(down) for down in GAIT[foot]]
    assert ax.get_xlim() == (0, 3)


def test_the_moving_picture_has_a_frame_per_step_in_the_colour_of_its_cell(tmp_path):
    name = "beyond/gait_halfcheetah"
    made = [
        show.save_gait(GAIT, name, step_seconds=0.05, out=tmp_path / folder, quick=folder == "c") for folder in "abc"
    ]
    assert made[0].gif == made[1].gif != made[2].gif and made[0].png == made[1].png != made[2].png
    before, folded = made[0]._repr_html_().split("<details><summary>play the moving picture</summary>")
    assert "image/png" in before and "image/gif" not in before and "image/gif" in folded
    with Image.open(tmp_path / f"a/figures/{name}.gif") as gif:
        frames = [np.asarray((gif.seek(i), gif.convert("RGB"))[1], dtype=int) for i in range(gif.n_frames)]
        assert gif.info["duration"] == 50
    assert len(frames) == len(GAIT)
    upper = [frame[60:150] for frame in frames]  # without the legend and the bands
    for cell, color in gait_module.cell_colors(GAIT).items():
        wanted = 255 * np.array(to_rgb(color))
        shown = [bool((np.abs(part - wanted).max(axis=2) < 12).any()) for part in upper]
        assert shown == (GAIT.cell == cell).tolist()
