import base64
import io
import re
import zlib
from types import SimpleNamespace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image, UnidentifiedImageError
from support import python

import vsp
from vsp import geometry, get_task, show
from vsp.rollouts import Episode
from vsp.run import ROOT
from vsp.show import state_space, style
from vsp.show.style import TEXT_WIDTH, letter, panels, save_figure

mpl.use("Agg")
ALT = 'Two "cells" & their border <drawn> in grey'


def drawn(seed=0):
    """A figure with everything the paper's figures have: patches, arrows, images, colour bar, text, Greek, legend."""
    rng = np.random.default_rng(seed)
    fig, axes = panels(2)
    x, y, states = state_space.grid(np.zeros(2), np.ones(2), 40)
    codewords = rng.random((5, 2))
    state_space.cells(axes[0], x, y, geometry.nearest(codewords, states), fill=np.arange(5))
    state_space.codewords(state_space.square(axes[0]), codewords, numbers=True)
    coarse = state_space.grid(np.zeros(2), np.ones(2), 6)[2]
    state_space.arrows(axes[0], coarse, rng.uniform(-1, 1, coarse.shape))
    axes[0].legend()
    state_space.force_bar(fig, state_space.force_map(axes[1], x, y, np.sin(5 * states[:, 0])), axes[1:])
    letter(axes, [r"cells $\Delta x$", "force"])
    return fig


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The picture as it is shown, and its two files; the figure is closed."""
    out, others = tmp_path_factory.mktemp("saved"), plt.get_fignums()  # another module may have left one open
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        picture = save_figure(drawn(), "cells_example", alt=ALT, out=out)
    assert plt.get_fignums() == others
    return picture, out / "figures" / "cells_example.pdf", out / "figures" / "cells_example.png"


def streams(pdf):
    """A PDF's text with its compressed parts unpacked."""
    content = pdf.read_bytes()
    for part in re.findall(rb"stream\r?\n(.*?)endstream", content, flags=re.S):
        try:
            content += zlib.decompress(part)
        except zlib.error:
            pass
    return content


def test_the_picture_is_as_wide_as_a_page_of_the_proceedings(saved):
    assert abs(Image.open(saved[2]).width - 12.2 / 2.54 * 300) <= 1 and TEXT_WIDTH == pytest.approx(12.2 / 2.54)
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", saved[1].read_bytes())
    assert float(box[1]) == pytest.approx(12.2 / 2.54 * 72, abs=0.1)


def test_fonts_are_embedded_truetype(saved):
    content = streams(saved[1])
    assert b"/Type3" not in content and b"/Type 3" not in content
    assert b"/FontFile2" in content and b"/BaseFont" in content


def test_no_dates_and_no_versions(saved):
    _, pdf, png = saved
    for content in (streams(pdf), png.read_bytes()):
        assert b"CreationDate" not in content and b"ModDate" not in content and b"Software" not in content
        assert mpl.__version__.encode() not in content and b"Matplotlib v" not in content


