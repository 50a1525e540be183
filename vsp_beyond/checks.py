"""Checks of arguments, in addition to those of `vsp.checks`."""

from __future__ import annotations

import numpy as np


def check_number(what: str, value: float, *, least: float = -np.inf, most: float = np.inf) -> None:
    """Raise ValueError unless `value` is a finite number from `least` to `most`."""
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if not number or not np.isfinite(value) or not least <= value <= most:
        raise ValueError(f"{what} is {value!r}, expected a finite number from {least} to {most}")
