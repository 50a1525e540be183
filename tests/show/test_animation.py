import base64
import functools
import html
import re
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image, ImageSequence

from vsp.show.animation import Stage, save_frames
from vsp.show.style import panels

mpl.use("Agg")
ROOT = Path(__file__).resolve().parents[2]
ALT = 'a bar "moves" & <stops>'


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


def frames():
    """A black bar that moves to the right over white, the mean of each frame the same."""
    images = np.full((12, 30, 48, 3), 255, dtype=np.uint8)
    for i, image in enumerate(images):
        image[:, 4 * i : 4 * i + 4] = 0
    return list(images)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return save_frames(frames(), "bar", out=out, alt=ALT, step=40, hold=900), out / "figures"


def test_a_gif_has_every_frame_and_rests_on_the_last(saved):
    gif = Image.open(saved[1] / "bar.gif")
    assert gif.info["loop"] == 0  # for ever
    shown = [(frame.info["duration"], np.asarray(frame.convert("RGB"))) for frame in ImageSequence.Iterator(gif)]
    assert [duration for duration, _ in shown] == [40] * 11 + [900]
    assert all(np.array_equal(frame, image) for (_, frame), image in zip(shown, frames()))
    assert np.array_equal(np.asarray(Image.open(saved[1] / "bar.png").convert("RGB")), frames()[-1])


def test_it_is_shown_with_words_and_moves_only_when_asked(saved):
    shown, folder = saved
    text = shown._repr_html_()
    still, moving = re.findall(
        r'<img alt="([^"]*)" src="data:image/(\w+);base64,([^"]+)" width="720" height="450"', text
    )
    assert [html.unescape(one[0]) for one in (still, moving)] == [f"The last frame of the moving picture: {ALT}", ALT]
    for (_, kind, data), name, held in ((still, "png", shown.still), (moving, "gif", shown.gif)):
        assert kind == name and base64.b64decode(data) == held == (folder / f"bar.{name}").read_bytes()
    before, folded = text.split("<details><summary>play the moving picture</summary>")
    assert "image/png" in before and "image/gif" not in before and folded.endswith("</details></figure>")
    assert repr(shown) == ALT


def test_the_same_frames_give_the_same_bytes(saved, tmp_path):
    save_frames(frames(), "bar", out=tmp_path, alt="x", step=40, hold=900)
    for name in ("bar.gif", "bar.png"):
        assert (tmp_path / "figures" / name).read_bytes() == (saved[1] / name).read_bytes()