def test_the_same_figure_gives_the_same_bytes(saved, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")  # `saved` was drawn with another
    for seed in (0, 1):
        save_figure(drawn(seed), "cells_example", alt=ALT, out=tmp_path / str(seed))
    for before in saved[1:]:
        same, other = ((tmp_path / str(seed) / "figures" / before.name).read_bytes() for seed in (0, 1))
        assert before.read_bytes() == same != other


def test_the_alternative_text_is_in_the_html_and_in_the_files(saved):
    picture, pdf, png = saved
    shown = picture._repr_html_()
    assert "<figure>" in shown and 'alt="Two &quot;cells&quot; &amp; their border &lt;drawn&gt; in grey"' in shown
    assert base64.b64decode(re.search(r"base64,([^\"]+)", shown)[1]) == png.read_bytes()
    assert ALT.encode() in png.read_bytes() and b"border" in streams(pdf) and repr(picture) == ALT


def test_an_embedded_picture_has_its_own_size_and_kind():
    picture, file = Image.new("P", (30, 10)), io.BytesIO()
    picture.save(file, "gif")
    shown = style.embedded(file.getvalue(), 'a "b" <c>', width=600)
    assert shown.startswith('<img alt="a &quot;b&quot; &lt;c&gt;" src="data:image/gif;base64,R0lG')
    assert 'width="600" height="200" style="max-width: 100%; height: auto"' in shown
    with pytest.raises(UnidentifiedImageError):
        style.embedded(b"no image", "")


def test_a_quick_figure_is_marked(saved, tmp_path):
    save_figure(drawn(), "x", alt=ALT, out=tmp_path, quick=True)
    full, quick = map(plt.imread, (saved[2], tmp_path / "figures" / "x.png"))
    middle = np.s_[full.shape[0] // 3 : -full.shape[0] // 3, full.shape[1] // 3 : -full.shape[1] // 3]
    assert full.shape == quick.shape and (full[middle] != quick[middle]).any()


def test_a_failed_save_says_why_and_leaves_the_previous_figure(saved, limit_files):
    """With too little room, matplotlib's own writer of PDF files dies of zlib's "buffer error" instead."""
    before = saved[1].read_bytes()
    limit_files(4096)
    with pytest.raises(OSError, match="File too large"):
        save_figure(drawn(seed=1), "cells_example", alt=ALT, out=saved[1].parents[1])
    plt.close("all")
    assert saved[1].read_bytes() == before and len(list(saved[1].parent.iterdir())) == 2


# What is drawn


def test_cell_borders_lie_between_the_codewords(ax):
    x, y, states = state_space.grid(np.zeros(2), np.ones(2), 201)
    index = geometry.nearest(np.array([[0.2, 0.5], [0.6, 0.5]]), states)
    state_space.cells(ax, x, y, index)
    corners = np.concatenate([path.vertices for c in ax.collections for path in c.get_paths()])
    assert len(corners) and np.abs(corners[:, 0] - 0.4).max() < 0.01


def test_one_cell_has_no_border(ax):
    x, y, states = state_space.grid(np.zeros(2), np.ones(2), 20)
    state_space.cells(ax, x, y, np.zeros(len(states), int), fill=np.zeros(1, int))
    assert not ax.collections and len(ax.images) == 1


def test_codewords_lie_where_they_are(ax):
    points = np.array([[0.2, 0.5], [0.6, 0.1]])
    state_space.codewords(state_space.square(ax), points, numbers=True)
    assert np.allclose(ax.collections[0].get_offsets(), points)
    assert [t.get_text() for t in ax.texts] == ["0", "1"]
    assert [(t.get_ha(), t.get_va()) for t in ax.texts] == [("left", "top"), ("right", "bottom")]  # towards the middle


def test_a_full_diagonal_action_spans_one_grid_step(ax):
    states = state_space.grid(np.zeros(2), np.ones(2), 11)[2]
    state_space.arrows(ax, states, np.tile([1.0, -1.0], (121, 1)))
    quiver = ax.collections[0]
    assert np.hypot(1, 1) / quiver.scale == pytest.approx(0.1, rel=0.02)
    assert np.allclose(quiver.U, 1) and np.allclose(quiver.V, -1) and quiver.scale_units == quiver.angles == "xy"


def test_the_force_map_has_pixels_centred_on_its_grid(ax):
    x, y, states = state_space.grid(np.array([-1.2, -0.07]), np.array([0.6, 0.07]), 19)
    image = state_space.force_map(ax, x, y, states[:, 0])
    left, right, bottom, top = image.get_extent()
    assert (left, right) == pytest.approx((-1.25, 0.65)) and bottom < -0.07 < 0.07 < top
    assert image.get_clim() == (-1, 1) and image.origin == "lower"
    assert image.get_array()[0, 0] == pytest.approx(-1.2) and image.get_array()[0, -1] == pytest.approx(0.6)


def test_a_codeword_has_its_number_and_its_colour_from_birth_to_death(ax):
    words, history = np.column_stack([0.1 * np.arange(11), np.zeros(11)]), vsp.History()

    def births(at, *run):  # in units of 0.1, so a codeword is as far from another as their numbers are
        policy = vsp.VoronoiPolicy(words[at], np.zeros((len(at), 3, 2)), task="SimpleGoal-v0", scale=[0.1, 1])
        return [policy, *(found.tolist() for found in state_space.birth_colours(policy, *run))]

    assert births([*range(10)])[1:] == [[*range(10)], [*range(8), 0, 1]]  # the first is the farthest from the ninth
    history.observe(0, 0.0, SimpleNamespace(codewords=words[:1], policy=lambda: births([0])[0]))
    history.add_events(1, "split", [(word, 1.0) for word in words[1:9]])
    history.add_events(2, "merge", [(words[3], 0.0)])
    history.add_events(3, "split", [(word, 1.0) for word in words[9:]])
    assert births([0, 9, 10, 8], history)[1:] == [[0, 9, 10, 8], [0, 3, 1, 0]]  # a colour that is free comes first
    assert births([0, 3, 8], history, 1)[1:] == [[0, 3, 8], [0, 3, 0]]
    state_space.codewords(state_space.square(ax), words[:10], numbers=np.arange(5, 15))
    assert [text.get_text() for text in ax.texts] == [f"{5 + i}" for i in range(10)]


def test_a_trail_runs_from_its_ring_to_where_the_last_action_led(ax):
    episode = Episode(np.array([[0.5, 0.2], [0.4, 0.2]]), np.array([[-1.0, 0.0], [0.0, 0.5]]))
    state_space.trail(ax, episode, get_task("SimpleGoal-v0"), color="k")
    assert np.allclose(ax.lines[0].get_xydata(), [[0.5, 0.2], [0.4, 0.2], [0.4, 0.25]])
    assert ax.lines[1].get_xydata().tolist() == [[0.5, 0.2]]


def test_importing_does_not_wait_for_what_few_notebooks_use():
    code = "import sys, vsp.show; print(sys.modules.keys() & {'seaborn', 'ipywidgets', 'scipy.stats', 'scipy.ndimage'})"
    assert python(code).strip() == "set()"


def test_lines_means_letters_and_rows_are_where_they_belong(ax):
    goal, pit = state_space.square(ax).patches
    assert [*goal.get_bbox().extents, *pit.get_bbox().extents] == pytest.approx([0, 0, 0.1, 0.1, 0.4, 0.4, 0.6, 0.6])
    letter([ax], ["one"])
    named = "TEACHER DISTILLED OURS GOAL PIT FAILING OTHER".split()
    assert ax.get_title(loc="left") == "(a) one" and len({getattr(style, name) for name in named}) == 7
    show.over_iterations(ax, np.array([3.0, 1.0]), ylabel="cells")
    show.reference(ax, 7.0, "x")
    drawn = [np.column_stack(line.get_data()).tolist() for line in ax.lines]
    assert drawn == [[[0, 3], [1, 1]], [[7, 0], [7, 1]]]
    show.margin(ax, ["1 %"], "fail")
    assert [text.get_position()[1] for text in ax.texts] == [-1, 0]
    show.ticks(ax, np.array([1, 2]), "splits", row=0)
    assert ax.lines[-1].get_xdata().tolist() == [1, 2]
    show.broken(ax, ax)
    assert not ax.spines["left"].get_visible() and [line.get_xdata() for line in ax.lines[-2:]] == [[1], [0]]


@pytest.mark.parametrize("path", sorted((ROOT / "figures").rglob("*.png")), ids=lambda path: path.stem)
def test_nothing_of_a_committed_figure_is_cut_off(path):
    pixels = np.asarray(Image.open(path).convert("L"))
    assert min(edge.min() for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1])) > 250


def test_a_figure_without_an_alternative_text_is_refused(tmp_path):
    with pytest.raises(ValueError, match="figure 'mine' has no alternative text: pass alt="):
        show.save_figure(show.panels(1)[0], "mine", out=tmp_path)
    plt.close("all")
    assert not list(tmp_path.rglob("*.png"))
