"""Figures (arrays drawn on `Axes`), and a widget that distils again whenever a setting changes.

Make a figure with `panels`, draw on its axes, save it with `save_figure`.
"""

import importlib

from .captions import Caption, caption_of
from .returns import box_plot, broken, intervals, ledger_gaps, margin, over_iterations, phase, reference, ticks
from .state_space import actions, arrows, cells, codewords, error_map, force_bar, force_map, grid, plane, square, trail
from .style import DISTILLED, FAILING, GOAL, OTHER, OURS, TEACHER, Picture, label, letter, panels, save_figure


def __getattr__(name: str) -> type:
    """Import `Laboratory` on first use: widgets take long to import, and most notebooks have none."""
    if name == "Laboratory":
        return getattr(importlib.import_module(f".{name.lower()}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
