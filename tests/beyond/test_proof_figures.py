import numpy as np
from matplotlib.colors import to_rgba

from vsp_beyond.proofs import figures
from vsp_beyond.proofs.figures import FAILING, KEPT


def test_basins_show_failing_pieces_above_the_others(ax):
    halves = [np.array([[0, 0], [1, 0], [1, 1]]), np.array([[0, 0], [1, 1], [0, 1]])]
    colours = figures.basins(ax, halves, [3, 5], np.array([True, False]), most=10)
    reached, failing = ax.collections
    assert np.allclose(reached.get_facecolor(), colours.to_rgba([3.0])) and failing.get_zorder() > reached.get_zorder()
    assert np.allclose(failing.get_facecolor(), to_rgba(FAILING)) and len(ax.patches) == 2


def test_upright_has_a_colour_for_each_kind_of_box(ax):
    numbers = np.zeros((4, 4), dtype=int)
    numbers[0, 1], numbers[2, 3] = -1, 7
    colours = figures.upright(ax, numbers, most=10)
    pixels = ax.images[0].get_array()  # rows are angular velocities
    assert np.allclose(pixels[1, 0], to_rgba(KEPT)) and np.allclose(pixels[3, 2], colours.to_rgba(7.0))
    assert np.allclose(pixels[0, 0], 1.0) and np.allclose(ax.images[0].get_extent(), [-np.pi, np.pi, -8, 8])
