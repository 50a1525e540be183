"""Animation of a distillation: the partition grows over the map of the distilled policy.

`Growth` draws a run at any iteration; `save_growth` writes it as a GIF, with a still image for readers who want no
motion.
"""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from ..history import History
from ..policy import VoronoiPolicy
from ..rollouts import Policy, rollout
from ..run import atomic
from ..tasks.base import Task
from ..tasks.registry import get_task
from . import state_space, style
from .captions import Caption, caption_of
from .stage import Stage, borders, cells_and_changes, changes, ground, moment, png, policy_map

WIDTH, HEIGHT = 6.0, 2.6  # inches
FINE = 301  # grid points per axis for the borders of cells
MAPS = {"SimpleGoal-v0": 17, "MountainCarContinuous-v0": 101}  # grid points per axis of a policy map; few for arrows
FRAMES = 24
STEP, HOLD = 200, 2500  # milliseconds per frame, and for the last one
DPI, COLOURS = 120, 64  # dots per inch of a GIF, and the size of its palette


class Maps:
    """Draw the policy maps of a task and the cells on them. Raises ValueError for a task without such a map."""

    def __init__(self, task: Task):
        if task.name not in MAPS:
            raise ValueError(f"task is {task.name}, expected one of {list(MAPS)}: a policy map needs two inputs")
        self.task = task
        self._fine = state_space.grid(task.low, task.high, FINE)
        self._grid = state_space.grid(task.low, task.high, MAPS[task.name])

    def panels(self, teacher: Policy, dpi: int) -> tuple[Figure, np.ndarray]:
        """Return a figure and three axes: the teacher's map, an empty one for the distilled policy, and free axes."""
        fig, axes = style.panels(3, width=WIDTH, height=HEIGHT, dpi=dpi)
        fig.get_layout_engine().set(wspace=0.04)
        for ax in axes[:2]:
            ground(ax, self.task.name)
        axes[1].set_ylabel("")
        axes[1].tick_params(labelleft=False)
        image = self.policy(axes[0], teacher, color=style.TEACHER)
        if len(self.task.outputs) == 1:
            state_space.force_bar(fig, image, axes[:2])
            fig.axes[-1].set(ylabel="", title="force")  # a label beside the bar would seem to belong to the next panel
        return fig, axes

    def policy(self, ax: Axes, actor: Policy, *, color: str = style.DISTILLED) -> Artist:
        """Draw the actions of `actor`: arrows in `color` for two actions, a force map for one. Return the artist."""
        x, y, states = self._grid
        return policy_map(ax, x, y, actor.predict(states)[0], color=color)

    def cells(self, ax: Axes, policy: VoronoiPolicy) -> None:
        """Draw the cells of `policy` with their codewords."""
        x, y, states = self._fine
        borders(ax, x, y, policy.cells(states))
        state_space.codewords(ax, policy.codewords)


def check_plays(policy: Policy, task: Task) -> None:
    """Raise ValueError unless `policy` can take a step of `task`."""
    rollout(policy, dataclasses.replace(task, max_steps=1), task.start(np.random.default_rng(0), 1))


