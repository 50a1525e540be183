"""Figures of one explanation: where a state lies, and what each input contributes."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from vsp.policy import Explanation, VoronoiPolicy
from vsp.show import state_space
from vsp.show.state_space import cells, codewords, image
from vsp.show.style import CODEWORD, FORCE_MAP, OTHER, OURS


def whereabouts(ax: Axes, policy: VoronoiPolicy, state: np.ndarray) -> Axes:
    """Draw where a two-dimensional state lies, from `policy.explain(state)`: its cell, codeword and nearest border.

    The arrow is the smallest change of a single input that leads to another cell, in units of the look-up's distance.
    The axes show the box of the states. If the codeword lies outside, they are larger and the box is dashed. Raises
    ValueError unless the task has two inputs.
    """
    why, task = policy.explain(state), policy.task
    if len(task.inputs) != 2:
        raise ValueError(f"{task.name} has inputs {task.inputs}, expected two; `contributions` takes any number")
    ends = np.array([task.low, task.high, why.codeword])
    outside = ((why.codeword < task.low) | (why.codeword > task.high)).any()
    room = 0.06 * np.ptp(ends, axis=0) * outside
    x, y, grid = state_space.grid(ends.min(axis=0) - room, ends.max(axis=0) + room, 401)
    index, way = policy.cells(grid).reshape(x.shape), _way_out(why, policy.scale)
    _two_cells(ax, x, y, index, why.cell, way[2] if way else None)
    inside = ((grid >= task.low) & (grid <= task.high)).all(axis=1).reshape(x.shape)
    for cell in set(index[inside]) - {why.cell}:
        _number(ax, x, y, inside & (index == cell), cell)
    values = ", ".join(f"{name} = {value:.3g}" for name, value in zip(task.inputs, state)).replace("-", "−")
    ax.plot(*state, "o", color=OURS, mec="white", mew=0.6, ms=5, zorder=5, ls="", label=f"state: {values}")
    ax.plot(*np.transpose([state, policy.codewords[why.cell]]), color=CODEWORD, lw=0.7, ls=":", zorder=3)
    codewords(ax, policy.codewords[[why.cell]], label=f"its codeword, of cell {why.cell}")
    if way:
        _arrow(ax, np.asarray(state), way, task.inputs)
    if outside:
        style = {"fill": False, "lw": 0.6, "ls": "--", "edgecolor": OTHER, "zorder": 2, "label": "box of the states"}
        ax.add_patch(Rectangle(task.low, *(task.high - task.low), **style))
    ax.set(xlim=x[0, [0, -1]], ylim=y[[0, -1], 0], xlabel=task.input_labels[0], ylabel=task.input_labels[1])
    return ax


def _way_out(why: Explanation, scale: np.ndarray) -> tuple[int, float, int] | None:
    """Return the input that leaves the cell by the smallest change, this change, and the next cell, or None."""
    changes = why.borders["change"].to_numpy()
    if np.isnan(changes).all():
        return None
    axis = int(np.nanargmin(np.abs(changes) / scale))
    return axis, float(changes[axis]), int(why.borders["cell"].iloc[axis])


def _two_cells(ax: Axes, x: np.ndarray, y: np.ndarray, index: np.ndarray, cell: int, behind: int | None) -> None:
    """Draw the borders of all cells. Tint cell `cell` in the policy's colour and cell `behind` in grey."""
    shades = np.ones((*x.shape, 4))
    shades[index == behind] = mpl.colors.to_rgba("0.91")
    shades[index == cell] = mpl.colors.to_rgba(OURS, 0.4)
    image(ax, x, y, shades, interpolation="nearest", zorder=0)
    cells(ax, x, y, index)


def _number(ax: Axes, x: np.ndarray, y: np.ndarray, inside: np.ndarray, cell: int) -> None:
    """Write the number of a cell where its region is widest; skip a region that is too narrow."""
    from scipy.ndimage import distance_transform_edt

    room = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    place = np.unravel_index(room.argmax(), x.shape)
    if room[place] > 0.04 * len(x):
        ax.text(x[place], y[place], str(cell), color=OTHER, fontsize=7, ha="center", va="center", zorder=2)


def _arrow(ax: Axes, state: np.ndarray, way: tuple[int, float, int], names: tuple[str, ...]) -> None:
    """Draw the arrow out of a cell, and add it to the legend."""
    axis, change, cell = way
    style = {"arrowstyle": "-|>", "lw": 0.9, "color": "black", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
    ax.annotate("", state + change * np.eye(2)[axis], state, arrowprops=style, zorder=4)
    text = f"{names[axis]} {'−' if change < 0 else '+'} {abs(change):.2g} leads to cell {cell}"
    ax.plot([], [], color="black", marker=">", ms=3, lw=0.9, markevery=[-1], label=text)


def contributions(ax: Axes, policy: VoronoiPolicy, state: np.ndarray) -> Axes:
    """Draw how inputs and bias add up to each action, from `policy.explain(state)`, as a waterfall chart.

    One block per action: a bar per term, then their sum and the sum clipped to the action's limits (dashed). Orange is
    positive, purple negative, as in the force map. Raises ValueError unless the sub-policies are linear.
    """
    policy.check_linear()
    why, task = policy.explain(state), policy.task
    row, labels = 0.0, dict[float, str]()
    for j, output in enumerate(task.outputs):
        weights, terms = policy.coefficients[why.cell, :, j], why.contributions.loc[output].to_numpy()
        names = [*(f"{weight:.2f} {name}" for weight, name in zip(weights, task.inputs)), "bias", "sum", "limited"]
        rows = row + 1 + np.arange(len(names))
        colours = [mpl.colormaps[FORCE_MAP](0.8 if term > 0 else 0.2) for term in terms] + ["0.65", "0.2"]
        lefts = np.array([0.0, *terms.cumsum()[:-1], 0.0, 0.0])
        _waterfall(ax, rows, lefts, np.array([*terms, why.raw[j], why.action[j]]), colours)
        limits = task.action_low[j], task.action_high[j]
        ax.vlines(limits, rows[0] - 0.5, rows[-1] + 0.5, color=OTHER, lw=0.6, ls="--", zorder=1)
        labels |= {row: output} | dict(zip(rows, names))
        row = rows[-1] + 1.3
    ax.axvline(0, color="black", lw=0.6, zorder=1)
    ax.set_yticks(list(labels), [label.replace("-", "−") for label in labels.values()])
    for label in ax.get_yticklabels():
        label.set_fontweight("bold" if label.get_text() in task.outputs else "normal")
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    ax.use_sticky_edges = False  # keep a margin between the bars and the edges of the axes
    ax.margins(x=0.03)
    ax.set(ylim=(row - 0.7, -0.6), xlabel="action, and what adds up to it")
    ax.xaxis.set_major_locator(MaxNLocator(5, min_n_ticks=3))
    return ax


def _waterfall(ax: Axes, rows: np.ndarray, lefts: np.ndarray, lengths: np.ndarray, colours: list) -> None:
    """Draw bars, write their lengths in the margin, and join the end of each bar to the start of the next."""
    ax.barh(rows, lengths, left=lefts, height=0.72, color=colours, zorder=2)
    ax.vlines((lefts + lengths)[:-2], rows[:-2] + 0.36, rows[1:-1] - 0.36, color="0.4", lw=0.5, zorder=3)
    for row, length in zip(rows, lengths):
        text, place = f"{length:.2f}".replace("-", "−"), ax.get_yaxis_transform()
        ax.text(1.17, row, text, transform=place, va="center_baseline", ha="right", fontsize=7)
