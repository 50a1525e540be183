"""Checks of arguments. Each raises one clear error that shows the offending value and what was expected."""

import math
from collections.abc import Collection

import numpy as np


def check_finite(what: str, values: np.ndarray) -> np.ndarray:
    """Return `values` in float64. Raises ValueError for a wrong type, and for NaN or infinity, naming the first one."""
    try:
        values = np.asarray(values)
    except ValueError as error:  # rows of different lengths
        raise ValueError(f"{what} are not an array, expected numbers: {error}") from error
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{what} have type {values.dtype}, expected numbers")
    values = values.astype(np.float64, copy=False)
    if not math.isfinite(np.vdot(values, values)) and not np.isfinite(values).all():  # sum of squares: a quick test
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise ValueError(f"{what} hold {values[where]} at index {where}, expected finite numbers")
    return values


def check_observations(observations: np.ndarray, d: int, task: str) -> np.ndarray:
    """Return `observations` in float64. Raises ValueError unless they are finite and of shape (d,) or (n, d)."""
    observations = observations if isinstance(observations, np.ndarray) else check_finite("observations", observations)
    if observations.ndim not in (1, 2) or observations.shape[-1] != d:
        raise ValueError(f"observations have shape {observations.shape}, expected ({d},) or (n, {d}) for {task}")
    return check_finite("observations", observations)


def check_seed(seed: int) -> None:
    """Raise ValueError unless `seed` is a non-negative integer. None would give a different result each time."""
    check_count("seed", seed, least=0)


def check_count(what: str, value: int, *, least: int = 1, most: int | None = None) -> None:
    """Raise ValueError unless `value` is an integer of at least `least` and, if `most` is given, at most `most`."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):
        end = "on" if most is None else f"to {most}"
        raise ValueError(f"{what} is {value!r}, expected an integer from {least} {end}")


def check_number(what: str, value: float, *, least: float = -np.inf, most: float = np.inf) -> None:
    """Raise ValueError unless `value` is a finite number from `least` to `most`."""
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if not number or not np.isfinite(value) or not least <= value <= most:
        raise ValueError(f"{what} is {value!r}, expected a finite number from {least} to {most}")


def check_choice(what: str, value: str, known: Collection[str]) -> None:
    """Raise ValueError unless `value` is one of the names `known`."""
    if not isinstance(value, str) or value not in known:
        raise ValueError(f"{what} is {value!r}, expected one of {list(known)}")


def check_array(what: str, values: np.ndarray, shape: tuple[int, ...], *, most: float = np.inf) -> np.ndarray:
    """Return `values` in float64. Raises ValueError unless they are finite, at most `most` in absolute value, and of
    `shape`, where -1 matches any length."""
    values = check_finite(what, values)
    if values.ndim != len(shape) or any(want not in (-1, got) for want, got in zip(shape, values.shape)):
        wanted = str(shape).replace("-1", "n")
        raise ValueError(f"{what} have shape {values.shape}, expected {wanted}")
    if np.abs(values).max(initial=0.0) > most:
        raise ValueError(f"{what} hold {np.abs(values).max()}, expected numbers of at most {most} in absolute value")
    return values


def check_data(states: np.ndarray, actions: np.ndarray, d: int = -1, m: int = -1) -> tuple[np.ndarray, np.ndarray]:
    """Return states (n, d) and actions (n, m) in float64. Raises ValueError unless they are finite and n is not 0."""
    states = check_array("states", states, (-1, d))
    actions = check_array("actions", actions, (len(states), m))
    if not states.size:
        raise ValueError(f"states have shape {states.shape}, expected at least one state")
    return states, actions
