"""A picture of each section of the article, for readers without JavaScript and for paper; one moves, for the README."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

import data
import vsp
from vsp.rollouts import Policy
from vsp.show import state_space, style
from vsp.show.explorer.scene import starts_of
from vsp.tasks.simplegoal import TASK

WIDTH, PIXELS = 3.2, 880  # inches and pixels: shown 440 pixels wide, a type of 8 points is 15 pixels high
OPENING = 4.4  # inches: it is the README's picture too, wider and finer
N_COLOURS = 24  # of the palette of a PNG; what moves has twice as many
N_GRID = 403  # points on an axis: few lie on a border, where cells are tied
WAYS = np.array([[0.95, 0.62], [0.62, 0.95], [0.85, 0.85]])  # starts of the teacher's ways
HALFWAY = 4  # steps of the walkers
STEP, REST = 450, 2500  # milliseconds: of a step, and at the end
MOMENTS = (0, 20, 40, 4999)  # iterations of the run
SLIVER, ENLARGED = ((0.499, 0.503), (0.497, 0.501)), 250  # x and y of what is enlarged, and how many times
DECIMALS = {"paper": 4, "margin": 5}  # of the areas that fail, in percent, as in the text


def stills() -> dict[str, tuple[bytes, str]]:
    """Return a PNG and its alternative text for each section of the article, by name."""
    makers: dict[str, Callable[[], tuple[Figure, str]]] = {
        "opening": _opening, "teacher": _teacher, "one-map": _one_map, "cells": _cells, "fails": _fails, "few": _few,
        "certain": _certain, "you": _you,
    }  # fmt: skip
    made = {}
    for name, make in makers.items():
        figure, alt = make()
        made[name] = _png(figure, PIXELS * 3 // 2 if name == "opening" else PIXELS), alt
    return made


def moving() -> bytes:
    """Return the picture of the opening as a GIF that moves: a step a frame, a rest at the end, and again."""
    n_steps = max(len(way) for ways in _walks() for way in ways) - 1
    frames = np.stack([_pixels(_opening(step)[0], PIXELS) for step in range(n_steps + 1)])
    indices, palette = _few_colours(frames, 2 * N_COLOURS)
    first, *others = [Image.fromarray(each) for each in indices]
    first.putpalette(palette)
    for image in others:
        image.putpalette(palette)
    file, times = io.BytesIO(), [STEP] * n_steps + [REST]
    first.save(file, "gif", save_all=True, append_images=others, duration=times, loop=0, optimize=False)
    return file.getvalue()


def _opening(step: int = HALFWAY) -> tuple[Figure, str]:
    fig, axes = _boards(2, height=3.4, width=OPENING)
    policy, says, said = data.policies()["faithful_3"], data.says(), []
    names = f"network: {says['weights']:,} numbers", f"3 pairs of equations: {says['three_numbers']} numbers"
    _tiles(axes[1], policy)
    for ax, ways, name, colour in zip(axes, _walks(), names, (style.TEACHER, "black")):
        walked = [way[: step + 1][-2:] for way in ways]
        ax.add_collection(LineCollection(walked, color=colour, lw=0.4, alpha=0.5, zorder=3), autolim=False)
        ax.plot(*np.transpose([way[-1] for way in walked]), ls="", marker=".", ms=3.4, mew=0, color=colour, zorder=4)
        said.append(sum(len(way) <= step + 1 for way in ways))
        ax.set_title(name, loc="left", fontsize=8)
        for place, xy in {"pit": (0.5, 0.48), "goal": (0.075, 0.115)}.items():
            halo = [patheffects.withStroke(linewidth=2.5, foreground="white")]
            ax.text(*xy, place, ha="center", fontsize=8, zorder=5, path_effects=halo)
    for i, (codeword, colour) in enumerate(zip(policy.codewords, style.CELLS)):
        y = 0.245 - 0.095 * i
        fig.add_artist(Rectangle((0.012, y - 0.045), 0.976, 0.09, color=_pale(colour)))
        fig.text(0.03, y, "nearest to ({:.2f}, {:.2f})".format(*codeword), fontsize=8, va="center")
        equations = "\n".join(policy.equations(i)).replace("-", "−")
        fig.text(0.52, y, equations, fontsize=8, va="center", linespacing=1.25)
    fig.get_layout_engine().set(rect=(0, 0.295, 1, 0.695), h_pad=0.02)
    return fig, (
        "Two squares with goal and pit. 400 dots walk to the goal and around the pit, left led by a network, right by "
        "three pairs of equations in the colours of their cells, each with the state it is nearest to. "
        f"After {step} steps {said[0]} and {said[1]} are at the goal."
    )


@functools.cache
def _walks() -> list[list[np.ndarray]]:
    """Return the ways of the network and of the three pairs of equations from each start. Of each (n_steps + 1, 2)"""
    policies = data.teacher(), data.policies()["faithful_3"]
    return [
        [np.vstack([one.states, TASK.step(one.states[-1:], one.actions[-1:])[0]]) for one in episodes]
        for episodes in (vsp.collect_episodes(policy, TASK, starts_of(TASK)) for policy in policies)
    ]


def _teacher() -> tuple[Figure, str]:
    fig, (ax,) = _boards(1, height=3.35)
    _arrows(ax, data.teacher(), style.TEACHER)
    for episode in vsp.collect_episodes(data.teacher(), TASK, WAYS):
        state_space.trail(ax, episode, TASK, color="black")
    _legend(fig, ax)
    return fig, (
        "A square with the goal in its lower left corner and the pit in its middle. Arrows show where the teacher "
        "steps: mostly down and left, but to the side where the pit is in the way. Three of its ways lead around the "
        "pit to the goal."
    )


def _one_map() -> tuple[Figure, str]:
    policy = data.policies()["one_map"]
    fig, (ax,) = _boards(1, height=3.35)
    _arrows(ax, policy, style.DISTILLED)
    failing = _failing(ax, policy)
    _legend(fig, ax)
    return fig, (
        "The arrows of one linear map, fitted to the teacher: all point down and left. Dots mark the starts from which "
        f"it fails, {failing} of 400: they lie in the pit, and above and right of it."
    )


def _cells() -> tuple[Figure, str]:
    (final, history), said = data.distilled(), []
    fig, axes = _boards(len(MOMENTS), rows=2, height=3.6)
    for ax, n in zip(axes, MOMENTS):
        policy = final if n == MOMENTS[-1] else history.policy_at(n)
        cells = f"{len(policy)} cell{'s' * (len(policy) > 1)}"
        said.append(f"{cells} in iteration {n:,}")
        _tiles(ax, policy, history, n)
        state_space.codewords(ax, policy.codewords)
        ax.set_title(f"iteration {n:,}: {cells}", loc="left")
    return fig, (
        f"Four moments of a rerun of the paper's method: {', '.join(said)}. A dot marks the codeword of each cell."
    )


def _fails() -> tuple[Figure, str]:
    trained, refitted = data.policies()["run"], data.repaired()["run_worst_refitted"]
    worst, counts = int(data.failing_cells().argmax()), []
    x, y, points = state_space.grid(TASK.low, TASK.high, N_GRID)
    pale = _pale(style.CELLS[state_space.birth_colours(trained, data.distilled()[1])[1][worst]])
    index, inside = trained.cells(points), _points(11)[trained.cells(_points(11)) == worst]
    fig, axes = _boards(2, height=2.15)
    for ax, policy, name in zip(axes, (trained, refitted), ("as trained", "this cell refitted")):
        marked = np.where(index.reshape(x.shape)[..., None] == worst, pale, 1.0)
        state_space.image(ax, x, y, marked, interpolation="nearest", zorder=0)
        state_space.cells(ax, x, y, index, width=0.4, color="0.6")
        state_space.cells(ax, x, y, (index == worst).astype(int), width=1.4)
        _arrows(ax, policy, style.OTHER, where=inside)
        counts.append(_failing(ax, policy, worst))
        ax.set_title(f"{name}: {counts[-1]} fail", loc="left")
    _legend(fig, axes[0])
    return fig, (
        f"The {len(trained)} cells of the rerun, twice, with the starts that fail. Left, as trained, {counts[0]} of "
        "400 fail; one cell, above and right of the pit, is marked, and its arrows point down and left. Starts whose "
        "last step is in another cell are rings. Right, the map "
        f"of this cell is refitted by least squares: beside the pit its arrows turn away, and {counts[1]} starts fail."
    )


def _few() -> tuple[Figure, str]:
    says, sizes = data.says(), (8, 4, 3)
    fig, axes = _boards(len(sizes), height=1.42)
    for ax, k in zip(axes, sizes):
        policy = data.policies()[f"faithful_{k}"]
        _tiles(ax, policy)
        _arrows(ax, policy, style.OTHER, n=9)
        ax.set_title(f"{k} cells\nR² {says[f'faithful_{k}_r2']:.2f}", loc="left")
    r2 = ", ".join(f"{says[f'faithful_{k}_r2']:.2f} with {k} cells" for k in sizes)
    return fig, (
        f"Cells and arrows of three policies that act like the teacher: R² is {r2}. All three turn aside where the pit "
        "is in the way; none fails from the 400 starts."
    )


def _certain() -> tuple[Figure, str]:
    proofs = data.proofs()
    shares = {name: f"{100 * proofs[name]['share']:.{n}f} %" for name, n in DECIMALS.items()}
    fig, axes = _boards(2, height=2.35)
    for ax, name, cells in zip(axes, shares, ("13 cells, published", f"3 cells, enlarged {ENLARGED}×")):
        for i, polygon in enumerate(proofs[name]["polygons"]):
            label = None if i else "start that fails"
            ax.fill(*np.reshape(polygon, (-1, 2)).T, fc=style.FAILING, ec=style.FAILING, lw=0.2, zorder=2, label=label)
        ax.set_title(f"{cells}\n{shares[name]} fail", loc="left")
    (left, right), (low, high) = SLIVER
    axes[1].set(xlim=(left, right), ylim=(low, high))
    _legend(fig, axes[0])
    return fig, (
        f"The starts that surely fail. Of the published policy of 13 cells they fill {shares['paper']} of the square: "
        "a part of the pit, and a band from there to the upper right. Of a policy of three cells they are a sliver of "
        f"{shares['margin']} inside the pit, here enlarged {ENLARGED} times."
    )


def _you() -> tuple[Figure, str]:
    policy = data.policies()["misplaced"]
    fig, (ax,) = _boards(1, height=4.0)
    _tiles(ax, policy)
    _arrows(ax, policy, style.OTHER, n=11)
    state_space.codewords(ax, policy.codewords, size=30)
    _failing(ax, policy)
    rows = {"your start": policy, "the paper's 13 cells": data.policies()["paper"]}
    played = {name: data.played(each) for name, each in rows.items()} | {"the best possible": data.best()}
    said = [f"{name}: return {row['mean']:.2f}, {row['failures']} of 400 fail" for name, row in played.items()]
    ax.set_xlabel("\n".join(said))
    _legend(fig, ax)
    shown = "Three cells with their codewords, one out of place, and arrows: they lead into the pit from one side."
    return fig, f"{shown} {'; '.join(said).capitalize()}."


# Parts of a picture


def _boards(n: int, *, height: float, rows: int = 1, width: float = WIDTH) -> tuple[Figure, np.ndarray]:
    """Make a figure of n squares with goal and pit, in thin frames without numbers."""
    fig, axes = style.panels(n, width=width, height=height, rows=rows)
    fig.get_layout_engine().set(h_pad=0.07)
    for ax in axes:
        state_space.square(ax).set(xlabel="", ylabel="", xticks=[], yticks=[])
        ax.spines[:].set(visible=True, color="0.6", linewidth=0.5)
    return fig, axes


def _points(n: int) -> np.ndarray:
    """Return n by n states, evenly spread over the square. (n * n, 2)"""
    return state_space.grid(TASK.low + 0.5 / n, TASK.high - 0.5 / n, n)[2]


def _arrows(ax: Axes, policy: Policy, color: str, *, n: int = 12, where: np.ndarray | None = None) -> None:
    """Draw a policy's actions at n by n states, or at the states `where`, each arrow around its state."""
    states = _points(n) if where is None else where
    actions = 0.8 * np.asarray(policy.predict(states)[0], dtype=float)
    state_space.arrows(ax, states, actions, color=color)