class Growth:
    """Draw a run at any iteration: the teacher's map, the distilled policy's map and cells, and the number of cells.

    Raises ValueError for a task without policy maps, for anything but a history of the paper's method on this task,
    and for a teacher that cannot act in the task.
    """

    def __init__(self, history: History, teacher: Policy, task: str | Task, *, dpi: int = DPI):
        if not isinstance(history, History):
            kind = type(history).__name__
            raise ValueError(f"history is a {kind}, expected the History that `vsp.distill` returns with a Config")
        self.history, self.maps = history, Maps(get_task(task))
        if (found := history.policy_at(0).task.name) != self.maps.task.name:
            raise ValueError(f"history is of a run on {found}, expected one on {self.maps.task.name}")
        check_plays(teacher, self.maps.task)
        self.stage, self._axes = self._set_stage(teacher, dpi)

    def __len__(self) -> int:
        return len(self.history.cells)

    def _set_stage(self, teacher: Policy, dpi: int) -> tuple[Stage, np.ndarray]:
        fig, axes = self.maps.panels(teacher, dpi)
        passes = [[e.iteration for e in self.history.events if e.kind == kind] for kind in ("split", "merge")]
        cells_and_changes(axes[2], np.array(self.history.cells), *passes)
        style.letter(axes, ["teacher", "distilled", "cells"])
        nothing = np.zeros((0, 2))
        changes(state_space.codewords(axes[1], nothing), nothing, nothing)  # for the legend
        style.legend_below(fig, axes[1], ncol=6)
        return Stage(fig), axes

    def shoot(self, n: int, *, since: int | None = None) -> np.ndarray:
        """Draw the run after iteration n, as uint8 (height, width, 3). Raises ValueError for n outside the run.

        Marks the codewords added or removed after iteration `since` (None: in the last iteration with a change).
        """
        policy = self.history.policy_at(n)
        came, went, _ = self._changed(n, self.last_change(n) - 1 if since is None else since)

        def paint() -> None:
            for ax in self._axes[:2]:
                self.maps.cells(ax, policy)
            self.maps.policy(self._axes[1], policy)
            changes(self._axes[1], *(np.reshape(sorted(places), (-1, 2)) for places in (came, went)))
            moment(self._axes[2], n, self.history.cells[n])

        return self.stage.shoot(paint)

    def _changed(self, n: int, since: int) -> tuple[set[tuple], set[tuple], set[tuple]]:
        """Return the codewords that changed in the iterations `since` < i <= n: those added that remain, those removed,
        and those both added and removed."""
        recent = [(e.kind, tuple(e.codeword)) for e in self.history.events if since < e.iteration <= n]
        there = set(map(tuple, self.history.policy_at(n).codewords))
        split, merged = ({place for kind, place in recent if kind == one} for one in ("split", "merge"))
        return split & there, merged - there, (merged - there) & split

    def moments(self, number: int) -> list[int]:
        """Return at most `number` iterations from first to last, denser early on, where most changes happen."""
        return np.unique((np.linspace(0, 1, number) ** 2 * (len(self) - 1)).astype(int)).tolist()

    def last_change(self, n: int) -> int:
        """Return the last iteration up to n with a split or merge; 0 if there is none."""
        return max((e.iteration for e in self.history.events if e.iteration <= n), default=0)

    def words(self, n: int) -> str:
        """Describe the run after iteration n."""
        k, last = self.history.cells[n], self.last_change(n)
        kinds = [e.kind for e in self.history.events if e.iteration == last]
        text = f"After iteration {n} (0 to {len(self) - 1}): {k} {'cell' if k == 1 else 'cells'}."
        if kinds:
            text += f" Last change, iteration {last}: {kinds.count('split')} came by splits, "
            text += f"{kinds.count('merge')} went by merges."
        if brief := len(self._changed(n, last - 1)[2]):
            text += f" Of these, {brief} came and went at once: a cross without a ring."
        return text


class Animation:
    """A GIF as shown in a notebook: its last frame, and the GIF in a closed fold, so that nothing moves unasked."""

    def __init__(self, gif: bytes, still: bytes, about: Caption):
        self.gif, self.still, self.about = gif, still, about

    def _repr_html_(self) -> str:
        width = int(WIDTH * DPI)
        still = style.embedded(self.still, f"The last frame of the moving picture: {self.about.alt}", width=width)
        moving = style.embedded(self.gif, self.about.alt, width=width)
        folded = f"<details><summary>play the moving picture</summary>{moving}</details>"
        return f"<figure>{still}{folded}{self.about.to_html('figcaption')}</figure>"

    def __repr__(self) -> str:
        return self.about.alt


def save_growth(
    history: History, teacher: Policy, task: str | Task, name: str, *, out: str | os.PathLike, quick: bool = False,
    alt: str | None = None,
) -> Animation:  # fmt: skip
    """Write OUT/figures/NAME.gif, and its last frame as NAME.png; return the animation to show.

    Early iterations, where most changes happen, get more frames than late ones. `alt` describes the animation for
    readers who cannot see it; `quick` adds a watermark. The files contain no dates, so the same run gives the same
    bytes. Raises ValueError as `Growth` does.
    """
    growth = Growth(history, teacher, task)
    if quick:
        growth.stage.watermark()
    moments = growth.moments(FRAMES)
    images = [growth.shoot(n, since=before) for before, n in zip([-1, *moments], moments)]
    return save_frames(images, name, out=out, alt=alt)


def save_frames(
    images: list[np.ndarray], name: str, *, out: str | os.PathLike, alt: str | None = None, step: int = STEP,
    hold: int = HOLD,
) -> Animation:  # fmt: skip
    """Write images (height, width, 3) as OUT/figures/NAME.gif, and the last one as NAME.png; return an animation.

    `step`: milliseconds per frame; `hold`: milliseconds of the last frame.
    """
    path, about = Path(out) / "figures" / name, caption_of("figures", name, alt=alt)
    with atomic.atomic_path(path.with_suffix(".gif")) as temporary:
        _write_gif(temporary, images, step, hold)
    with atomic.atomic_path(path.with_suffix(".png")) as temporary:
        temporary.write_bytes(png(images[-1], small=True))
    return Animation(path.with_suffix(".gif").read_bytes(), path.with_suffix(".png").read_bytes(), about)


def _write_gif(path: Path, images: list[np.ndarray], step: int, hold: int) -> None:
    """Write the frames with one common palette, so that each stores only the pixels that changed."""
    some = Image.fromarray(np.concatenate([images[i] for i in np.linspace(0, len(images) - 1, 6).astype(int)]))
    colours = np.reshape(some.quantize(COLOURS).getpalette(), (-1, 3))
    colours[(colours > 247).all(axis=1)] = 255  # the background stays white
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    frames = [Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    durations = [step] * (len(frames) - 1) + [hold]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=False)
