import numpy as np
import pytest

from studies.benchmarks import fits
from vsp_beyond.few_cells.search import whole_loss


def test_every_quantity_varies_alone():
    frame = fits.study({"dimensions": (2, 5), "states": (100, 200)})
    assert frame["varied"].tolist() == ["dimensions"] * 2 + ["states"] * 2
    assert frame["dimensions"].tolist() == [2, 5, 17, 17] and frame["states"].tolist() == [32_768, 32_768, 100, 200]
    assert (frame["seconds"] > 0).all() and (frame["megabytes"] > 0).all()
    assert frame[["settings", "version"]].drop_duplicates().to_dict("records") == [
        fits.made_with({"dimensions": (2, 5), "states": (100, 200)})
    ]


def test_what_is_measured_is_the_loss_that_a_fit_descends():
    """Its gradient is the slope of its value."""
    work = fits.evaluation(3, 2, 500)
    cells, seen = work.args
    value, gradient = work()
    step = 1e-6 * np.random.default_rng(1).normal(size=gradient.size)
    moved = [whole_loss(cells.like(cells.vector + sign * step), seen, **work.keywords)[0] for sign in (1, -1)]
    assert (moved[0] - moved[1]) / 2 == pytest.approx(gradient @ step, rel=1e-4) and value > 0


def test_a_hundred_thousand_states_need_no_more_memory_than_ten_thousand():
    frame = fits.study({"states": (10_000, 100_000)})
    assert frame["megabytes"][1] < 1.5 * frame["megabytes"][0]