def _tiles(ax: Axes, policy: vsp.VoronoiPolicy, history: vsp.History | None = None, n: float = np.inf) -> None:
    """Draw the cells of a policy in their colours: with the history of a run, of that after iteration n."""
    x, y, points = state_space.grid(TASK.low, TASK.high, N_GRID)
    state_space.cells(ax, x, y, policy.cells(points), fill=state_space.birth_colours(policy, history, n)[1])


def _pale(colour: str) -> np.ndarray:
    """Return a colour of `style.CELLS` as pale as pictures show it. (3,)"""
    return 1 - state_space.PALE * (1 - np.array(to_rgb(colour)))


def _failing(ax: Axes, policy: vsp.VoronoiPolicy, cell: int | None = None) -> int:
    """Draw the starts from which a policy fails, as rings if not in the cell `cell`; return their number."""
    starts, cells = starts_of(TASK)[data.failing(policy)], data.last_cells(policy)
    if cell is None:
        parts = {"start that fails": (style.FAILING, starts)}
    else:
        here, elsewhere = starts[cells == cell], starts[cells != cell]
        parts = {"fails in the marked cell": (style.FAILING, here), "fails in another": ("white", elsewhere)}
    for label, (fill, points) in parts.items():
        ax.scatter(*points.T, s=8, fc=fill, ec=style.FAILING, lw=0.7, zorder=6, label=label)
    return len(starts)


