import itertools

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import labels, named

from vsp.policy import VoronoiPolicy
from vsp.show import state_space, style
from vsp.show.style import letter, panels
from vsp_beyond.explain import figures

mpl.use("Agg")


# Why a policy acts as it does


def two_cells(codewords=((0.25, 0.5), (0.75, 0.5)), scale=None):
    """A border in the middle; Δx is limited, Δy is not."""
    maps = np.zeros((2, 3, 2))
    maps[0] = [[-4.0, 1.0], [-2.0, 0.5], [0.5, -0.25]]
    return VoronoiPolicy(np.array(codewords), maps, task="SimpleGoal-v0", scale=scale)


def test_the_whereabouts_of_a_state_by_hand(ax):
    policy, state = two_cells(), np.array([0.375, 0.5])
    figures.whereabouts(state_space.square(ax), policy, state)
    about = named(ax)
    assert list(about) == [
        "goal", "pit", "state: x = 0.375, y = 0.5", "its codeword, of cell 0", "x + 0.13 leads to cell 1",
    ]  # fmt: skip
    assert about["state: x = 0.375, y = 0.5"].get_xydata().tolist() == [[0.375, 0.5]]
    assert about["its codeword, of cell 0"].get_offsets().tolist() == [[0.25, 0.5]]
    (arrow,) = (text for text in ax.texts if not text.get_text())
    assert arrow.xy == pytest.approx([0.5, 0.5], abs=1e-3) and list(arrow.xyann) == state.tolist()
    (number,) = (text for text in ax.texts if text.get_text())  # the own cell is named in the legend
    assert number.get_text() == "1" and number.get_position()[0] == pytest.approx(0.75, abs=0.26)
    assert ax.get_xlim() == ax.get_ylim() == (0, 1) and ax.get_aspect() == 1


def test_the_own_cell_and_the_one_behind_the_border_are_tinted(ax):
    policy = VoronoiPolicy([[0.2, 0.5], [0.5, 0.5], [0.8, 0.5]], np.zeros((3, 3, 2)), task="SimpleGoal-v0")
    figures.whereabouts(ax, policy, np.array([0.1, 0.5]))
    shades = ax.images[0].get_array()[200]
    left, middle, right = (tuple(shades[i][:3]) for i in (20, 200, 380))
    assert right == (1, 1, 1) and middle[0] == middle[1] == middle[2] < 1 and left == mpl.colors.to_rgb(style.OURS)


def test_the_view_holds_a_codeword_outside_the_box(ax):
    figures.whereabouts(ax, two_cells([[0.25, -0.5], [0.75, 0.5]]), np.array([0.1, 0.1]))
    assert ax.get_ylim()[0] < -0.5 and ax.get_ylim()[1] > 1 and ax.get_xlim()[0] < 0
    frame = named(ax)["box of the states"]
    assert (frame.get_xy(), frame.get_width(), frame.get_height()) == ((0, 0), 1, 1)


def test_the_nearest_border_is_that_of_the_look_up(ax):
    """A border askew: up is shorter in units of the scale, right in those of the plot."""
    policy = VoronoiPolicy(
        [[0.25, 0.25], [0.75, 0.75]], np.zeros((2, 3, 2)), task="SimpleGoal-v0", metric="euclidean", scale=[0.5, 1.0]
    )
    why = policy.explain(np.array([0.5, 0.25]))
    right, up = why.borders["change"]
    assert right < up
    assert figures._way_out(why, np.ones(2)) == (0, right, 1)
    assert figures._way_out(why, np.array([0.05, 1.0]))[0] == 1


def test_where_there_is_one_cell_there_is_no_way_out(ax):
    policy = VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task="SimpleGoal-v0")
    figures.whereabouts(ax, policy, np.array([0.3, 0.4]))
    assert not ax.texts and not any("leads to" in name for name in named(ax))


def test_three_inputs_have_no_map(ax):
    policy = VoronoiPolicy([[0.5, 0.5, 0.0]], np.zeros((1, 4, 1)), task="Pendulum-v1")
    with pytest.raises(ValueError, match="Pendulum-v1 has inputs .* expected two"):
        figures.whereabouts(ax, policy, np.array([0.6, 0.8, 0.0]))


def test_contributions_add_up_to_the_sum_and_are_limited(ax):
    policy, state = two_cells(), np.array([0.25, 0.5])
    figures.contributions(ax, policy, state)
    bars = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in ax.patches]
    assert bars[:5] == [(0, -1), (-1, -2), (-2, -1.5), (0, -1.5), (0, -1)]
    assert bars[5:] == [(0, 0.25), (0.25, 0.5), (0.5, 0.25), (0, 0.25), (0, 0.25)]
    assert labels(ax) == [
        "Δx", "−4.00 x", "−2.00 y", "bias", "sum", "limited", "Δy", "1.00 x", "0.50 y", "bias", "sum", "limited",
    ]  # fmt: skip
    assert [text.get_text() for text in ax.texts][:5] == ["−1.00", "−1.00", "0.50", "−1.50", "−1.00"]
    places = dict(zip(labels(ax), ax.get_yticks()[:6]))
    assert places["sum"] == ax.patches[3].get_y() + 0.36 and ax.get_ylim()[0] > ax.get_yticks()[-1]
    less, more, total, limited = (mpl.colors.to_rgb(ax.patches[i].get_facecolor()) for i in (0, 2, 3, 4))
    assert less[2] > less[0] and more[0] > more[2] and total != limited
    limits = [line for line in ax.collections if {x for s in line.get_segments() for x in s[:, 0]} == {-1.0, 1.0}]
    assert len(limits) == 2  # one pair for each action


def test_contributions_have_any_number_of_inputs(ax):
    policy = VoronoiPolicy([[0.0, 0.0, 0.0]], np.array([[[1.0], [2.0], [0.5], [3.0]]]), task="Pendulum-v1")
    figures.contributions(ax, policy, np.array([1.0, 0.0, 2.0]))
    assert [bar.get_width() for bar in ax.patches] == [1, 0, 1, 3, 5, 2] and labels(ax)[0] == "τ"


def test_nothing_of_an_explanation_overlaps():
    """Labels, values and the legend: no two texts in one place."""
    fig, axes = panels(2, height=2.5)
    figures.whereabouts(state_space.square(axes[0]), two_cells(), np.array([0.375, 0.5]))
    figures.contributions(axes[1], two_cells(), np.array([0.375, 0.5]))
    letter(axes, ["where the state is", "what its cell adds up"])
    style.legend_below(fig, axes[0])
    fig.canvas.draw()
    shown = [t for t in fig.findobj(mpl.text.Text) if t.get_text() and t.get_visible()]
    boxes = [t.get_window_extent().shrunk(0.98, 0.7) for t in shown]
    pairs = itertools.combinations(zip(shown, boxes), 2)
    clashes = [(one.get_text(), other.get_text()) for (one, a), (other, b) in pairs if a.overlaps(b)]
    plt.close(fig)
    assert not clashes
