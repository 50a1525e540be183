import functools
import io

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import named
from PIL import Image

from vsp.show import state_space
from vsp.show.stage import (
    Stage,
    borders,
    cells_and_changes,
    changes,
    ground,
    moment,
    png,
    policy_map,
)
from vsp.show.style import panels

mpl.use("Agg")


def stage():
    fig, axes = panels(2, dpi=50)
    for ax in axes:
        ax.set(xlim=(0, 1), ylim=(0, 1))
    return Stage(fig), axes


def test_a_stage_shows_what_is_painted_and_forgets_it():
    theatre, axes = stage()
    shots = [
        theatre.shoot(lambda: None),
        theatre.shoot(lambda: axes[1].fill_between([0.2, 0.8], 0.2, 0.8, color="red")),
        theatre.shoot(lambda: axes[0].plot([0, 1], [0, 1])),
        theatre.shoot(lambda: None),
    ]
    assert shots[0].dtype == np.uint8 and shots[0].shape[2] == 3
    red = (shots[1] == [255, 0, 0]).all(axis=2)
    place = axes[1].get_window_extent()
    assert red.sum() == pytest.approx(0.36 * place.width * place.height, rel=0.1)
    assert np.array_equal(shots[0], shots[3]) and (shots[2] != shots[0]).any()
    assert not axes[0].lines and not axes[1].collections and not plt.get_fignums()


def test_what_fails_is_not_in_the_next_shot():
    theatre, axes = stage()
    plain = theatre.shoot(lambda: None)

    def paint():
        axes[0].plot([0, 1], [0, 1])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        theatre.shoot(paint)
    assert np.array_equal(theatre.shoot(lambda: None), plain)


def test_a_shot_is_the_figure_drawn_in_full():
    """Two routes, but for the edges of the axes' lines, which a shot draws twice."""
    theatre, axes = stage()
    shot = theatre.shoot(lambda: axes[0].plot([0.1, 0.9], [0.1, 0.9], lw=5))
    other, (left, _) = stage()
    left.plot([0.1, 0.9], [0.1, 0.9], lw=5)
    other.stand()
    assert (other.shoot(lambda: None) != shot).any(axis=2).mean() < 0.01
    assert (theatre.shoot(lambda: None) != shot).any(axis=2).mean() > 0.01


def test_what_lies_on_top_does_not_depend_on_the_order_of_painting():
    def paint(order):
        for colour in order:
            axes[0].fill_between([0, 1], 0, 1, color=colour, zorder={"red": 2, "blue": 3}[colour])

    theatre, axes = stage()
    assert np.array_equal(theatre.shoot(lambda: paint(["red", "blue"])), theatre.shoot(lambda: paint(["blue", "red"])))


def test_a_quick_run_is_marked_on_every_shot():
    (plain, _), (marked, _) = stage(), stage()
    marked.watermark()
    shots = [marked.shoot(lambda: None) for _ in range(2)]
    assert (shots[0] != plain.shoot(lambda: None)).any() and np.array_equal(*shots)
    (covered, left), (hidden, right) = stage(), stage()
    covered.watermark()
    for axes in (left, right):
        axes[0].set_position([0, 0, 1, 1])
    over, under = (
        one.shoot(functools.partial(axes[0].fill_between, [0, 1], 0, 1, color="red", zorder=9))
        for one, axes in ((covered, left), (hidden, right))
    )
    assert (over != under).any()  # on top of what is painted


def test_a_png_has_the_pixels_and_no_date():
    image = np.random.default_rng(0).integers(256, size=(30, 40, 3), dtype=np.uint8)
    large, small = png(image), png(image, small=True)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(large))), image) and len(small) < len(large)
    assert np.asarray(Image.open(io.BytesIO(small)).convert("RGB")).shape == image.shape
    assert all(b"tIME" not in data and b"tEXt" not in data for data in (large, small))


def test_two_actions_are_arrows_and_one_is_a_force_map(ax):
    x, y, states = state_space.grid(np.zeros(2), np.ones(2), 3)
    arrows = np.tile([0.5, -0.25], (9, 1))
    policy_map(ax, x, y, arrows, color="C3")
    (quiver,) = ax.collections
    assert quiver.N == 9 and set(quiver.U) == {0.5} and set(quiver.V) == {-0.25}
    assert np.array_equal(np.column_stack([quiver.X, quiver.Y]), states)
    image = policy_map(ax, x, y, states[:, :1], color="C3")
    assert np.array_equal(image.get_array(), x) and image.get_clim() == (-1, 1)


def test_the_ground_of_each_task(ax):
    assert set(named(ground(ax, "SimpleGoal-v0"))) == {"goal", "pit"}
    ground(ax, "MountainCarContinuous-v0")
    assert (ax.get_xlim(), ax.get_ylim(), ax.get_xlabel()) == ((-1.2, 0.6), (-0.07, 0.07), "position")


def test_borders_by_hand(ax):
    x, y, _ = state_space.grid(np.zeros(2), np.ones(2), 4)
    index = np.array([[0, 0, 1, 1]] * 4)
    borders(ax, x, y, index.ravel())
    opaque = np.asarray(ax.images[0].get_array())[..., 3]
    assert opaque.tolist() == [[0, 1, 1, 0]] * 4
    borders(ax, x, y, index.T.ravel())
    assert np.asarray(ax.images[1].get_array())[..., 3].T.tolist() == [[0, 1, 1, 0]] * 4
    borders(ax, x, y, np.zeros(16, dtype=int))
    assert not np.asarray(ax.images[2].get_array())[..., 3].any()


def test_changes_are_where_they_belong(ax):
    changes(ax, np.array([[0.1, 0.2], [0.3, 0.4]]), np.array([[0.5, 0.6]]))
    found = {name: dots.get_offsets().tolist() for name, dots in named(ax).items()}
    assert found == {
        "came by a split": [[0.1, 0.2], [0.3, 0.4]], "went by a merge": [[0.5, 0.6]]
    }  # fmt: skip
    shapes = {dots.get_paths()[0].vertices.tobytes() for dots in named(ax).values()}
    assert len(shapes) == 2  # told apart without colours


def test_cells_over_iterations_with_every_pass_below(ax):
    cells_and_changes(ax, np.array([1, 1, 4, 4, 3]), [2, 2, 2], [4])
    cells, splits, merges = (line.get_xydata() for line in ax.lines)
    assert cells.tolist() == [[0, 1], [1, 1], [2, 4], [3, 4], [4, 3]]
    assert splits[:, 0].tolist() == [2] and merges[:, 0].tolist() == [4]
    low, high = ax.get_ylim()
    assert low < merges[0, 1] < splits[0, 1] < 0 and high > 4
    assert all(0 <= tick <= 4 and tick == int(tick) for tick in ax.get_yticks())
    moment(ax, 3, 4)
    dotted, dot = ax.lines[-2:]
    assert (
        set(dotted.get_xdata()) == {3} and dot.get_xydata().tolist() == [[3, 4]] and ax.texts[-1].get_text() == "n = 3"
    )
