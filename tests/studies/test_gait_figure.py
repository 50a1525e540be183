import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from studies.show.gait import THICK, body_lines, cell_colors, footfall, gait_strip, save_gait
from vsp.show import style

LEG = {"leg x0": np.arange(6.0), "leg z0": 0.0, "leg x1": np.arange(6.0) + 0.5, "leg z1": 1.0}
FEET = {"back": [1, 0, 0, 1, 0, 1], "front": [0, 0, 0, 1, 1, 0]}
GAIT = pd.DataFrame({"step": range(6), "cell": [2, 2, 2, 0, 0, 5], **FEET, **LEG})


def test_lines_have_their_ends_in_every_step():
    assert np.array_equal(body_lines(GAIT)["leg"][3], [[3, 0], [3.5, 1]])


def test_a_strip_has_a_pose_a_time_and_the_feet_for_each_step_and_names_the_cells_that_act():
    fig, (ax,) = style.panels(1)
    gait_strip(ax, GAIT, range(1, 5), step_seconds=0.05)
    lines = ax.collections
    assert len(lines) == 4 and all(line.get_linewidths()[0] == THICK for line in lines)
    assert [label.get_text() for label in ax.get_xticklabels()] == ["0.00\n", "0.05\n", "0.10\nboth", "0.15\nfront"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["cell 1", "cell 3"]
    places = [line.get_segments()[0][:, 0].mean() for line in lines]
    assert np.allclose(np.diff(places), places[1] - places[0]) and places[0] == 0
    plt.close(fig)


def test_each_cell_has_a_colour_of_its_own_and_steps_must_have_been_recorded():
    assert len(set(cell_colors(GAIT).values())) == 3 and cell_colors(GAIT)[5] == cell_colors(GAIT[GAIT.cell == 5])[5]
    fig, (ax,) = style.panels(1)
    with pytest.raises(ValueError, match="steps are range.*expected some of the 6 recorded"):
        gait_strip(ax, GAIT, range(4, 7), step_seconds=0.05)
    plt.close(fig)


def test_bands_are_the_cells_and_bars_the_feet_on_the_ground():
    fig, (ax,) = style.panels(1)
    footfall(ax, GAIT, step_seconds=0.5)
    band, front, back = (list(bars) for bars in ax.containers)
    colors = cell_colors(GAIT)
    assert [bar.get_facecolor()[:3] for bar in band] == [to_rgb(colors[cell]) for cell in GAIT.cell]
    for foot, bars in (("back", back), ("front", front)):
        assert [bar.get_height() > 0 for bar in bars] == [bool(down) for down in GAIT[foot]]
    assert ax.get_xlim() == (0, 3)
    plt.close(fig)


def test_the_moving_picture_has_a_frame_per_step_in_the_colour_of_its_cell(tmp_path):
    made = [save_gait(GAIT, "gait", step_seconds=0.05, out=tmp_path / name, alt="a leg") for name in "ab"]
    assert made[0].gif == made[1].gif and made[0].about.alt == "a leg"
    with Image.open(tmp_path / "a/figures/gait.gif") as gif:
        frames = [np.asarray((gif.seek(i), gif.convert("RGB"))[1], dtype=int) for i in range(gif.n_frames)]
        assert gif.info["duration"] == 50
    assert len(frames) == len(GAIT)
    upper = [frame[60:150] for frame in frames]  # without the legend and the bands
    for cell, color in cell_colors(GAIT).items():
        wanted = 255 * np.array(to_rgb(color))
        shown = [bool((np.abs(part - wanted).max(axis=2) < 12).any()) for part in upper]
        assert shown == (GAIT.cell == cell).tolist()
