"""Checks of arrays at the boundary: one clear error that shows the offending value and what was expected."""

from __future__ import annotations

import math

import numpy as np


def check_finite(what: str, values: np.ndarray) -> np.ndarray:
    """`values` in float64. Raises ValueError, naming the first offender, for a wrong type, NaN or infinity."""
    values = np.asarray(values)
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{what} have type {values.dtype}, expected numbers")
    values = values.astype(np.float64, copy=False)
    if not math.isfinite(np.vdot(values, values)) and not np.isfinite(values).all():  # the sum of squares is quick
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise ValueError(f"{what} hold {values[where]} at index {where}, expected finite numbers")
    return values


def check_observations(observations: np.ndarray, d: int, task: str) -> np.ndarray:
    """`observations` in float64. Raises ValueError unless they are finite and of shape (d,) or (n, d)."""
    observations = np.asarray(observations)
    if observations.ndim not in (1, 2) or observations.shape[-1] != d:
        raise ValueError(f"observations have shape {observations.shape}, expected ({d},) or (n, {d}) for {task}")
    return check_finite("observations", observations)


def check_seed(seed: int) -> None:
    """Raise ValueError unless `seed` is an integer from 0 on: None, for one, would give another result each time."""
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool) or seed < 0:
        raise ValueError(f"seed is {seed!r}, expected an integer from 0 on")


def check_array(what: str, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """`values` in float64. Raises ValueError unless they are finite and of `shape`, where -1 stands for any number."""
    values = check_finite(what, values)
    if values.ndim != len(shape) or any(want not in (-1, got) for want, got in zip(shape, values.shape)):
        wanted = str(shape).replace("-1", "n")
        raise ValueError(f"{what} have shape {values.shape}, expected {wanted}")
    return values