def _legend(fig: Figure, ax: Axes) -> None:
    """Say below a figure what its squares and dots are."""
    named = {label: handle for handle, label in zip(*ax.get_legend_handles_labels()) if label != "codeword"}
    fig.legend([*named.values()], [*named], frameon=False, loc="outside lower center", ncol=2 + (len(named) == 3))


def _pixels(figure: Figure, pixels: int) -> np.ndarray:
    """Draw a figure so many pixels wide and close it. (height, pixels, 3)"""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=pixels / figure.get_figwidth(), metadata={"Software": None})
    plt.close(figure)
    return np.asarray(Image.open(drawn).convert("RGB"))


def _few_colours(shown: np.ndarray, n: int) -> tuple[np.ndarray, bytes]:
    """Return what is drawn in its n most frequent colours, as their indices, and these colours."""
    codes, places, counts = np.unique(shown @ [1 << 16, 1 << 8, 1], return_inverse=True, return_counts=True)
    colours = np.column_stack([codes >> 16, codes >> 8 & 255, codes & 255])
    palette = colours[np.argsort(-counts, kind="stable")[:n]]
    nearest = np.square(colours[:, None] - palette).sum(axis=2).argmin(axis=1).astype(np.uint8)
    return nearest[places].reshape(shown.shape[:-1]), palette.astype(np.uint8).tobytes()


def _png(figure: Figure, pixels: int) -> bytes:
    """Return a figure as a PNG with its most frequent colours, and close it."""
    indices, palette = _few_colours(_pixels(figure, pixels), N_COLOURS)
    image, small = Image.fromarray(indices), io.BytesIO()
    image.putpalette(palette)
    image.save(small, "png", optimize=True)
    return small.getvalue()
